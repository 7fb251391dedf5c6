"""A ridge surface set into a face of a solid, without boolean operations. OCP only, no cadquery.

The surface's border becomes a hole in the host's face; the surface and, at the ends of an open ridge, a cap
between its last row and the base close the hole. All other faces of the host are the very same afterwards.
The boundary representation is built with OCCT's BRep_Builder: edges are shared from the start, so that
nothing has to be sewn.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.Geom import Geom_BSplineSurface, Geom_Surface
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import (
    TopoDS,
    TopoDS_Face,
    TopoDS_Shape,
    TopoDS_Shell,
    TopoDS_Solid,
    TopoDS_Wire,
)

from cad_export.certificate import Change, certify
from cad_export.check import subshapes
from cad_export.end_caps import volume_between
from cad_export.fallbacks import sunk_fuse
from cad_export.footprint import (
    cross,
    inside,
    meetings,
    seams_of,
    signed_area,
    surface_on,
)
from cad_export.inset_edges import Loop, Maker, SeamError
from ridgefeature.bspline import Surface

Floats = NDArray[np.float64]


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


def face_with(solid: TopoDS_Shape, surface: Surface, within: float = 0.0) -> TopoDS_Face:
    """The face of a solid that lies on exactly this surface, or `within` of it.

    35 poles are compared, to 1e-12 of its size. A fused ridge lies a little off. Raises ValueError when there
    is none.
    """
    most = max(within, 1e-12 * float(np.abs(surface.poles).max()))
    nu, nv, _ = surface.poles.shape
    # Poles here and there tell surfaces apart; all of them would take longer than the rest of a paste.
    probes = [
        (i, j) for i in np.linspace(0, nu - 1, 7, dtype=int) for j in np.linspace(0, nv - 1, 5, dtype=int)
    ]
    expected = [(int(i) + 1, int(j) + 1, gp_Pnt(*surface.poles[i, j].tolist())) for i, j in probes]
    for found in subshapes(solid, TopAbs_FACE):
        g = BRep_Tool.Surface_s(TopoDS.Face_s(found))
        if not isinstance(g, Geom_BSplineSurface) or (g.NbUPoles(), g.NbVPoles()) != (nu, nv):
            continue
        if all(g.Pole(i, j).Distance(point) <= 2 * most for i, j, point in expected):
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


def _check_loops(loops: list[Loop]) -> None:
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
    maker = Maker(surface, base, surface_on(face), face)
    loops = maker.ring() if surface.closed[0] else [maker.open_border()]
    pairs = [maker.hole(loop) for loop in loops]
    _check_loops(pairs)
    new = [maker.ridge_face(loops), *maker.caps(loops), *_split_face(face, maker.own, pairs)]
    solid = _replaced(host, face, new)
    return Change((face,), solid, tuple(new), base, expected)


def _split_face(
    face: TopoDS_Face, own: list[tuple[TopoDS_Wire, Floats]], loops: list[Loop]
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
