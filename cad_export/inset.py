"""A ridge surface set into a face of a solid, without boolean operations. OCP only, no cadquery.

The surface's border becomes a hole in the host's face; the surface and, at the ends of an open ridge, a cap
between its last row and the base close the hole. All other faces of the host are the very same afterwards.
The boundary representation is built with OCCT's BRep_Builder: edges are shared from the start, so that
nothing has to be sewn.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.Geom import Geom_Curve, Geom_Surface
from OCP.Geom2d import Geom2d_Curve, Geom2d_Line
from OCP.gp import gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED, TopAbs_SHELL, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import (
    TopoDS,
    TopoDS_Edge,
    TopoDS_Face,
    TopoDS_Shape,
    TopoDS_Shell,
    TopoDS_Solid,
    TopoDS_Vertex,
    TopoDS_Wire,
)

from cad_export.certificate import Change, certify, subshapes
from cad_export.end_caps import Lift, lifts, volume_between
from cad_export.fallbacks import sunk_fuse
from cad_export.footprint import (
    HostSurface,
    OnHost,
    cross,
    curve2d,
    inside,
    meetings,
    on_host,
    seams_of,
    segments_of,
    signed_area,
    surface_on,
    wires_of,
)
from cad_export.geometry import DEGENERATE, to_occt
from ridgefeature.bspline import Curve, Surface, greville

Floats = NDArray[np.float64]
ON_HOST = 1e-4
"""The border may lie off the host's face by this part of its own breadth."""


LIFT = 3e-7
"""A row less than this part of its breadth off the base counts as on it: there edges are shared."""


@dataclass(frozen=True)
class InsetReport:
    """How a surface was set into a host.

    method: "inset", "turned seam" or "sunk fuse"; volumes and tolerance in the host's unit; volume_added is
    measured on the solid, below 0 for a groove; volume_expected is the surface's own integral.
    """

    method: str
    volume_added: float
    volume_expected: float
    largest_tolerance: float
    seconds: float


@dataclass(frozen=True)
class _Piece:
    """A piece of the surface's border: its edge, and the one on the host (the same, or under a cap)."""

    edge: TopoDS_Edge
    pcurve: Geom2d_Curve
    curve: Curve
    span: tuple[float, float]
    forward: bool
    lift: Lift | None = None
    foot: TopoDS_Edge | None = None

    @property
    def on_host(self) -> TopoDS_Edge:
        return self.edge if self.foot is None else self.foot


def inset(
    host: TopoDS_Shape,
    face: TopoDS_Face,
    surface: Surface,
    base: Surface,
    check: bool = True,
) -> tuple[TopoDS_Solid, InsetReport]:
    """The host with the surface in place of a part of one of its faces, and a report.

    surface: the ridge, du x dv away from the material; base: the same for height 0, same knots, whose border
    lies on `face` (to 1e-4 of its breadth). A surface closed along u is a ring: what it encloses stays.
    Lengths in the host's unit. The host is not altered; faces other than `face` are shared with it.
    With check=False only the fast certificate is asked of the result. Raises ValueError, saying what to
    change, for a host that is not one solid, a face that is not the host's, a border that is off the face,
    leaves it or overlaps a hole in it, and a result that fails a check.
    """
    start = time.perf_counter()
    placed = _face_of(host, face)
    _check_pair(surface, base)
    expected = volume_between(surface, base)
    try:
        change, method = _build(host, placed, surface, base, expected), "inset"
        certify(change, thorough=check)
    except SeamError:
        change, method = sunk_fuse(host, surface, base, check), "sunk fuse"
    return change.solid, InsetReport(
        method,
        change.volume_added,
        change.volume_expected,
        change.largest_tolerance,
        time.perf_counter() - start,
    )


def face_with(solid: TopoDS_Shape, surface: Surface) -> TopoDS_Face:
    """The face of a solid that lies on exactly this surface (poles to 1e-12 of its size).

    Raises ValueError when there is none.
    """
    from OCP.Geom import Geom_BSplineSurface

    size = 1e-12 * float(np.abs(surface.poles).max())
    nu, nv, _ = surface.poles.shape
    for found in subshapes(solid, TopAbs_FACE):
        g = BRep_Tool.Surface_s(TopoDS.Face_s(found))
        if not isinstance(g, Geom_BSplineSurface) or (g.NbUPoles(), g.NbVPoles()) != (nu, nv):
            continue
        poles = [[g.Pole(i, j) for j in range(1, nv + 1)] for i in range(1, nu + 1)]
        if (
            np.abs(np.array([[(p.X(), p.Y(), p.Z()) for p in r] for r in poles]) - surface.poles).max()
            <= size
        ):
            return TopoDS.Face_s(found)
    raise ValueError("expected a solid with a face on this surface, got none; paste it first")


