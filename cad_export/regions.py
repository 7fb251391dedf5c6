"""Faces from what is left of a face's border, new borders within it, and seams cut by them. OCP only.

In the parameter plane of a face each edge is a half-edge with the face on its left; half-edges that go on
from one another make loops. A counter-clockwise loop bounds a face, a clockwise one is a hole in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve2d
from OCP.GeomAbs import GeomAbs_BSplineCurve, GeomAbs_Line
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FORWARD, TopAbs_REVERSED
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Vertex, TopoDS_Wire

from cad_export.check import subshapes
from cad_export.polylines import inside, signed_area

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HalfEdge:
    """An edge as a face goes along it, the face on its left: line (n, 2) is its way in the parameters."""

    edge: TopoDS_Edge
    line: Floats
    is_new: bool = False

    @property
    def ends(self) -> tuple[TopoDS_Vertex, TopoDS_Vertex]:
        """Its first and last vertex, as it goes."""
        return TopExp.FirstVertex_s(self.edge, True), TopExp.LastVertex_s(self.edge, True)

    @property
    def segments(self) -> Floats:
        """(n, 2, 2) its straight pieces in the parameters."""
        return np.stack([self.line[:-1], self.line[1:]], axis=1)


def half_edges(wire: TopoDS_Wire, face: TopoDS_Face) -> list[HalfEdge]:
    """The edges of a wire, as the face holds it when it is not turned against its surface."""
    return [half_edge(TopoDS.Edge_s(edge), face) for edge in subshapes(wire, TopAbs_EDGE)]


def half_edge(edge: TopoDS_Edge, face: TopoDS_Face, span: tuple[float, float] | None = None) -> HalfEdge:
    """An oriented edge of a face, or the stretch `span` of it; of a seam the side that it is oriented to."""
    # a face turned against its surface would give a seam's other side
    curve = BRepAdaptor_Curve2d(edge, TopoDS.Face_s(face.Oriented(TopAbs_FORWARD)))
    kind = curve.GetType()
    straight = kind == GeomAbs_Line
    count = 1 if straight else 8 + 4 * curve.NbKnots() if kind == GeomAbs_BSplineCurve else 64
    t0, t1 = span or (curve.FirstParameter(), curve.LastParameter())
    line = np.array([(p.X(), p.Y()) for p in map(curve.Value, np.linspace(t0, t1, count + 1).tolist())])
    return HalfEdge(edge, line[::-1] if edge.Orientation() == TopAbs_REVERSED else line)


def regions(face: TopoDS_Face, halves: list[HalfEdge]) -> list[TopoDS_Face]:
    """The faces that half-edges bound on the surface of `face`, oriented as it is.

    Raises ValueError where they do not close to loops, or a hole lies in no face: where what is cut out of
    the face covers a hole in it.
    """
    loops = _loops(halves)
    lines = [np.concatenate([half.line[:-1] for half in loop]) for loop in loops]
    areas = np.array([signed_area(line) for line in lines])
    owner = _owners(loops, lines, areas)
    made = []
    for k in np.flatnonzero(areas > 0):
        holes = [loop for loop, of in zip(loops, owner, strict=True) if of == k]
        made.append(face_like(face, [_wire(loop) for loop in (loops[k], *holes)]))
    return made


def _owners(loops: list[list[HalfEdge]], lines: list[Floats], areas: Floats) -> list[int]:
    """For each loop the one around it, -1 for the outer border of a face."""
    pieces = [np.stack([line, np.roll(line, -1, axis=0)], axis=1) for line in lines]
    owner = []
    for k, line in enumerate(lines):
        middle = line[:1] if len(line) > 1 else line
        around = [
            j
            for j in range(len(lines))
            if j != k and abs(areas[j]) > abs(areas[k]) and inside(middle, pieces[j])[0]
        ]
        nearest = min(around, key=lambda j: abs(areas[j]), default=-1)
        is_hole, in_face = areas[k] < 0, nearest >= 0 and areas[nearest] > 0
        if is_hole != in_face:
            raise ValueError(
                "surface: expected a border within the face, it lies outside; move the path"
                if nearest < 0 and loops[k][0].is_new
                else "surface: expected a footprint clear of holes and earlier ridges, it covers one; "
                "move the path"
            )
        owner.append(nearest if is_hole else -1)
    return owner


def _loops(halves: list[HalfEdge]) -> list[list[HalfEdge]]:
    """Half-edges in order: each goes on where, and at the vertex at which, the one before it ends."""
    left = list(halves)
    loops = []
    while left:
        loop = [left.pop()]
        first = loop[0].ends[0]
        while True:
            vertex, place = loop[-1].ends[1], loop[-1].line[-1]
            nexts = [half for half in left if half.ends[0].IsSame(vertex)]
            gaps = [float(np.abs(half.line[0] - place).max()) for half in nexts]
            home = float(np.abs(loop[0].line[0] - place).max()) if vertex.IsSame(first) else np.inf
            if not gaps or home <= min(gaps):
                break
            best = nexts[int(np.argmin(gaps))]
            loop.append(best)
            left = [half for half in left if half is not best]
        if not np.isfinite(home):
            raise ValueError(
                "surface: expected a footprint clear of the face's outline, holes and poles, it covers a "
                "part of one; move the path"
            )
        loops.append(loop)
    return loops


def _wire(loop: list[HalfEdge]) -> TopoDS_Wire:
    build, wire = BRep_Builder(), TopoDS_Wire()
    build.MakeWire(wire)
    for half in loop:
        build.Add(wire, half.edge)
    wire.Closed(True)
    return wire


def face_like(face: TopoDS_Face, wires: list[TopoDS_Wire]) -> TopoDS_Face:
    """A new face on the same surface with these wires, oriented as the old one."""
    build, where, made = BRep_Builder(), TopLoc_Location(), TopoDS_Face()
    build.MakeFace(made, BRep_Tool.Surface_s(face, where), where, BRep_Tool.Tolerance_s(face))
    for wire in wires:
        build.Add(made, wire)
    return TopoDS.Face_s(made.Oriented(face.Orientation()))
