"""Where the border of a ridge crosses seams, and edges between faces on one surface. OCP only."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepTools import BRepTools
from OCP.GCPnts import GCPnts_AbscissaPoint
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Vertex

from cad_export import occt_arrays
from cad_export.check import subshapes
from cad_export.footprint import HostSurface, surface_on
from cad_export.polylines import polyline_meetings
from cad_export.site import SeamError
from ridgefeature.bspline import Curve

Floats = NDArray[np.float64]

AT_VERTEX = 1e-5
"""A crossing so near to a vertex of the border, in its breadths, is at the vertex."""
STEEPEST = 0.02
"""Least sine of the angle at which a border may cross an edge."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch of a ridge's border on the host: its edge there, on a curve with the edge's own parameter.

    forward: whether the border goes along it, round the ridge, as its parameter does. off: how far the edge
    is off the host.
    """

    edge: TopoDS_Edge
    curve: Curve
    span: tuple[float, float]
    forward: bool
    off: float

    @cached_property
    def ends(self) -> tuple[TopoDS_Vertex, TopoDS_Vertex]:
        """Its vertices at the ends of its span."""
        return _vertices(self.edge)

    def rate(self, t: float) -> Floats:
        """(3,) derivative, in the border's direction."""
        return self.curve(t, 1) * (1.0 if self.forward else -1.0)


def _vertices(edge: TopoDS_Edge) -> tuple[TopoDS_Vertex, TopoDS_Vertex]:
    forward = TopoDS.Edge_s(edge.Oriented(TopAbs_FORWARD))
    return TopExp.FirstVertex_s(forward, True), TopExp.LastVertex_s(forward, True)


@dataclass(frozen=True, eq=False)
class CutEdge:
    """An edge with the face, or faces on the same surface, on both sides: a border may cross it."""

    edge: TopoDS_Edge

    @cached_property
    def _curve(self) -> BRepAdaptor_Curve:
        return BRepAdaptor_Curve(self.edge)

    @cached_property
    def span(self) -> tuple[float, float]:
        """Its parameters, ascending."""
        return self._curve.FirstParameter(), self._curve.LastParameter()

    @cached_property
    def ends(self) -> tuple[TopoDS_Vertex, TopoDS_Vertex]:
        """Its vertices at the ends of its span."""
        return _vertices(self.edge)

    def points(self, s: Floats) -> Floats:
        """(n, 3) points at parameters (n,)."""
        return np.array([(p.X(), p.Y(), p.Z()) for p in map(self._curve.Value, s.tolist())])

    def tangent(self, s: float) -> Floats:
        """(3,) derivative."""
        point, rate = gp_Pnt(), gp_Vec()
        self._curve.D1(s, point, rate)
        return np.array([rate.X(), rate.Y(), rate.Z()])

    def samples(self, step: float) -> Floats:
        """Parameters (n,) of places about `step` apart."""
        count = int(np.clip(GCPnts_AbscissaPoint.Length_s(self._curve, 1e-3) / step, 8, 400))
        return np.linspace(*self.span, count + 1)


@dataclass(frozen=True, eq=False)
class Crossing:
    """A border's piece at parameter t and a cut edge at parameter s meet at a vertex.

    ahead: whether the host's part of the cut edge lies at greater parameters; the rest is under the ridge.
    """

    piece: int
    t: float
    cut: int
    s: float
    vertex: TopoDS_Vertex
    ahead: bool


def same_surface(host: TopoDS_Shape, face: TopoDS_Face, tolerance: float) -> list[TopoDS_Face]:
    """The face, and the host's faces that go on from it, edge by edge, on its surface to a tolerance.

    As the host holds them. They are told by 25 places on each; both sides must face the same way.
    """
    faces = [TopoDS.Face_s(f) for f in subshapes(host, TopAbs_FACE)]
    edges = occt_arrays.shape_map()
    around: dict[int, set[int]] = {}
    for k, f in enumerate(faces):
        for e in subshapes(f, TopAbs_EDGE):
            around.setdefault(edges.Add(e), set()).add(k)
    surface = surface_on(face)
    found = [k for k, f in enumerate(faces) if f.IsSame(face)]
    tried = set(found)
    for k in found:
        near = {j for e in subshapes(faces[k], TopAbs_EDGE) for j in around[edges.FindIndex(e)]}
        for j in sorted(near - tried):
            tried.add(j)
            if _lies_on(faces[j], surface, face, tolerance):
                found.append(j)
    return [faces[k] for k in found]


