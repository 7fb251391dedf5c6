"""A loop of curves on a face of the host: parameters, parameter curves, and what it must not cross.

OCP only, no cadquery.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve2d
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_BSplineCurve, Geom_Surface
from OCP.Geom2d import Geom2d_BSplineCurve
from OCP.GeomAbs import (
    GeomAbs_Cone,
    GeomAbs_Cylinder,
    GeomAbs_Line,
    GeomAbs_Plane,
    GeomAbs_Sphere,
    GeomAbs_Torus,
)
from OCP.GeomAdaptor import GeomAdaptor_Surface
from OCP.gp import gp_Ax3, gp_Pln, gp_Pnt
from OCP.ShapeAnalysis import ShapeAnalysis_Surface
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FORWARD, TopAbs_WIRE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Wire

from cad_export import occt_arrays
from cad_export.check import subshapes
from cad_export.host_surface import Evaluator, elementary
from ridgefeature.basis import Places, basis_matrix
from ridgefeature.bspline import Curve, clamped_knots, greville

Floats = NDArray[np.float64]

_SPLIT = 2  # knot spans of a parameter curve for each one of its edge
_KEPT_CURVES, _KEPT_HOSTS = 64, 8
_HOSTS: OrderedDict[tuple[int, int], tuple[HostSurface, object]] = OrderedDict()
"""Host surfaces asked for lately, with the faces' own shapes, held so that their identity stays theirs."""


@dataclass(frozen=True)
class HostSurface:
    """The surface of a host face, placed, with its inverse: parameters of points on it."""

    geometry: Geom_Surface
    known: OrderedDict[tuple[object, ...], OnHost] = field(default_factory=OrderedDict, compare=False)
    """Curves whose parameter curves were asked for lately: a slider asks for most of them again."""

    @cached_property
    def _adaptor(self) -> GeomAdaptor_Surface:
        return GeomAdaptor_Surface(self.geometry)

    @cached_property
    def _jet(self) -> Evaluator | None:
        return elementary(self._adaptor)

    @cached_property
    def plane(self) -> gp_Pln | None:
        """The plane, if it is one."""
        return self._adaptor.Plane() if self._adaptor.GetType() == GeomAbs_Plane else None

    @cached_property
    def periods(self) -> tuple[float, float]:
        """Length of the parameter range along u and v where the surface closes on itself, else 0."""
        g, (u0, u1, v0, v1) = self.geometry, self.geometry.Bounds()
        return (u1 - u0 if g.IsUClosed() else 0.0), (v1 - v0 if g.IsVClosed() else 0.0)

    def parameters(self, points: Floats) -> Floats:
        """(n, 2) parameters of the nearest points of the surface to points (n, 3), continuous along them."""
        kind = self._adaptor.GetType()
        inverse = {
            GeomAbs_Plane: self._on_plane,
            GeomAbs_Cylinder: self._on_cylinder,
            GeomAbs_Cone: self._on_cone,
            GeomAbs_Sphere: self._on_sphere,
            GeomAbs_Torus: self._on_torus,
        }.get(kind, self._on_other)
        uv = inverse(points)
        for k, period in enumerate(self.periods):
            if period:
                uv[:, k] = np.unwrap(uv[:, k], period=period)
        return uv

    def points(self, uv: Floats) -> Floats:
        """(n, 3) points of the surface at parameters (n, 2)."""
        if self._jet:
            return self._jet(uv[:, 0], uv[:, 1], 1)[0]
        return np.array([self._adaptor.Value(u, v).Coord() for u, v in uv.tolist()])

    def _on_plane(self, points: Floats) -> Floats:
        return _local(self._adaptor.Plane().Position(), points)[:, :2]

    def _on_cylinder(self, points: Floats) -> Floats:
        x, y, z = _local(self._adaptor.Cylinder().Position(), points).T
        return np.column_stack([np.arctan2(y, x), z])

    def _on_cone(self, points: Floats) -> Floats:
        cone = self._adaptor.Cone()
        x, y, z = _local(cone.Position(), points).T
        a = cone.SemiAngle()
        v = (np.hypot(x, y) - cone.RefRadius()) * np.sin(a) + z * np.cos(a)
        return np.column_stack([np.arctan2(y, x), v])

    def _on_sphere(self, points: Floats) -> Floats:
        x, y, z = _local(self._adaptor.Sphere().Position(), points).T
        return np.column_stack([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))])

    def _on_torus(self, points: Floats) -> Floats:
        torus = self._adaptor.Torus()
        x, y, z = _local(torus.Position(), points).T
        return np.column_stack([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y) - torus.MajorRadius())])

    def _on_other(self, points: Floats) -> Floats:
        analysis = ShapeAnalysis_Surface(self.geometry)
        uv = np.empty((len(points), 2))
        last = None
        for i, p in enumerate(points.tolist()):
            at = gp_Pnt(*p)
            last = analysis.ValueOfUV(at, 1e-9) if last is None else analysis.NextValueOfUV(last, at, 1e-9)
            uv[i] = last.X(), last.Y()
        return uv


