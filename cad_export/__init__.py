"""Ridge features as CAD: exact faces and solids in CadQuery, and STEP files.

Names are imported where they are first used: writing a STEP file needs OCP, but not all of cadquery.
Importing this package adds `pasteRidge` to CadQuery's Workplane, now or as soon as cadquery is imported.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from cad_export.workplane_method import install_when_loaded

if TYPE_CHECKING:
    from cad_export.carried import attach, carried_by
    from cad_export.fluent import ridge
    from cad_export.formats import write
    from cad_export.geometry import surface_of
    from cad_export.loading import carried_in, load
    from cad_export.pasting import paste
    from cad_export.record import Carried
    from cad_export.regeneration import regenerate
    from cad_export.shapes import face, solid
    from cad_export.step_file import read_step, step

__all__ = [
    "Carried",
    "attach",
    "carried_by",
    "carried_in",
    "face",
    "load",
    "paste",
    "read_step",
    "regenerate",
    "ridge",
    "solid",
    "step",
    "surface_of",
    "write",
]

# A module must not bear the name of a function here: importing it would replace the function.
_HOME = {
    "Carried": "record",
    "attach": "carried",
    "carried_by": "carried",
    "carried_in": "loading",
    "face": "shapes",
    "load": "loading",
    "paste": "pasting",
    "read_step": "step_file",
    "regenerate": "regeneration",
    "ridge": "fluent",
    "solid": "shapes",
    "step": "step_file",
    "surface_of": "geometry",
    "write": "formats",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


install_when_loaded()
