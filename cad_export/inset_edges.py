"""Edges and faces of a ridge that is set into a face of a host. OCP only, no cadquery."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.Geom import Geom_Curve
from OCP.Geom2d import Geom2d_Curve, Geom2d_Line
from OCP.gp import gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED, TopAbs_VERTEX
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import (
    TopoDS,
    TopoDS_Edge,
    TopoDS_Face,
    TopoDS_Vertex,
    TopoDS_Wire,
)

from cad_export.check import subshapes
from cad_export.end_caps import Lift, lifts
from cad_export.footprint import (
    HostSurface,
    OnHost,
    curve2d,
    on_host,
    segments_of,
    wires_of,
)
from cad_export.geometry import DEGENERATE, to_occt
from ridgefeature.bspline import Curve, Surface, greville

Floats = NDArray[np.float64]

ON_HOST = 1e-4
"""The border may lie off the host's face by this part of its own breadth."""
LIFT = 3e-7
"""A row less than this part of its breadth off the base counts as on it: there edges are shared."""


class SeamError(ValueError):
    """The footprint runs over a seam of the face."""


@dataclass(frozen=True)
class Piece:
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


@dataclass(frozen=True)
class Loop:
    """A closed border on the host: its wire as the ridge's neighbour goes round it, and a polyline."""

    wire: TopoDS_Wire
    polyline: Floats


class Maker:
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

    def side(self, k: int, ends: tuple[TopoDS_Vertex, TopoDS_Vertex]) -> Piece:
        """The border along u, at the lowest (k = 0) or highest (k = -1) v."""
        s = self.surface
        u, v = s.domain
        curve = Curve(s.poles[:, k], s.knots_u, s.degree_u)
        edge = self.edge(self.geometry.VIso(v[k]), u, ends)
        line = Geom2d_Line(gp_Pnt2d(0.0, v[k]), gp_Dir2d(1, 0))
        return Piece(edge, line, curve, u, k == 0)

    def row(self, k: int, ends: tuple[TopoDS_Vertex, TopoDS_Vertex]) -> list[Piece]:
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
            piece = Piece(edge, line, row, span, k != 0)
            if i % 2:
                foot = self.edge(self.low_geometry.UIso(u[k]), span, pair)
                piece = replace(piece, curve=low, lift=found[i // 2], foot=foot)
            pieces.append(piece)
        return pieces if k else pieces[::-1]

    def open_border(self) -> list[Piece]:
        """The border of a surface that is open along u, in the order round it."""
        p = self.surface.poles
        a, b, c, d = (self.vertex(x) for x in (p[0, 0], p[-1, 0], p[-1, -1], p[0, -1]))
        return [self.side(0, (a, b)), *self.row(-1, (b, c)), self.side(-1, (d, c)), *self.row(0, (a, d))]

    def ring(self) -> list[list[Piece]]:
        """Both borders of a surface that is closed along u."""
        p = self.surface.poles
        a, d = self.vertex(p[0, 0]), self.vertex(p[0, -1])
        return [[self.side(0, (a, a))], [self.side(-1, (d, d))]]

    def ridge_face(self, loops: list[list[Piece]]) -> TopoDS_Face:
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

    def seam(self, loops: list[list[Piece]], face: TopoDS_Face) -> TopoDS_Edge:
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

    def hole(self, pieces: list[Piece]) -> Loop:
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
        return Loop(self.wire(edges if flip else edges[::-1]), line if flip else line[::-1])

    def on_host(self, pieces: list[Piece]) -> list[OnHost]:
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

    def caps(self, loops: list[list[Piece]]) -> list[TopoDS_Face]:
        return [self.cap(p, p.lift, p.foot) for loop in loops for p in loop if p.lift and p.foot]

    def cap(self, piece: Piece, lift: Lift, foot: TopoDS_Edge) -> TopoDS_Face:
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


def _oriented(edge: TopoDS_Edge, forward: bool) -> TopoDS_Edge:
    return TopoDS.Edge_s(edge.Oriented(TopAbs_FORWARD if forward else TopAbs_REVERSED))
