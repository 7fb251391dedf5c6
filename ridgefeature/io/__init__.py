"""Reading scans from files; saving and loading features."""

from ridgefeature.io.feature import load
from ridgefeature.io.read import read_scan

__all__ = ["load", "read_scan"]
