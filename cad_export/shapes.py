"""Ridges as CadQuery shapes: a face with the exact poles, and a slab under it."""

from __future__ import annotations

import cadquery as cq

from cad_export.geometry import RidgeLike, make_face, surface_for
from cad_export.slab import make_slab
from ridgefeature.bspline import Surface


def face(ridge: RidgeLike | Surface, h: float = 1, w: float = 1) -> cq.Face:
    """One face with the exact poles and knots of ridge.resized(h=h, w=w).surface(), or of a Surface.

    In the frame and unit of the ridge; natural bounds; its normal is du x dv. Raises ValueError for anything
    that is neither, and for rates of a plain Surface.
    """
    return cq.Face(make_face(surface_for(ridge, h, w)))


def solid(
    ridge: RidgeLike | Surface, thickness: float, h: float = 1, w: float = 1, check: bool = True
) -> cq.Solid:
    """A closed solid: the exact ridge face, the base moved down by `thickness`, and ruled sides between.

    Down is against the base's normals (a Surface is its own base), so the thickness holds at the ridge's feet
    and does not change with h. Lengths in the ridge's unit, thickness > 0 and more than a groove is deep.
    Checked before it is returned: one closed valid solid, of the volume that its faces enclose, no faces that
    cross each other. That last search takes most of the time, up to seconds for long ridges; check=False
    leaves it out. Raises ValueError when a check fails.
    """
    top = surface_for(ridge, h, w)
    base = top if isinstance(ridge, Surface) else surface_for(ridge, 0, w)
    return cq.Solid(make_slab(top, base, thickness, check))
