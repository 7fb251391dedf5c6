"""Edges and faces of a ridge that is set into a face of a host. OCP only, no cadquery."""

from __future__ import annotations

from dataclasses import dataclass
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
from cad_export.end_caps import Lift
from cad_export.footprint import occt_curve
from cad_export.geometry import DEGENERATE
from cad_export.site import Line, Site
from cad_export.surface_form import to_occt
from ridgefeature.basis import Places
from ridgefeature.bspline import Curve, greville

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Piece:
    """A piece of the surface's border: its edge, and the one on the host (the same, or under a cap).

    line: that of the footprint on which it lies, or over which. off: how far it is off the host.
    """

    edge: TopoDS_Edge
    pcurve: Geom2d_Curve
    line: Line
    off: float
    lift: Lift | None = None
    foot: TopoDS_Edge | None = None

    @property
    def on_host(self) -> TopoDS_Edge:
        return self.edge if self.foot is None else self.foot


class Maker:
    """Edges and faces of one inset, the site's surface at one height; they share vertices and edges."""

    def __init__(self, site: Site, h: float) -> None:
        self.site, self.h, self.surface = site, h, site.at(h)
        self.build = BRep_Builder()
        self.geometry = to_occt(self.surface)

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

    def side(self, k: int, line: Line, ends: tuple[TopoDS_Vertex, TopoDS_Vertex]) -> Piece:
        """The border along u, at the lowest (k = 0) or highest (k = -1) v: the same for all heights."""
        u, v = self.surface.domain
        pcurve = Geom2d_Line(gp_Pnt2d(0.0, v[k]), gp_Dir2d(1, 0))
        return Piece(self.edge(line.space, u, ends), pcurve, line, line.off)

    def row(self, k: int, line: Line, ends: tuple[TopoDS_Vertex, TopoDS_Vertex]) -> list[Piece]:
        """The border across, at the first (k = 0) or last (k = -1) u, in the order round the surface."""
        s, low = self.surface, line.curve
        u, (v0, v1) = s.domain
        found = self.site.lifts(k, self.h)
        breaks = [v0, *(x for lift in found for x in lift.span), v1]
        between = Places.at(s.knots_v, s.degree_v, np.array(breaks[1:-1]))
        pairs = zip(between(s.poles[k]), between(low.poles), strict=True)
        middle = [self.vertex(0.5 * (a + b), float(np.linalg.norm(a - b)) + DEGENERATE) for a, b in pairs]
        vertices = [ends[0], *middle, ends[1]]
        pcurve, space = Geom2d_Line(gp_Pnt2d(u[k], 0.0), gp_Dir2d(0, 1)), self.geometry.UIso(u[k])
        off = line.off + self.site.gap(k, self.h)
        pieces = []
        for i, span in enumerate(pairwise(breaks)):
            pair = vertices[i], vertices[i + 1]
            edge = self.edge(space, span, pair)
            if i % 2:
                foot = self.edge(line.space, span, pair)
                pieces.append(Piece(edge, pcurve, line, line.off, found[i // 2], foot))
            else:
                pieces.append(Piece(edge, pcurve, line, off))
        return pieces if k else pieces[::-1]

    def border(self) -> list[list[Piece]]:
        """The border in the order round the surface; of one that is closed along u both borders."""
        p, loops = self.surface.poles, self.site.loops
        if self.surface.closed[0]:
            a, d = self.vertex(p[0, 0]), self.vertex(p[0, -1])
            return [[self.side(0, loops[0].lines[0], (a, a))], [self.side(-1, loops[1].lines[0], (d, d))]]
        a, b, c, d = (self.vertex(x) for x in (p[0, 0], p[-1, 0], p[-1, -1], p[0, -1]))
        right, end, left, start = loops[0].lines
        rows = self.row(-1, end, (b, c)), self.row(0, start, (a, d))
        return [[self.side(0, right, (a, b)), *rows[0], self.side(-1, left, (d, c)), *rows[1]]]

    def ridge_face(self, loops: list[list[Piece]]) -> TopoDS_Face:
        f = TopoDS_Face()
        self.build.MakeFace(f, self.geometry, DEGENERATE)
        pieces = [piece for loop in loops for piece in loop]
        for piece in pieces:
            self.build.UpdateEdge(piece.edge, piece.pcurve, f, DEGENERATE)
        edges = [_oriented(p.edge, p.line.forward) for p in pieces]
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

    def ground(self, loops: list[list[Piece]]) -> list[TopoDS_Face]:
        """The host's face with the outer loop as a hole; of a ring also the island within the inner one."""
        division = self.site.division
        wires = [self.hole(pieces) for pieces in loops]
        faces = [self.like_host([*division.kept, wires[division.outer]])]
        if len(wires) == 2:
            faces.append(self.like_host([wires[1 - division.outer], *division.island]))
        return faces

    def hole(self, pieces: list[Piece]) -> TopoDS_Wire:
        """The wire on the host's face that the pieces make; each edge gets its parameter curve there."""
        where = TopLoc_Location()
        raw = BRep_Tool.Surface_s(self.site.face, where)
        for piece in pieces:
            self.build.UpdateEdge(piece.on_host, piece.line.flat, raw, where, DEGENERATE)
            self.widen(piece.on_host, 1.1 * piece.off + DEGENERATE)
        flip = self.site.flipped
        edges = [_oriented(p.on_host, p.line.forward == flip) for p in pieces]
        return self.wire(edges if flip else edges[::-1])

    def like_host(self, wires: list[TopoDS_Wire]) -> TopoDS_Face:
        """A new face on the host face's surface with these wires, oriented as that."""
        face, where, f = self.site.face, TopLoc_Location(), TopoDS_Face()
        self.build.MakeFace(f, BRep_Tool.Surface_s(face, where), where, BRep_Tool.Tolerance_s(face))
        for wire in wires:
            self.build.Add(f, wire)
        return TopoDS.Face_s(f.Oriented(face.Orientation()))

    def caps(self, loops: list[list[Piece]]) -> list[TopoDS_Face]:
        return [self.cap(p, p.lift, p.foot) for loop in loops for p in loop if p.lift and p.foot]

    def cap(self, piece: Piece, lift: Lift, foot: TopoDS_Edge) -> TopoDS_Face:
        """The face between a row's stretch and its foot line."""
        f = TopoDS_Face()
        self.build.MakeFace(f, to_occt(lift.surface), DEGENERATE)
        rises = lift.rise.poles.sum() > 0
        top = np.column_stack([greville(lift.rise.knots, 3), lift.rise.poles[:, 0]])
        self.build.UpdateEdge(piece.edge, occt_curve(Curve(top, lift.rise.knots, 3)), f, DEGENERATE)
        self.build.UpdateEdge(foot, Geom2d_Line(gp_Pnt2d(0, 0), gp_Dir2d(1, 0)), f, DEGENERATE)
        for e in (piece.edge, foot):
            self.widen(e, 1.1 * lift.distance + DEGENERATE)
        # The foot line goes with the surface's border, the row against it: counter-clockwise if it rises.
        forward = piece.line.forward
        straight = bool(rises) == forward
        edges = [_oriented(foot, forward == straight), _oriented(piece.edge, forward != straight)]
        self.build.Add(f, self.wire(edges))
        return f if straight else TopoDS.Face_s(f.Reversed())


def _oriented(edge: TopoDS_Edge, forward: bool) -> TopoDS_Edge:
    return TopoDS.Edge_s(edge.Oriented(TopAbs_FORWARD if forward else TopAbs_REVERSED))
