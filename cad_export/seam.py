"""A ridge set into a face over its seam, once round it, or into several faces on one surface. OCP only.

As an inset, without boolean operations. Where the ridge's border crosses a seam, or an edge between two such
faces, both are split at a common vertex; what lies under the ridge is left out, and the faces are made anew
from what remains of their edges. No surface is turned or refitted, and all other faces stay the host's own.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED, TopAbs_VERTEX
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape

from cad_export.certificate import Change
from cad_export.check import subshapes
from cad_export.crossings import Crossing, CutEdge, Stretch, crossings, cut_edges, outward, same_surface
from cad_export.footprint import HostSurface, occt_curve, on_host, surface_on, wires_of
from cad_export.geometry import DEGENERATE
from cad_export.inset_edges import Maker, Piece
from cad_export.polylines import cross, inside
from cad_export.regions import HalfEdge, half_edges, regions
from cad_export.site import ON_HOST, Line, Loop, Site
from cad_export.splitting import EdgeParts, KeptParts, kept_parts, split_edge, with_edges, with_faces
from ridgefeature.bspline import Curve

Floats = NDArray[np.float64]

_LEAVES = "surface: expected a border within the face, it leaves the face's outline; move the path"
_NOWHERE = np.empty((0, 2))
_MEETS_HOLE = "surface: expected a border clear of holes and earlier ridges, it overlaps one; move the path"


class OffFacesError(ValueError):
    """The footprint leaves the face, and the faces that go on from it on the same surface."""


class CutSite(Site):
    """A site whose border may run over seams of the face, round it, or into other faces on its surface."""

    @cached_property
    def loops(self) -> tuple[Loop, ...]:
        """The border's lines in space; their parameters on faces are worked out for each part."""
        sides = [self._side(0), self._side(-1)]
        if self.base.closed[0]:
            rounds = [sides[:1], sides[1:]]
        else:
            rounds = [[sides[0], self._end(-1), sides[1], self._end(0)]]
        return tuple(
            Loop(tuple(Line(c, occt_curve(c), None, self._off(c), ahead) for c, _, ahead in parts), _NOWHERE)
            for parts in rounds
        )

    def _off(self, curve: Curve) -> float:
        """How far a curve is off the face's surface."""
        low, high = curve.domain
        points = curve(np.linspace(low, high, 8 * len(curve.poles)))
        off = _distance(surface_on(self.face), points)
        self._check_distance(off)
        return off


def _distance(surface: HostSurface, points: Floats) -> float:
    """The largest distance of points (n, 3) from the surface."""
    uv = surface.parameters(points)
    low, period = np.array(surface.geometry.Bounds())[::2], np.array(surface.periods)
    # a surface that closes without being periodic has nothing beyond its own parameters
    uv = np.where(period > 0, low + np.mod(uv - low, np.where(period > 0, period, 1.0)), uv)
    return float(np.linalg.norm(surface.points(uv) - points, axis=1).max())


@lru_cache(maxsize=8)
def _cut_site(site: Site) -> CutSite:
    """The same site, kept: what does not depend on the height is worked out once."""
    return CutSite(site.face, site.surface, site.base)


def split_inset(host: TopoDS_Shape, site: Site, h: float, rough: bool = False) -> Change:
    """The host with the surface at height h set into the site's face and others on the same surface.

    host: the solid that holds the face; not altered. rough: whether the fastest integration of the volume may
    do. The change's first new face is the ridge's. Raises
    SeamError where the border runs along a seam or over its end; OffFacesError where it leaves these faces;
    ValueError, saying what to change, where it is off the surface, or meets or covers holes and earlier
    ridges.
    """
    place = _cut_site(site)
    place.volume.check(h)
    _check_side(place)
    maker = Maker(place, h)
    border = maker.border()
    loops = [[_stretch(piece) for piece in pieces] for pieces in border]
    sheet = same_surface(host, place.face, ON_HOST * place.breadth)
    cuts = cut_edges(sheet)
    found = [crossings(loop, cuts, place.face, place.breadth, ON_HOST * place.breadth) for loop in loops]
    made = [maker.ridge_face(border), *maker.caps(border)]
    parts = [_parts(loop, met) for loop, met in zip(loops, found, strict=True)]
    new = [with_edges(face, _by_edge(loops, parts)) for face in made]
    halves = [[half_edges(wire, face) for wire in wires_of(face)] for face in sheet]
    laid = [_laid(part, sheet, halves, place) for loop in parts for some in loop for part in some]
    _check_clear(laid, halves, cuts)
    kept = kept_parts(cuts, [x for met in found for x in met], sheet)
    old, ground = _divided(sheet, halves, kept, laid)
    solid = with_faces(host, old, [*new, *ground])
    expected = place.volume.at(h)
    return Change(tuple(old), solid, tuple(new), place.base, expected, tuple(ground), place.ground, rough)


def _check_side(site: Site) -> None:
    (u0, u1), (v0, v1) = site.base.domain
    u, v = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
    uv = surface_on(site.face).parameters(site.base(u, v)[None])[0]
    if not site.base.normal(u, v) @ outward(site.face, uv) > 0:
        raise ValueError(
            "surface: expected du x dv away from the host's material, it points inwards; "
            "turn the surface round"
        )


def _stretch(piece: Piece) -> Stretch:
    first, last = BRep_Tool.Range_s(piece.on_host)
    return Stretch(piece.on_host, piece.line.curve, (first, last), piece.line.forward, piece.off)