def _face_of(host: TopoDS_Shape, face: TopoDS_Face) -> TopoDS_Face:
    """The face as the host holds it, oriented outwards."""
    if not isinstance(host, TopoDS_Shape) or host.IsNull():
        raise ValueError(
            f"host: expected one solid, got {type(host).__name__} without a shape; make it first"
        )
    solids = subshapes(host, TopAbs_SOLID)
    if len(solids) != 1:
        raise ValueError(f"host: expected one solid, got {len(solids)}; select one or fuse them")
    if not isinstance(face, TopoDS_Face) or face.IsNull():
        raise ValueError(f"face: expected a face of the host, got {type(face).__name__}; select one")
    for own in subshapes(solids[0], TopAbs_FACE):
        if own.IsSame(face):
            return TopoDS.Face_s(own)
    raise ValueError("face: expected a face of the host, got one of another shape; select it on this host")


def _check_pair(surface: Surface, base: Surface) -> None:
    for a in (surface, base):
        for knots, degree in ((a.knots_u, a.degree_u), (a.knots_v, a.degree_v)):
            if knots[0] != knots[degree] or knots[-1] != knots[-degree - 1]:
                raise ValueError("surface: expected clamped knots, got open ends; repeat the end knots")
    if not (np.array_equal(surface.knots_u, base.knots_u) and np.array_equal(surface.knots_v, base.knots_v)):
        raise ValueError("base: expected the knots of the surface, got others; make both from one ridge")
    size = np.ptp(base.poles, axis=(0, 1)).max()
    gap = max(np.abs(surface.poles[:, k] - base.poles[:, k]).max() for k in (0, -1))
    if gap > 1e-9 * size:
        raise ValueError(
            f"base: expected the borders of the surface, they are {gap:.3g} apart; make both from one ridge"
        )