def _local(axes: gp_Ax3, points: Floats) -> Floats:
    """Points in the coordinates of a placement."""
    d = (axes.XDirection(), axes.YDirection(), axes.Direction())
    frame = np.array([(k.X(), k.Y(), k.Z()) for k in d])
    o = axes.Location()
    return (points - np.array([o.X(), o.Y(), o.Z()])) @ frame.T


@dataclass(frozen=True)
class OnHost:
    """A curve's parameter curve on the host, a polyline along it, and how far the curve is off the host."""

    flat: Curve
    polyline: Floats
    distance: float


def on_host(
    host: HostSurface, curve: Curve, span: tuple[float, float], start: Floats | None, forward: bool = True
) -> OnHost:
    """The parameter curve of a space curve's stretch, with the curve's own parameter.

    start: (2,) parameters from which it goes on where the surface is periodic; the polyline begins there.
    With forward=False it runs against the curve.
    """
    begin = None if start is None else start.tobytes()
    key = (curve.poles.tobytes(), curve.knots.tobytes(), span, begin, forward)
    if key not in host.known:
        host.known[key] = _on_host(host, curve, span, start, forward)
        while len(host.known) > _KEPT_CURVES:
            host.known.popitem(last=False)
    return host.known[key]


def _on_host(
    host: HostSurface, curve: Curve, span: tuple[float, float], start: Floats | None, forward: bool
) -> OnHost:
    to = _flattening(curve.knots.tobytes(), curve.degree, span)
    uv = host.parameters(to.curve_at_sites(curve.poles))
    shift = np.zeros(2) if start is None else start - uv[0 if forward else -1]
    for k, period in enumerate(host.periods):
        if period:
            uv[:, k] += period * np.round(shift[k] / period)
    flat = Curve(to.flat_from_sites @ uv, to.knots, curve.degree)
    fine = to.flat_fine(flat.poles)
    off = np.linalg.norm(host.points(fine) - to.curve_fine(curve.poles), axis=1)
    line = fine[::2]
    return OnHost(flat, line if forward else line[::-1], float(off.max()))


@dataclass(frozen=True, eq=False)
class _Flattening:
    """What the parameter curves of all curves with the same knots have in common.

    knots: theirs. flat_from_sites: from values at the sites to their poles. Places: these sites on the curve,
    and fine ones between, for the distance.
    """

    knots: Floats
    flat_from_sites: Floats
    curve_at_sites: Places
    flat_fine: Places
    curve_fine: Places


@lru_cache(4)  # the ends of a ridge have the same knots at all its widths
def _flattening(knots: bytes, degree: int, span: tuple[float, float]) -> _Flattening:
    own = np.frombuffer(knots)
    flat = _refined(own, degree, span, _SPLIT)
    fine = _refined(own, degree, span, 4 * _SPLIT)[degree:-degree]
    sites = greville(flat, degree)
    inverse = np.asarray(np.linalg.inv(basis_matrix(flat, degree, sites)), dtype=np.float64)
    places = ((own, sites), (flat, fine), (own, fine))
    return _Flattening(flat, inverse, *(Places.at(k, degree, t) for k, t in places))


