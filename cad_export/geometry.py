"""Surfaces to OCCT and back: the exact poles and knots, nothing refitted. OCP only, no cadquery."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.Geom import Geom_BSplineSurface
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape

from cad_export.surface_form import to_occt
from ridgefeature.bspline import Surface

DEGENERATE = 1e-7  # OCCT's Precision::Confusion, in the surface's unit: shorter borders count as a point


@runtime_checkable
class RidgeLike(Protocol):
    """What the exports need of a ridge feature: rates of height and width, and the surface for them."""

    def resized(self, *, h: float, w: float) -> RidgeLike: ...

    def surface(self) -> Surface: ...


def surface_for(source: RidgeLike | Surface, h: float = 1, w: float = 1) -> Surface:
    """The surface of a ridge at rates h and w, or a Surface itself.

    Raises ValueError for anything else, and for rates of a plain Surface, which has no height or width.
    """
    if isinstance(source, Surface):
        if h != 1 or w != 1:
            raise ValueError(
                f"expected a Ridge for rates h={h:g}, w={w:g}, got a Surface; leave h and w at 1"
            )
        return source
    if isinstance(source, RidgeLike):
        return (source if h == 1 and w == 1 else source.resized(h=h, w=w)).surface()
    raise ValueError(
        f"expected a Ridge or a Surface, got {type(source).__name__}; register or load one first"
    )


def from_occt(geometry: Geom_BSplineSurface) -> Surface:
    """The same poles and knots as a Surface; a periodic one is opened at its seam (exact).

    Raises ValueError for a rational surface: its weights have no place in a Surface.
    """
    g = geometry
    if g.IsUPeriodic() or g.IsVPeriodic():
        g = g.Copy()
        g.SetUNotPeriodic()
        g.SetVNotPeriodic()
    if g.IsURational() or g.IsVRational():
        raise ValueError(
            "expected a non-rational B-spline surface, got weights; only exact poles are taken over"
        )
    points = [[g.Pole(i, j) for j in range(1, g.NbVPoles() + 1)] for i in range(1, g.NbUPoles() + 1)]
    knots_u = [g.UKnot(i) for i in range(1, g.NbUKnots() + 1) for _ in range(g.UMultiplicity(i))]
    knots_v = [g.VKnot(i) for i in range(1, g.NbVKnots() + 1) for _ in range(g.VMultiplicity(i))]
    for knots, degree in ((knots_u, g.UDegree()), (knots_v, g.VDegree())):
        # the outermost knots bear on nothing; opening a seam leaves them outside of the clamped ends
        if knots[1] == knots[degree] and knots[-2] == knots[-degree - 1]:
            knots[0], knots[-1] = knots[1], knots[-2]
    return Surface(
        np.array([[(p.X(), p.Y(), p.Z()) for p in row] for row in points]),
        np.array(knots_u),
        np.array(knots_v),
        g.UDegree(),
        g.VDegree(),
    )


def make_face(surface: Surface) -> TopoDS_Face:
    """One face with the surface's natural bounds (OCCT's BRepBuilderAPI_MakeFace)."""
    maker = BRepBuilderAPI_MakeFace(to_occt(surface), DEGENERATE)
    if not maker.IsDone():
        raise ValueError(f"expected a surface that bounds a face, got {maker.Error().name}; check its poles")
    return maker.Face()


def surface_of(shape: Any) -> Surface:
    """The exact poles and knots of a shape's only face: a Surface in the shape's place.

    `shape` is a cq.Face, any object whose `.wrapped` is a TopoDS_Shape, or that itself. The face's borders
    and orientation are left out. Raises ValueError unless there is one face, on a non-rational B-spline.
    """
    faces = []
    explorer = TopExp_Explorer(topods(shape), TopAbs_FACE)
    while explorer.More():
        faces.append(TopoDS.Face_s(explorer.Current()))
        explorer.Next()
    if len(faces) != 1:
        raise ValueError(f"expected a shape with one face, got {len(faces)}; select a face first")
    geometry = BRep_Tool.Surface_s(faces[0])  # placed by the face's location
    if not isinstance(geometry, Geom_BSplineSurface):
        raise ValueError(f"expected a face on a B-spline surface, got {type(geometry).__name__}")
    return from_occt(geometry)


def topods(shape: Any) -> TopoDS_Shape:
    """The TopoDS_Shape itself or in `.wrapped`; ValueError when there is none or it is null."""
    wrapped = getattr(shape, "wrapped", shape)
    if not isinstance(wrapped, TopoDS_Shape) or wrapped.IsNull():
        raise ValueError(
            f"expected a CAD shape, got {type(shape).__name__}; give one of CadQuery, build123d or OCCT"
        )
    return wrapped
