"""A warning for faces that fold over themselves, which OCCT calls valid."""

from __future__ import annotations

import warnings

from cad_export.geometry import RidgeLike, surface_for
from ridgefeature.bspline import Surface
from ridgefeature.folds import told_folds
from ridgefeature.ridge import Ridge


def checked_surface(source: RidgeLike | Surface, h: float = 1, w: float = 1) -> Surface:
    """What `surface_for` makes of it; with a UserWarning where a Ridge's surface folds over itself."""
    surface = surface_for(source, h, w)
    said = told_folds(source, surface) if isinstance(source, Ridge) else ""
    if said:
        warnings.warn(said, UserWarning, stacklevel=3)
    return surface
