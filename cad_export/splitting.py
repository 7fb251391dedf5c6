"""Edges split at vertices, and faces and solids with the parts in the place of the whole. OCP only."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.TopAbs import (
    TopAbs_EDGE,
    TopAbs_FACE,
    TopAbs_FORWARD,
    TopAbs_REVERSED,
    TopAbs_SHELL,
    TopAbs_WIRE,
)
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

from cad_export import occt_arrays
from cad_export.check import subshapes
from cad_export.crossings import Crossing, CutEdge
from cad_export.regions import HalfEdge, half_edge

Span = tuple[float, float]


def split_edge(edge: TopoDS_Edge, at: list[tuple[float, TopoDS_Vertex]]) -> list[tuple[TopoDS_Edge, Span]]:
    """The parts of an edge from place to place, forward, and their parameters; itself where there are two.

    at: parameters, ascending, and vertices. The parts have the edge's curves, in space and on faces.
    """
    if len(at) == 2:
        return [(TopoDS.Edge_s(edge.Oriented(TopAbs_FORWARD)), (at[0][0], at[1][0]))]
    build, made = BRep_Builder(), []
    for (a, first), (b, last) in pairwise(at):
        part = TopoDS.Edge_s(edge.EmptyCopied().Oriented(TopAbs_FORWARD))
        build.Add(part, first.Oriented(TopAbs_FORWARD))
        build.Add(part, last.Oriented(TopAbs_REVERSED))
        build.Range(part, a, b)
        made.append((part, (a, b)))
    return made


@dataclass(frozen=True, eq=False)
class EdgeParts:
    """Edges, and the parts, forward and in order, that take the place of each."""

    whole: list[TopoDS_Edge]
    parts: list[list[TopoDS_Edge]]

    @cached_property
    def _names(self) -> Any:
        names = occt_arrays.shape_map()
        for edge in self.whole:
            names.Add(edge)
        return names

    def index(self, edge: TopoDS_Shape) -> int:
        """Which of the edges it is, -1 if none."""
        return int(self._names.FindIndex(edge)) - 1

    def of(self, edge: TopoDS_Edge) -> list[TopoDS_Edge]:
        """The parts of an oriented edge in its place, as it goes; itself if it is none of the edges."""
        k = self.index(edge)
        if k < 0 or len(self.parts[k]) == 1:
            return [edge]
        turned = [TopoDS.Edge_s(part.Oriented(edge.Orientation())) for part in self.parts[k]]
        return turned if edge.Orientation() == TopAbs_FORWARD else turned[::-1]


@dataclass(frozen=True, eq=False)
class KeptParts:
    """Cut edges: their parts, forward and in order, the parameters of these, and which of them remain."""

    edges: EdgeParts
    spans: list[list[Span]]
    kept: list[list[bool]]

    def is_cut(self, edge: TopoDS_Edge) -> bool:
        """Whether it is one of the cut edges."""
        return self.edges.index(edge) >= 0

    def is_changed(self, edge: TopoDS_Edge) -> bool:
        """Whether it is split or gone."""
        k = self.edges.index(edge)
        return k >= 0 and self.kept[k] != [True]

    def of(self, half: HalfEdge, face: TopoDS_Face) -> list[HalfEdge]:
        """What remains of a half-edge of the face."""
        k = self.edges.index(half.edge)
        if k < 0 or self.kept[k] == [True]:
            return [half]
        made = []
        for part, span, kept in zip(self.edges.parts[k], self.spans[k], self.kept[k], strict=True):
            if kept:
                line = half_edge(half.edge, face, span).line
                made.append(HalfEdge(TopoDS.Edge_s(part.Oriented(half.edge.Orientation())), line))
        return made


def kept_parts(cuts: list[CutEdge], met: list[Crossing], faces: list[TopoDS_Face]) -> KeptParts:
    """The cut edges split at the crossings, and which parts are the host's: the others are under the ridge.

    An edge without a crossing is what the others at its end are, where only cut edges end there. Raises
    ValueError where a crossing says otherwise than the next, or the end of a border edge is under the ridge.
    """
    parts, spans, states = [], [], []
    for c, cut in enumerate(cuts):
        on = sorted((x for x in met if x.cut == c), key=lambda x: x.s)
        places = [(cut.span[0], cut.ends[0]), *((x.s, x.vertex) for x in on), (cut.span[1], cut.ends[1])]
        split = split_edge(cut.edge, places)
        parts.append([edge for edge, _ in split])
        spans.append([span for _, span in split])
        states.append(_states(on))
    _spread(cuts, states, faces)
    kept = [[state is not False for state in some] for some in states]
    return KeptParts(EdgeParts([cut.edge for cut in cuts], parts), spans, kept)


_COVERED = (
    "surface: expected a footprint clear of the face's outline, holes and earlier ridges, it covers a part "
    "of one; move the path"
)


def _states(on: list[Crossing]) -> list[bool | None]:
    """Of each part between crossings whether the host keeps it; None without a crossing."""
    if not on:
        return [None]
    before, after = [not x.ahead for x in on], [x.ahead for x in on]
    if before[1:] != after[:-1]:
        raise ValueError(_COVERED)
    return [before[0], *after]


def _spread(cuts: list[CutEdge], states: list[list[bool | None]], faces: list[TopoDS_Face]) -> None:
    """Let what is known of the parts at a vertex hold for all that end there."""
    inner, vertices = _inner_vertices(cuts, faces)
    ends: list[tuple[int, int, int]] = []
    for c, cut in enumerate(cuts):
        ends += [(vertices.FindIndex(cut.ends[0]), c, 0), (vertices.FindIndex(cut.ends[1]), c, -1)]
    for _ in range(len(cuts) + 1):
        known = {v: states[c][k] for v, c, k in ends if states[c][k] is not None}
        for v, c, k in ends:
            state = known.get(v)
            if state is None or states[c][k] == state:
                continue
            if states[c][k] is not None and v in inner:
                raise ValueError(_COVERED)
            if v in inner:
                states[c][k] = state
    if any(states[c][k] is False and v not in inner for v, c, k in ends):
        raise ValueError(_COVERED)


def _inner_vertices(cuts: list[CutEdge], faces: list[TopoDS_Face]) -> tuple[set[int], Any]:
    """The vertices at which only cut edges end, as numbers in a map of vertices."""
    vertices, cut = occt_arrays.shape_map(), EdgeParts([c.edge for c in cuts], [])
    inner = {vertices.Add(v) for c in cuts for v in c.ends}
    for face in faces:
        for edge in subshapes(face, TopAbs_EDGE):
            if cut.index(edge) < 0:
                inner -= {vertices.FindIndex(v) for v in CutEdge(TopoDS.Edge_s(edge)).ends}
    return inner, vertices


def with_edges(face: TopoDS_Face, parts: EdgeParts) -> TopoDS_Face:
    """The face with parts in the place of edges."""
    forward = TopoDS.Face_s(face.Oriented(TopAbs_FORWARD))
    if all(len(parts.of(TopoDS.Edge_s(edge))) == 1 for edge in subshapes(forward, TopAbs_EDGE)):
        return face
    build, made = BRep_Builder(), forward.EmptyCopied()
    for old in subshapes(forward, TopAbs_WIRE):
        wire = TopoDS_Wire()
        build.MakeWire(wire)
        for edge in subshapes(old, TopAbs_EDGE):
            for part in parts.of(TopoDS.Edge_s(edge)):
                build.Add(wire, part)
        wire.Closed(True)
        build.Add(made, wire)
    return TopoDS.Face_s(made.Oriented(face.Orientation()))


def with_faces(host: TopoDS_Shape, old: list[TopoDS_Face], new: list[TopoDS_Face]) -> TopoDS_Solid:
    """The host's solid with new faces in place of old ones of one shell; all others are the host's own."""
    gone = EdgeParts(list(old), [])
    build, solid = BRep_Builder(), TopoDS_Solid()
    build.MakeSolid(solid)
    for shell in subshapes(host, TopAbs_SHELL):
        faces = subshapes(shell, TopAbs_FACE)
        kept = [face for face in faces if gone.index(face) < 0]
        if len(kept) == len(faces):
            build.Add(solid, shell)
            continue
        made = TopoDS_Shell()
        build.MakeShell(made)
        for face in [*kept, *new]:
            build.Add(made, face)
        made.Closed(BRep_Tool.IsClosed_s(made))
        build.Add(solid, made)
    return solid
