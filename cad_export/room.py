"""Whether a ridge has room on a face at all, wherever it lies there: asked where a paste has failed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepGProp import BRepGProp
from OCP.GeomAbs import GeomAbs_Cone, GeomAbs_Cylinder, GeomAbs_Plane
from OCP.GProp import GProp_GProps
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from cad_export.crossings import same_surface
from cad_export.site import ON_HOST
from cad_export.strip import edge_points
from ridgefeature.base import developed
from ridgefeature.ridge import Ridge

Floats = NDArray[np.float64]
_SURE = 0.98
"""Parts of what is needed up to which a face is too small beyond doubt: outlines are sampled."""
_DIRECTIONS = 180


@contextmanager
def told_if_too_small(
    host: TopoDS_Shape, face: TopoDS_Face, ridge: Ridge | None, chosen_by: str
) -> Iterator[None]:
    """Say that the face is too small, where it is, in place of a ValueError inside; without a ridge never."""
    try:
        yield
    except ValueError:
        if ridge is not None:
            check_room(host, face, ridge, chosen_by)
        raise


def check_room(host: TopoDS_Shape, face: TopoDS_Face, ridge: Ridge, chosen_by: str) -> None:
    """Raise ValueError where no place of a plane, cylinder or cone has room for the ridge's footprint.

    In millimetres. The faces that go on from this one on the same surface count with it. chosen_by: the
    argument that led to it. A footprint needs its area, and on a plane a face that is as wide, whichever way
    one looks.
    """
    kind = BRepAdaptor_Surface(face).GetType()
    if kind not in (GeomAbs_Plane, GeomAbs_Cylinder, GeomAbs_Cone):
        return
    breadth = 2 * float(ridge.border.max())
    faces = same_surface(host, face, ON_HOST * breadth)
    area = sum(_area(f) for f in faces)
    outline = np.concatenate([edge_points(f, 0.02 * breadth)[0] for f in faces])
    roomy = area > _SURE * float(np.trapezoid(2 * ridge.border, ridge.arc_length))
    if roomy and (kind != GeomAbs_Plane or _may_hold(_flat(outline), _footprint(ridge))):
        return
    size = " x ".join(f"{x:.4g}" for x in np.ptp(outline, axis=0) if x > 1e-6 * breadth)
    raise ValueError(
        f"{chosen_by}: expected a face with room for the ridge, a strip "
        f"{ridge.length:.4g} mm long and {breadth:.4g} mm broad with its flanks, got one of {area:.4g} mm2, "
        f"{size} mm over all, too small wherever it lies; take a larger one, or a smaller ridge by scale= or "
        "ridge.stretched(length)"
    )


def _area(face: TopoDS_Face) -> float:
    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, properties)
    return abs(float(properties.Mass()))


def _may_hold(outline: Floats, footprint: Floats) -> bool:
    """Whether points (n, 2) are as wide in all directions as points (m, 2) turned somehow, or turned over."""
    room, needed = _widths(outline), _SURE * _widths(footprint)
    turned = [np.roll(widths, k) for widths in (needed, needed[::-1]) for k in range(_DIRECTIONS)]
    return bool((room >= turned).all(axis=1).any())


def _widths(points: Floats) -> Floats:
    angles = np.arange(_DIRECTIONS) * (np.pi / _DIRECTIONS)
    return np.ptp(points @ np.stack([np.cos(angles), np.sin(angles)]), axis=0)


def _flat(points: Floats) -> Floats:
    """Points (n, 3) of a plane in two coordinates of it."""
    centred = points - points.mean(axis=0)
    return np.asarray(centred @ np.linalg.svd(centred, full_matrices=False)[2][:2].T)


def _footprint(ridge: Ridge) -> Floats:
    """The borders of the ridge (2 k, 2), unrolled to a plane."""
    points, angles = developed(ridge)
    left = ridge.border[:, None] * np.column_stack([-np.sin(angles), np.cos(angles)])
    return np.concatenate([points + left, points - left])