def _check_loops(loops: list[_Loop]) -> None:
    """Raise ValueError where the border crosses itself."""
    lines = [_pieces_of(loop.polyline[:: 1 + len(loop.polyline) // 200]) for loop in loops]
    for k, line in enumerate(lines):
        i = np.arange(len(line))
        apart = np.abs(i[:, None] - i)
        meet = meetings(line, line) & (apart > 1) & (apart < len(line) - 1)
        if meet.any() or any(cross(line, other) for other in lines[:k]):
            raise ValueError("surface: expected a border that does not cross itself, it does; move the path")


def _pieces_of(line: Floats) -> Floats:
    return np.stack([line, np.roll(line, -1, axis=0)], axis=1)


def _build(host: TopoDS_Shape, face: TopoDS_Face, surface: Surface, base: Surface, expected: float) -> Change:
    maker = _Maker(surface, base, surface_on(face), face)
    loops = maker.ring() if surface.closed[0] else [maker.open_border()]
    pairs = [maker.hole(loop) for loop in loops]
    _check_loops(pairs)
    new = [maker.ridge_face(loops), *maker.caps(loops), *_split_face(face, maker.own, pairs)]
    solid = _replaced(host, face, new)
    return Change((face,), solid, tuple(new), base, expected)


@dataclass(frozen=True)
class _Loop:
    """A closed border on the host: its wire as the ridge's neighbour goes round it, and a polyline."""

    wire: TopoDS_Wire
    polyline: Floats


class _Maker:
    """Edges and faces of one inset; they share vertices and edges."""

    def __init__(self, surface: Surface, base: Surface, host: HostSurface, face: TopoDS_Face) -> None:
        self.surface, self.base, self.host, self.face = surface, base, host, face
        self.own = [(wire, segments_of(wire, face)) for wire in wires_of(face)]
        self.build = BRep_Builder()
        self.geometry = to_occt(surface)
        self.low_geometry = to_occt(base)
        self.size = float(np.ptp(base.poles, axis=(0, 1)).max())
        self.breadth = float(np.linalg.norm(base.poles[:, 0] - base.poles[:, -1], axis=1).max())

    def vertex(self, point: Floats, tolerance: float = DEGENERATE) -> TopoDS_Vertex:
        v = TopoDS_Vertex()
        self.build.MakeVertex(v, gp_Pnt(*point.tolist()), tolerance)
        return v

    def edge(
        self, curve: Geom_Curve, span: tuple[float, float], ends: tuple[TopoDS_Vertex, TopoDS_Vertex]
    ) -> TopoDS_Edge:
        e = TopoDS_Edge()
        self.build.MakeEdge(e, curve, DEGENERATE)
        self.build.Add(e, ends[0].Oriented(TopAbs_FORWARD))
        self.build.Add(e, ends[1].Oriented(TopAbs_REVERSED))
        self.build.Range(e, *span)
        return e

    def widen(self, edge: TopoDS_Edge, tolerance: float) -> None:
        """Raise the tolerance of an edge and its vertices to at least this."""
        self.build.UpdateEdge(edge, tolerance)
        for v in subshapes(edge, TopAbs_VERTEX):
            self.build.UpdateVertex(TopoDS.Vertex_s(v), 1.01 * tolerance)

    def side(self, k: int, ends: tuple[TopoDS_Vertex, TopoDS_Vertex]) -> _Piece:
        """The border along u, at the lowest (k = 0) or highest (k = -1) v."""
        s = self.surface
        u, v = s.domain
        curve = Curve(s.poles[:, k], s.knots_u, s.degree_u)
        edge = self.edge(self.geometry.VIso(v[k]), u, ends)
        line = Geom2d_Line(gp_Pnt2d(0.0, v[k]), gp_Dir2d(1, 0))
        return _Piece(edge, line, curve, u, k == 0)

    def row(self, k: int, ends: tuple[TopoDS_Vertex, TopoDS_Vertex]) -> list[_Piece]:
        """The border across, at the first (k = 0) or last (k = -1) u, in the order round the surface."""
        s, b = self.surface, self.base
        u, (v0, v1) = s.domain
        row, low = Curve(s.poles[k], s.knots_v, s.degree_v), Curve(b.poles[k], s.knots_v, s.degree_v)
        off = on_host(self.host, low, (v0, v1), None).distance
        self.check_distance(off)
        # Edges closer than their tolerances would count as crossing: a cap ends where it is that thin.
        found = lifts(row, low, max(LIFT * self.breadth, 4 * off))
        breaks = [v0, *(x for lift in found for x in lift.span), v1]
        middle = [
            self.vertex(0.5 * (row(x) + low(x)), float(np.linalg.norm(row(x) - low(x))) + DEGENERATE)
            for x in breaks[1:-1]
        ]
        vertices = [ends[0], *middle, ends[1]]
        line = Geom2d_Line(gp_Pnt2d(u[k], 0.0), gp_Dir2d(0, 1))
        pieces = []
        for i, span in enumerate(pairwise(breaks)):
            pair = vertices[i], vertices[i + 1]
            edge = self.edge(self.geometry.UIso(u[k]), span, pair)
            piece = _Piece(edge, line, row, span, k != 0)
            if i % 2:
                foot = self.edge(self.low_geometry.UIso(u[k]), span, pair)
                piece = replace(piece, curve=low, lift=found[i // 2], foot=foot)
            pieces.append(piece)
        return pieces if k else pieces[::-1]

    def open_border(self) -> list[_Piece]:
        """The border of a surface that is open along u, in the order round it."""
        p = self.surface.poles
        a, b, c, d = (self.vertex(x) for x in (p[0, 0], p[-1, 0], p[-1, -1], p[0, -1]))
        return [self.side(0, (a, b)), *self.row(-1, (b, c)), self.side(-1, (d, c)), *self.row(0, (a, d))]

    def ring(self) -> list[list[_Piece]]:
        """Both borders of a surface that is closed along u."""
        p = self.surface.poles
        a, d = self.vertex(p[0, 0]), self.vertex(p[0, -1])
        return [[self.side(0, (a, a))], [self.side(-1, (d, d))]]

    def ridge_face(self, loops: list[list[_Piece]]) -> TopoDS_Face:
        f = TopoDS_Face()
        self.build.MakeFace(f, self.geometry, DEGENERATE)
        pieces = [piece for loop in loops for piece in loop]
        for piece in pieces:
            self.build.UpdateEdge(piece.edge, piece.pcurve, f, DEGENERATE)
        edges = [_oriented(p.edge, p.forward) for p in pieces]
        if len(loops) == 2:
            seam = self.seam(loops, f)
            edges = [edges[0], _oriented(seam, True), edges[1], _oriented(seam, False)]
        self.build.Add(f, self.wire(edges))
        return f

    def seam(self, loops: list[list[_Piece]], face: TopoDS_Face) -> TopoDS_Edge:
        u, v = self.surface.domain
        ends = tuple(TopoDS.Vertex_s(subshapes(loop[0].edge, TopAbs_VERTEX)[0]) for loop in loops)
        edge = self.edge(self.geometry.UIso(u[0]), v, (ends[0], ends[1]))
        lines = [Geom2d_Line(gp_Pnt2d(x, 0.0), gp_Dir2d(0, 1)) for x in (u[1], u[0])]
        self.build.UpdateEdge(edge, lines[0], lines[1], face, DEGENERATE)
        return edge

    def wire(self, edges: list[TopoDS_Edge]) -> TopoDS_Wire:
        w = TopoDS_Wire()
        self.build.MakeWire(w)
        for e in edges:
            self.build.Add(w, e)
        w.Closed(True)
        return w

    def hole(self, pieces: list[_Piece]) -> _Loop:
        """The wire on the host's face that the pieces make; each edge gets its parameter curve there."""
        found = self.on_host(pieces)
        line = np.concatenate([f.polyline[:-1] for f in found])
        shift = self.shift(line)
        where = TopLoc_Location()
        raw = BRep_Tool.Surface_s(self.face, where)
        for piece, f in zip(pieces, found, strict=True):
            flat = curve2d(replace(f.flat, poles=f.flat.poles + shift))
            self.build.UpdateEdge(piece.on_host, flat, raw, where, DEGENERATE)
            self.widen(piece.on_host, 1.1 * f.distance + DEGENERATE)
        flip = self.face.Orientation() == TopAbs_REVERSED
        edges = [_oriented(p.on_host, p.forward == flip) for p in pieces]
        line = line + shift
        return _Loop(self.wire(edges if flip else edges[::-1]), line if flip else line[::-1])

    def on_host(self, pieces: list[_Piece]) -> list[OnHost]:
        """The pieces in the host's parameters, each going on where the one before it ends."""
        found: list[OnHost] = []
        for piece in pieces:
            at = found[-1].polyline[-1] if found else None
            found.append(on_host(self.host, piece.curve, piece.span, at, piece.forward))
            self.check_distance(found[-1].distance)
        gap = np.abs(found[-1].polyline[-1] - found[0].polyline[0])
        if any(p and g > 0.5 * p for p, g in zip(self.host.periods, gap, strict=True)):
            raise SeamError("surface: expected a border that closes on the face, it winds round it")
        return found

    def shift(self, line: Floats) -> Floats:
        """Whole periods by which a loop is moved to lie among the face's own parameters."""
        if not any(self.host.periods):
            return np.zeros(2)
        own = np.concatenate([segments for _, segments in self.own])
        middle = 0.5 * (own.min(axis=(0, 1)) + own.max(axis=(0, 1)))
        centre = 0.5 * (line.min(axis=0) + line.max(axis=0))
        period = np.array(self.host.periods)
        return period * np.round((middle - centre) / np.where(period > 0, period, np.inf))

    def check_distance(self, distance: float) -> None:
        if not distance <= ON_HOST * self.breadth:
            raise ValueError(
                f"surface: expected a border on the face to {ON_HOST * self.breadth:.3g}, it is "
                f"{distance:.3g} off; make the surface on this face"
            )

    def caps(self, loops: list[list[_Piece]]) -> list[TopoDS_Face]:
        return [self.cap(p, p.lift, p.foot) for loop in loops for p in loop if p.lift and p.foot]

    def cap(self, piece: _Piece, lift: Lift, foot: TopoDS_Edge) -> TopoDS_Face:
        """The face between a row's stretch and its foot line."""
        f = TopoDS_Face()
        self.build.MakeFace(f, to_occt(lift.surface), DEGENERATE)
        t = np.linspace(*lift.span, 201)
        rise = lift.rise(t)[:, 0]
        top = np.column_stack([greville(lift.rise.knots, 3), lift.rise.poles[:, 0]])
        self.build.UpdateEdge(piece.edge, curve2d(Curve(top, lift.rise.knots, 3)), f, DEGENERATE)
        self.build.UpdateEdge(foot, Geom2d_Line(gp_Pnt2d(0, 0), gp_Dir2d(1, 0)), f, DEGENERATE)
        for e in (piece.edge, foot):
            self.widen(e, 1.1 * lift.distance + DEGENERATE)
        # The foot line goes with the surface's border, the row against it: counter-clockwise if it rises.
        straight = bool(rise[len(rise) // 2] > 0) == piece.forward
        edges = [_oriented(foot, piece.forward == straight), _oriented(piece.edge, piece.forward != straight)]
        self.build.Add(f, self.wire(edges))
        return f if straight else TopoDS.Face_s(f.Reversed())


class SeamError(ValueError):
    """The footprint runs over a seam of the face."""


def _oriented(edge: TopoDS_Edge, forward: bool) -> TopoDS_Edge:
    return TopoDS.Edge_s(edge.Oriented(TopAbs_FORWARD if forward else TopAbs_REVERSED))


def _split_face(
    face: TopoDS_Face, own: list[tuple[TopoDS_Wire, Floats]], loops: list[_Loop]
) -> list[TopoDS_Face]:
    """The face with the outer loop as a hole; with two loops also the island within the inner one."""
    areas = [signed_area(loop.polyline) for loop in loops]
    outer = int(np.argmax(np.abs(areas)))
    if areas[outer] > 0:
        raise ValueError(
            "surface: expected du x dv away from the host's material, "
            "it points inwards; turn the surface round"
        )
    everything = np.concatenate([segments for _, segments in own])
    seams = seams_of(face)
    if len(seams) and any(cross(_pieces_of(loop.polyline), seams) for loop in loops):
        raise SeamError("surface: expected a border clear of the face's seam, it runs over it")
    lines = [
        np.stack([line, np.roll(line, -1, axis=0)], axis=1) for line in (loop.polyline for loop in loops)
    ]
    around = np.concatenate(lines)
    island = []
    for k, (wire, segments) in enumerate(own):
        if cross(around, segments):
            raise ValueError(
                "surface: expected a border within the face, it leaves the face's outline; move the path"
                if k == 0
                else "surface: expected a border clear of holes and earlier ridges, "
                "it overlaps one; move the path"
            )
        if k and inside(segments[:1, 0], lines[outer])[0]:
            if len(loops) == 1 or inside(segments[:1, 0], around)[0]:
                raise ValueError(
                    "surface: expected a footprint clear of holes and earlier ridges, it covers one; "
                    "move the path"
                )
            island.append(wire)
    if not inside(loops[outer].polyline[:1], everything)[0]:
        raise ValueError("surface: expected a border within the face, it lies outside; move the path")
    kept = [wire for wire, _ in own if not any(wire.IsSame(other) for other in island)]
    faces = [_face_like(face, [*kept, loops[outer].wire])]
    if len(loops) == 2:
        faces.append(_face_like(face, [loops[1 - outer].wire, *island]))
    return faces


def _face_like(face: TopoDS_Face, wires: list[TopoDS_Wire]) -> TopoDS_Face:
    """A new face on the same surface with these wires, oriented as the old one."""
    build, where, f = BRep_Builder(), TopLoc_Location(), TopoDS_Face()
    geometry: Geom_Surface = BRep_Tool.Surface_s(face, where)
    build.MakeFace(f, geometry, where, BRep_Tool.Tolerance_s(face))
    for wire in wires:
        build.Add(f, wire)
    return TopoDS.Face_s(f.Oriented(face.Orientation()))


def _replaced(host: TopoDS_Shape, face: TopoDS_Face, new: list[TopoDS_Face]) -> TopoDS_Solid:
    """The host's solid with new faces in place of one; all other faces are the host's own."""
    build, solid = BRep_Builder(), TopoDS_Solid()
    build.MakeSolid(solid)
    for shell in subshapes(host, TopAbs_SHELL):
        faces = subshapes(shell, TopAbs_FACE)
        kept = [f for f in faces if not f.IsSame(face)]
        if len(kept) == len(faces):
            build.Add(solid, shell)
            continue
        made = TopoDS_Shell()
        build.MakeShell(made)
        for f in [*kept, *new]:
            build.Add(made, f)
        made.Closed(BRep_Tool.IsClosed_s(made))
        build.Add(solid, made)
    return solid