def _lies_on(other: TopoDS_Face, surface: HostSurface, face: TopoDS_Face, tolerance: float) -> bool:
    u0, u1, v0, v1 = BRepTools.UVBounds_s(other)
    t = np.linspace(0.0, 1.0, 5)
    places = np.stack(np.meshgrid(u0 + (u1 - u0) * t, v0 + (v1 - v0) * t), axis=-1).reshape(-1, 2)
    points = surface_on(other).points(places)
    uv = surface.parameters(points)
    if not np.linalg.norm(surface.points(uv) - points, axis=1).max() <= tolerance:
        return False
    middle = len(places) // 2
    return bool(outward(other, places[middle]) @ outward(face, uv[middle]) > 0)


def outward(face: TopoDS_Face, uv: Floats) -> Floats:
    """(3,) the face's outward normal at parameters (2,), not of unit length."""
    point, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    BRep_Tool.Surface_s(face).D1(float(uv[0]), float(uv[1]), point, du, dv)
    normal = du.Crossed(dv)
    side = -1.0 if face.Orientation() == TopAbs_REVERSED else 1.0
    return side * np.array([normal.X(), normal.Y(), normal.Z()])


def cut_edges(faces: list[TopoDS_Face]) -> list[CutEdge]:
    """The edges with one of these faces on either side: seams, and edges between two of them."""
    edges = occt_arrays.shape_map()
    count: dict[int, int] = {}
    for face in faces:
        for shape in subshapes(face, TopAbs_EDGE):
            k = edges.Add(shape)
            count[k] = count.get(k, 0) + 1
    both = [TopoDS.Edge_s(edges.FindKey(k)) for k, n in count.items() if n == 2]
    return [CutEdge(edge) for edge in both if not BRep_Tool.Degenerated_s(edge)]


def crossings(
    border: list[Stretch], cuts: list[CutEdge], face: TopoDS_Face, breadth: float, most: float
) -> list[Crossing]:
    """Where a closed border crosses the cut edges, in ascending order of its stretches and their parameters.

    most: how far apart the two may be there. Raises SeamError where they run along each other, or meet where
    the cut edge ends.
    """
    surface = surface_on(face)
    lines = _lines(border, surface)
    found: list[Crossing] = []
    for c, cut in enumerate(cuts):
        s = cut.samples(0.25 * breadth)
        flat = surface.parameters(cut.points(s))
        for k, t, at in _meetings(lines, flat, surface.periods):
            start = float(np.interp(at, np.arange(len(s)), s))
            point, t, vertex = _met(border[k], t, cut, start, breadth)
            if any(x.cut == c and _same(border, x, k, t, vertex, breadth) for x in found):
                continue
            apart = float(np.linalg.norm(cut.points(np.array([point]))[0] - border[k].curve(t)))
            if not apart <= most or _is_at_end(cut, point, breadth):
                raise SeamError("surface: expected a border clear of where a seam ends, it runs over there")
            BRep_Builder().UpdateVertex(vertex, 1.1 * apart + 1e-7)
            ahead = _is_ahead(border, k, t, cut.tangent(point), face, vertex)
            found.append(Crossing(k, t, c, point, vertex, ahead))
    return sorted(found, key=lambda x: (x.piece, x.t))


def _same(
    border: list[Stretch], known: Crossing, k: int, t: float, vertex: TopoDS_Vertex, breadth: float
) -> bool:
    """Whether a crossing of stretch k at t is one that is known: polylines meet twice at a corner."""
    gap = float(np.linalg.norm(border[known.piece].curve(known.t) - border[k].curve(t)))
    return known.vertex.IsSame(vertex) or (known.piece == k and gap < AT_VERTEX * breadth)


def _is_at_end(cut: CutEdge, s: float, breadth: float) -> bool:
    points = cut.points(np.array([*cut.span, s]))
    return bool(np.linalg.norm(points[:2] - points[2], axis=1).min() < AT_VERTEX * breadth)


