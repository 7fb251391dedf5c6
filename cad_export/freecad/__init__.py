"""Ridges for FreeCAD: a macro that FreeCAD runs with its own Python, without our packages."""

from __future__ import annotations

from cad_export.freecad.macro import write_macro

__all__ = ["write_macro"]
