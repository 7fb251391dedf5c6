"""Ridges as CadQuery shapes: a face with the exact poles, and a slab under it."""

from __future__ import annotations

from dataclasses import replace

import cadquery as cq
import numpy as np
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_BSplineSurface
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from cad_export.carried import attach, faces_of
from cad_export.fold_warning import checked_surface
from cad_export.geometry import RidgeLike, make_face, surface_for
from cad_export.occt_arrays import pole_array
from cad_export.record import record_of
from cad_export.slab import make_slab
from ridgefeature.bspline import Surface


def face(ridge: RidgeLike | Surface, h: float = 1, w: float = 1, unit: str | None = None) -> cq.Face:
    """One face with the exact poles and knots of ridge.resized(h=h, w=w).surface(), or of a Surface.

    In the frame of the ridge and in its unit, or another one such as "mm", where a Surface has none; natural
    bounds; its normal is du x dv. Raises ValueError for anything that is neither, for rates of a plain
    Surface and for an unknown unit; warns where a ridge's surface folds over itself. The face carries the
    feature (`carried_by`).
    """
    surface = checked_surface(ridge, h, w)
    if unit is not None:
        from ridgefeature.scan import millimetres_per  # brings compiled code, which most exports do without

        factor = millimetres_per(getattr(ridge, "unit", unit)) / millimetres_per(unit)
        surface = surface if factor == 1 else replace(surface, poles=factor * surface.poles)
    made = make_face(surface)
    attach(made, record_of(ridge, h, w))
    return cq.Face(made)


def solid(
    ridge: RidgeLike | Surface, thickness: float, h: float = 1, w: float = 1, check: bool = True
) -> cq.Solid:
    """A closed solid: the exact ridge face, the base moved down by `thickness`, and ruled sides between.

    Down is against the base's normals (a Surface is its own base), so the thickness holds at the ridge's feet
    and does not change with h. Lengths, thickness too, are in the ridge's unit, where `paste` and `step` give
    millimetres. The thickness is above 0, more than a groove is deep, and less than the base's radius of
    curvature. Checked before it is returned: one closed valid solid, of the volume that its faces enclose, no
    faces that cross each other, as up to 200 x 40 samples of them tell; check=False leaves that search out.
    The solid carries the feature (`carried_by`). Raises ValueError when a check fails, and says then which
    thickness goes.
    """
    top = checked_surface(ridge, h, w)
    base = top if isinstance(ridge, Surface) else surface_for(ridge, 0, w)
    made = make_slab(top, base, thickness, check)
    attach(_face_on(made, top), record_of(ridge, h, w))
    return cq.Solid(made)


def _face_on(shape: TopoDS_Shape, surface: Surface) -> TopoDS_Face:
    """The face of a shape with exactly this surface's poles."""
    for face in faces_of(shape):
        geometry = BRep_Tool.Surface_s(face)
        if isinstance(geometry, Geom_BSplineSurface):
            poles = pole_array(geometry)
            if poles.shape == surface.poles.shape and np.array_equal(poles, surface.poles):
                return face
    raise ValueError("expected the surface's own face in the solid, sewing has changed it; thicken the solid")
