"""Register a ridge in a 3D scan as a feature with a height and a width that can be changed.

Names are imported where they are first used, so that a program is told of an interrupt from its start on.

Example:
    ridge = register(read_scan("clay.ply"), at=(12, -3.5, 0.8))
    ridge.resized(h=1.5).surface()
"""

from importlib import import_module

TYPE_CHECKING = False  # for type checkers it is True; importing it takes time

if TYPE_CHECKING:
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

# A module must not bear the name of a function here: importing it would replace the function.
_HOME = {
    "Diagnosis": "diagnosis",
    "NoRidgeError": "registration",
    "Ridge": "ridge",
    "Scan": "scan",
    "Section": "section",
    "Settings": "settings",
    "Surface": "bspline",
    "Template": "template",
    "diagnose": "diagnosis",
    "directed_hausdorff": "distance",
    "hausdorff": "distance",
    "load": "io",
    "mean_directed_hausdorff": "distance",
    "read_scan": "io",
    "register": "registration",
}


def __getattr__(name: str) -> object:
    if name in _HOME.values():
        return import_module(f"{__name__}.{name}")
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