def _parts(loop: list[Stretch], met: list[Crossing]) -> list[list[Stretch]]:
    """Each stretch of a border, split at its crossings; a crossing at its end splits nothing."""
    made = []
    for k, stretch in enumerate(loop):
        inner = [x for x in met if x.piece == k and not any(x.vertex.IsSame(v) for v in stretch.ends)]
        at = [(stretch.span[0], stretch.ends[0]), *((x.t, x.vertex) for x in inner)]
        edges = split_edge(stretch.edge, [*at, (stretch.span[1], stretch.ends[1])])
        made.append([replace(stretch, edge=edge, span=span) for edge, span in edges])
    return made


def _by_edge(loops: list[list[Stretch]], parts: list[list[list[Stretch]]]) -> EdgeParts:
    whole = [stretch.edge for loop in loops for stretch in loop]
    return EdgeParts(whole, [[part.edge for part in some] for loop in parts for some in loop])


def _check_clear(
    laid: list[tuple[int, HalfEdge]], halves: list[list[list[HalfEdge]]], cuts: list[CutEdge]
) -> None:
    """Raise ValueError where the border meets edges of its faces that it may not cross."""
    cut = EdgeParts([c.edge for c in cuts], [])
    for k, wires in enumerate(halves):
        for i, wire in enumerate(wires):
            fixed = [half.segments for half in wire if cut.index(half.edge) < 0]
            if fixed and any(cross(half.segments, np.concatenate(fixed)) for j, half in laid if j == k):
                raise ValueError(_MEETS_HOLE) if i else OffFacesError(_LEAVES)


def _divided(
    sheet: list[TopoDS_Face],
    halves: list[list[list[HalfEdge]]],
    kept: KeptParts,
    laid: list[tuple[int, HalfEdge]],
) -> tuple[list[TopoDS_Face], list[TopoDS_Face]]:
    """The faces that the border meets, and those that remain of them."""
    old, remaining = [], []
    for k, (face, wires) in enumerate(zip(sheet, halves, strict=True)):
        own, new = [half for wire in wires for half in wire], [half for j, half in laid if j == k]
        if new or any(kept.is_changed(half.edge) for half in own):
            old.append(face)
            remaining += regions(face, [*(part for half in own for part in kept.of(half, face)), *new])
    return old, remaining


def _laid(
    part: Stretch, sheet: list[TopoDS_Face], own: list[list[list[HalfEdge]]], site: Site
) -> tuple[int, HalfEdge]:
    """On which of the faces a part of the border lies, and the part as that face's half-edge.

    Its edge gets a parameter curve on the face.
    """
    middle, is_in_hole = part.curve(0.5 * (part.span[0] + part.span[1]))[None], False
    for k, (face, wires) in enumerate(zip(sheet, own, strict=True)):
        surface = surface_on(face)
        segments = np.concatenate([half.segments for wire in wires for half in wire])
        uv = surface.parameters(middle)
        if not np.linalg.norm(surface.points(uv) - middle) <= ON_HOST * site.breadth:
            continue
        for move in _moves(uv[0], segments, surface.periods):
            if inside(uv + move, segments)[0]:
                return k, _half_on(part, face, uv[0] + move, site)
            outline = np.concatenate([half.segments for half in wires[0]])
            is_in_hole |= bool(inside(uv + move, outline)[0])
    raise ValueError(_MEETS_HOLE) if is_in_hole else OffFacesError(_LEAVES)


def _moves(uv: Floats, segments: Floats, periods: tuple[float, float]) -> list[Floats]:
    """By what whole periods parameters (2,) can be moved to lie among a face's own."""
    low, high = segments.min(axis=(0, 1)), segments.max(axis=(0, 1))
    turns = [
        range(int(np.ceil((a - x) / p)), int(np.floor((b - x) / p)) + 1) if p else range(1)
        for x, a, b, p in zip(uv, low, high, periods, strict=True)
    ]
    return [np.multiply((i, j), periods) for i in turns[0] for j in turns[1]]


def _half_on(part: Stretch, face: TopoDS_Face, at: Floats, site: Site) -> HalfEdge:
    """A part of the border, its middle at parameters `at`, as a half-edge of the face around the ridge."""
    surface, middle = surface_on(face), 0.5 * (part.span[0] + part.span[1])
    found = on_host(surface, part.curve, part.span, None, part.forward)
    period = np.array(surface.periods)
    move = period * np.round((at - found.flat(middle)) / np.where(period > 0, period, np.inf))
    if move.any() and not found.distance <= ON_HOST * site.breadth:
        # a surface that closes without being periodic has nothing there: begin on its own parameters
        found = on_host(surface, part.curve, part.span, found.polyline[0] + move, part.forward)
        move = np.zeros(2)
    if not found.distance <= ON_HOST * site.breadth:
        raise OffFacesError(_LEAVES)
    where, build = TopLoc_Location(), BRep_Builder()
    raw = BRep_Tool.Surface_s(face, where)
    flat = occt_curve(replace(found.flat, poles=found.flat.poles + move))
    off = max(found.distance, part.off)
    build.UpdateEdge(part.edge, flat, raw, where, 1.1 * off + DEGENERATE)
    for vertex in subshapes(part.edge, TopAbs_VERTEX):
        build.UpdateVertex(TopoDS.Vertex_s(vertex), 1.01 * BRep_Tool.Tolerance_s(part.edge))
    flip = face.Orientation() == TopAbs_REVERSED
    line = found.polyline + move
    edge = part.edge.Oriented(TopAbs_FORWARD if part.forward == flip else TopAbs_REVERSED)
    return HalfEdge(TopoDS.Edge_s(edge), line if flip else line[::-1], True)