def _refined(knots: Floats, degree: int, span: tuple[float, float], split: int) -> Floats:
    """Clamped knots on a stretch, every span of the curve's cut in `split`."""
    low, high = span
    slack = 1e-9 * (high - low)
    breaks = np.unique(knots)
    breaks = np.concatenate([[low], breaks[(breaks > low + slack) & (breaks < high - slack)], [high]])
    at = np.arange(split * (len(breaks) - 1) + 1) / split
    return clamped_knots(np.interp(at, np.arange(len(breaks)), breaks), degree)


def occt_curve(curve: Curve) -> Geom_BSplineCurve | Geom2d_BSplineCurve:
    """A curve, poles (n, 3) or (n, 2), with the same poles and knots in OCCT; kept, as sliders ask again."""
    return _occt_curve(curve.poles.tobytes(), curve.poles.shape[1], curve.knots.tobytes(), curve.degree)


@lru_cache(_KEPT_CURVES)
def _occt_curve(
    poles: bytes, dimension: int, knots: bytes, degree: int
) -> Geom_BSplineCurve | Geom2d_BSplineCurve:
    where = *occt_arrays.knots(knots), degree
    points = np.frombuffer(poles).reshape(-1, dimension)
    if dimension == 2:
        return Geom2d_BSplineCurve(occt_arrays.points1_2d(points), *where)
    return Geom_BSplineCurve(occt_arrays.points1(points), *where)


def wires_of(face: TopoDS_Face) -> list[TopoDS_Wire]:
    """The wires of a face, the outer one first, oriented as the face holds them, whichever way it faces."""
    outer = BRepTools.OuterWire_s(face)
    wires = [TopoDS.Wire_s(w) for w in subshapes(face.Oriented(TopAbs_FORWARD), TopAbs_WIRE)]
    return sorted(wires, key=lambda wire: not wire.IsSame(outer))


def segments_of(wire: TopoDS_Wire, face: TopoDS_Face) -> Floats:
    """(n, 2, 2) straight pieces along a wire in the face's parameters."""
    pieces = [_segments(TopoDS.Edge_s(e), face) for e in subshapes(wire, TopAbs_EDGE)]
    return np.concatenate(pieces) if pieces else np.empty((0, 2, 2))


def _segments(edge: TopoDS_Edge, face: TopoDS_Face) -> Floats:
    curve = BRepAdaptor_Curve2d(edge, face)
    count = 1 if curve.GetType() == GeomAbs_Line else 8 + 4 * curve.NbKnots() if _is_spline(curve) else 64
    t = np.linspace(curve.FirstParameter(), curve.LastParameter(), count + 1).tolist()
    line = np.array([(p.X(), p.Y()) for p in map(curve.Value, t)])
    return np.stack([line[:-1], line[1:]], axis=1)


def seams_of(face: TopoDS_Face) -> Floats:
    """(n, 2, 2) straight pieces along the seams of a face, on both sides of it."""
    edges = (TopoDS.Edge_s(e) for wire in wires_of(face) for e in subshapes(wire, TopAbs_EDGE))
    lines = [_segments(e, face) for e in edges if BRep_Tool.IsClosed_s(e, face)]
    return np.concatenate(lines) if lines else np.empty((0, 2, 2))


def _is_spline(curve: BRepAdaptor_Curve2d) -> bool:
    return curve.GetType().name == "GeomAbs_BSplineCurve"


def surface_on(face: TopoDS_Face) -> HostSurface:
    """The placed surface under a face; the same one for the same face."""
    tshape = face.TShape()
    key = id(tshape), face.Location().HashCode()
    if key not in _HOSTS:
        _HOSTS[key] = HostSurface(BRep_Tool.Surface_s(face)), tshape
        while len(_HOSTS) > _KEPT_HOSTS:
            _HOSTS.popitem(last=False)
    return _HOSTS[key][0]