def _lines(border: list[Stretch], surface: HostSurface) -> list[tuple[Floats, Floats]]:
    """Parameters (n,) of each stretch, as the border goes, and its way (n, 2) on the host, going on."""
    lines: list[tuple[Floats, Floats]] = []
    for stretch in border:
        low, high = stretch.span
        breaks = np.unique(stretch.curve.knots)
        breaks = np.concatenate([[low], breaks[(breaks > low) & (breaks < high)], [high]])
        t = np.interp(np.arange(8 * (len(breaks) - 1) + 1) / 8, np.arange(len(breaks)), breaks)
        t = t if stretch.forward else t[::-1]
        uv = surface.parameters(stretch.curve(t))
        if lines:
            period = np.array(surface.periods)
            turns = (lines[-1][1][-1] - uv[0]) / np.where(period > 0, period, np.inf)
            uv = uv + period * np.round(turns)
        lines.append((t, uv))
    return lines


def _meetings(
    lines: list[tuple[Floats, Floats]], cut: Floats, periods: tuple[float, float]
) -> list[tuple[int, float, float]]:
    """Stretch, parameter on it, and place along a cut edge's polyline (n, 2), moved by whole periods."""
    found = []
    for k, (t, uv) in enumerate(lines):
        turns = [_turns(uv[:, i], cut[:, i], p) for i, p in enumerate(periods)]
        for move in ((a, b) for a in turns[0] for b in turns[1]):
            for m, x, n, y in polyline_meetings(uv, cut + np.multiply(move, periods)):
                found.append((k, float(t[m] + x * (t[m + 1] - t[m])), n + y))
    return found


def _turns(line: Floats, cut: Floats, period: float) -> range:
    """By how many periods the cut's coordinates may be moved to reach the line's."""
    if not period:
        return range(1)
    slack = 1e-6 * period
    least, most = (line.min() - cut.max() - slack) / period, (line.max() - cut.min() + slack) / period
    return range(int(np.ceil(least)), int(np.floor(most)) + 1)


def _met(
    stretch: Stretch, t: float, cut: CutEdge, s: float, breadth: float
) -> tuple[float, float, TopoDS_Vertex]:
    """Parameters s and t where the two meet, by Newton steps in space, and the vertex there.

    Near a vertex of the border that vertex is taken.
    """
    curve = stretch.curve
    for _ in range(20):
        t, s = float(np.clip(t, *stretch.span)), float(np.clip(s, *cut.span))
        gap = cut.points(np.array([s]))[0] - curve(t)
        rates = np.stack([curve(t, 1), -cut.tangent(s)], axis=1)
        step = np.linalg.lstsq(rates, gap, rcond=None)[0]
        t, s = t + float(step[0]), s + float(step[1])
        if np.abs(step / [np.ptp(stretch.span), np.ptp(cut.span)]).max() < 1e-14:
            break
    t, s = float(np.clip(t, *stretch.span)), float(np.clip(s, *cut.span))
    point = curve(t)
    off = [float(np.linalg.norm(curve(end) - point)) for end in stretch.span]
    near = int(np.argmin(off))
    if off[near] < AT_VERTEX * breadth:
        return s, stretch.span[near], stretch.ends[near]
    vertex = TopoDS_Vertex()
    BRep_Builder().MakeVertex(vertex, gp_Pnt(*point.tolist()), 1e-7)
    return s, t, vertex


def _is_ahead(
    border: list[Stretch], k: int, t: float, along: Floats, face: TopoDS_Face, vertex: TopoDS_Vertex
) -> bool:
    """Whether the cut edge leaves the ridge there; at a vertex both of the border's stretches must agree."""
    point = border[k].curve(t)
    normal = outward(face, surface_on(face).parameters(point[None])[0])
    rates = [border[k].rate(t)]
    for stretch in border:
        both = zip(stretch.span, stretch.ends, strict=True)
        rates += [stretch.rate(at) for at, other in both if other.IsSame(vertex)]
    size = np.linalg.norm(normal) * np.linalg.norm(along)
    sines = [float(normal @ np.cross(along, rate) / (size * np.linalg.norm(rate))) for rate in rates]
    if min(map(abs, sines)) < STEEPEST or np.ptp(np.sign(sines)) > 0:
        raise SeamError("surface: expected a border that crosses a seam, it runs along it; move the path")
    return sines[0] > 0
