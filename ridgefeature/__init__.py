"""Register a ridge in a 3D scan as a feature with a height and a width that can be changed.

Example:
    ridge = register(read_scan("clay.ply"), at=(12, -3.5, 0.8))
    ridge.resized(h=1.5).surface()
"""

from ridgefeature.bspline import Surface
from ridgefeature.diagnosis import Diagnosis, diagnose
from ridgefeature.distance import directed_hausdorff, hausdorff, mean_directed_hausdorff
from ridgefeature.io import load, read_scan
from ridgefeature.registration import NoRidgeError, register
from ridgefeature.ridge import Ridge
from ridgefeature.scan import Scan
from ridgefeature.section import Section
from ridgefeature.settings import Settings
from ridgefeature.template import Template

__version__ = "0.1.0"

__all__ = [
    "Diagnosis",
    "NoRidgeError",
    "Ridge",
    "Scan",
    "Section",
    "Settings",
    "Surface",
    "Template",
    "diagnose",
    "directed_hausdorff",
    "hausdorff",
    "load",
    "mean_directed_hausdorff",
    "read_scan",
    "register",
]
