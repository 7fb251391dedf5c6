"""Whether a change of a solid did what it should: a fast certificate, and OCCT's thorough checks.

OCP only, no cadquery.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve2d
from OCP.BRepAlgoAPI import BRepAlgoAPI_Check
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp_Domain, BRepGProp_Face, BRepGProp_Vinert
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.Geom import Geom_BSplineSurface
from OCP.GeomAbs import GeomAbs_Line
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape, TopoDS_Solid

from cad_export import occt_arrays
from cad_export.check import is_seam, subshapes
from ridgefeature.bspline import Surface

ROUGH = 0.0
"""Gauss points by the number of poles, without a look at what they leave out."""
_GROUND = 1e-5
"""Accuracy at which the ground is measured for rough ones: it is large, and measured once."""
VOLUME = 1e-3
"""Largest relative error of the volume added."""
TOLERANCE = 5e-4
"""Largest tolerance of an edge, as a part of the ridge's breadth."""
INTEGRATION = (ROUGH, 1e-3, 1e-5, 1e-7)
"""Relative accuracies asked of OCCT's integration, whose default fails on faces with long holes; the finer
ones, which take longer, only where the coarser do not bear out the expected volume."""


@dataclass(frozen=True, eq=False)
class Ground:
    """What remains of a face: its part in the volume as measured, by the accuracy; for all heights the same.

    near: the point from which cones to faces start.
    """

    near: gp_Pnt
    measured: dict[float, float] = field(default_factory=dict)


def ground_under(base: Surface) -> Ground:
    """Nothing measured yet, from a point near by, off the base: a face that it lies on would not count."""
    (u0, u1), (v0, v1) = base.domain
    u, v = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
    breadth = np.linalg.norm(base.poles[:, 0] - base.poles[:, -1], axis=1).max()
    return Ground(gp_Pnt(*(base(u, v) - 0.25 * breadth * base.normal(u, v)).tolist()))


@dataclass(frozen=True, eq=False)
class Change:
    """A solid made from a host by new faces in place of old ones.

    base: the surface for height 0. volume_expected: what the change should add, below 0 for a groove.
    remaining: new faces that are what is left of the old; ground: their part in the volume, kept.
    rough: whether the fastest integration may do.
    """

    old: tuple[TopoDS_Face, ...]
    solid: TopoDS_Solid
    new: tuple[TopoDS_Face, ...]
    base: Surface
    volume_expected: float
    remaining: tuple[TopoDS_Face, ...] = ()
    ground: Ground | None = None
    rough: bool = False

    @cached_property
    def volume_added(self) -> float:
        """Volume between the new faces and the old ones, as OCCT integrates it.

        The host's other faces are the same before and after, so their part cancels and is left out.
        """
        got, ground = 0.0, self.ground or ground_under(self.base)
        for accuracy in INTEGRATION[0 if self.rough else 2 :]:
            fine = accuracy or _GROUND
            if fine not in ground.measured:
                before = sum(_cone(f, ground.near, fine) for f in self.old)
                ground.measured[fine] = sum(_cone(f, ground.near, fine) for f in self.remaining) - before
            got = ground.measured[fine] + sum(_cone(f, ground.near, accuracy) for f in self.new)
            if abs(got - self.volume_expected) <= 0.5 * self.volume_error:
                break
        return got

    @property
    def volume_error(self) -> float:
        """By how much the volume added may differ: VOLUME, and OCCT's own precision over the footprint."""
        return VOLUME * abs(self.volume_expected) + 1e-6 * self.breadth**2 * self.base.size

    @cached_property
    def breadth(self) -> float:
        """Distance between the borders of the flanks, the largest."""
        p = self.base.poles
        return float(np.linalg.norm(p[:, 0] - p[:, -1], axis=1).max())

    @cached_property
    def largest_tolerance(self) -> float:
        """Largest tolerance of the edges of new faces."""
        return max(BRep_Tool.MaxTolerance_s(f, TopAbs_EDGE) for f in (*self.new, *self.remaining))


def _cone(face: TopoDS_Face, point: gp_Pnt, accuracy: float) -> float:
    """Signed volume between a face and a point."""
    smooth, edges = BRepGProp_Face(face), BRepGProp_Domain(face)
    if accuracy != ROUGH:
        return float(BRepGProp_Vinert(smooth, edges, point, point, accuracy).Mass())
    if is_whole(face):
        return float(BRepGProp_Vinert(BRepGProp_Face(_turned(face)), point).Mass())
    return float(BRepGProp_Vinert(smooth, edges, point).Mass())


def _turned(face: TopoDS_Face) -> TopoDS_Face:
    """A whole face's surface and its outside, with the parameter that has more poles as v.

    OCCT integrates with u innermost and works out a patch anew at every change of span.
    """
    surface = BRep_Tool.Surface_s(face)
    if not isinstance(surface, Geom_BSplineSurface) or surface.NbUPoles() <= surface.NbVPoles():
        return face
    turned, made = surface.Copy(), TopoDS_Face()
    turned.ExchangeUV()  # and with it the normal's sense
    BRep_Builder().MakeFace(made, turned, BRep_Tool.Tolerance_s(face))
    return made if face.Orientation() == TopAbs_REVERSED else TopoDS.Face_s(made.Reversed())


def is_whole(face: TopoDS_Face) -> bool:
    """Whether a face's edges lie on the bounds of its surface, all round."""
    u0, u1, v0, v1 = BRep_Tool.Surface_s(face).Bounds()
    lengths = {u0: 0.0, u1: 0.0}, {v0: 0.0, v1: 0.0}
    for edge in subshapes(face, TopAbs_EDGE):
        line = BRepAdaptor_Curve2d(TopoDS.Edge_s(edge), face)
        if line.GetType() != GeomAbs_Line:
            return False
        a, b = (line.Value(t) for t in (line.FirstParameter(), line.LastParameter()))
        if a.X() == b.X() and a.X() in lengths[0]:
            lengths[0][a.X()] += abs(b.Y() - a.Y())
        elif a.Y() == b.Y() and a.Y() in lengths[1]:
            lengths[1][a.Y()] += abs(b.X() - a.X())
        else:
            return False
    sides = [(length, v1 - v0) for length in lengths[0].values()]
    sides += [(length, u1 - u0) for length in lengths[1].values()]
    return all(abs(length - whole) <= 1e-9 * whole for length, whole in sides)


def certify(change: Change, thorough: bool = True) -> None:
    """Raise ValueError, naming the check, unless the change made one closed solid of the right volume.

    Fast, always: one solid; shells without free edges; edge tolerances within TOLERANCE of the breadth; the
    volume added, to VOLUME of what is expected and the volume that edges may be off. Thorough, too: OCCT's
    BRepCheck_Analyzer, its search for faces that cross (BRepAlgoAPI_Check) and a mesh without holes.
    """
    solids = subshapes(change.solid, TopAbs_SOLID)
    if len(solids) != 1:
        raise ValueError(
            f"expected one solid, got {len(solids)}; check that the surface does not touch itself"
        )
    if not all(BRep_Tool.IsClosed_s(shell) for shell in subshapes(change.solid, TopAbs_SHELL)):
        raise ValueError("expected a closed shell, got open borders; check that the host is closed")
    most = TOLERANCE * change.breadth
    if change.largest_tolerance > most:
        raise ValueError(
            f"expected edges to {most:.3g}, the largest tolerance is {change.largest_tolerance:.3g}; "
            "give the surface more control points"
        )
    got, expected = change.volume_added, change.volume_expected
    if not abs(got - expected) <= change.volume_error:
        raise ValueError(
            f"expected an added volume of {expected:.6g}, got {got:.6g}; check that the surface stands on "
            "the face and does not run through itself"
        )
    if thorough:
        check_shape(change.solid)


def check_shape(solid: TopoDS_Shape) -> None:
    """OCCT's thorough checks and a closed mesh; ValueError names the one that fails. Takes up to seconds."""
    if not BRepCheck_Analyzer(solid).IsValid():
        raise ValueError(
            "expected a valid solid, BRepCheck_Analyzer found faulty faces or edges; move the path"
        )
    faults = [fault for fault in BRepAlgoAPI_Check(solid, True, True).Result() if not is_seam(fault)]
    if faults:
        raise ValueError(
            "expected a solid that does not cross itself, BRepAlgoAPI_Check found faces or edges that do; "
            "use a lower height or a path with wider bends"
        )
    free = free_mesh_edges(solid)
    if free:
        raise ValueError(
            f"expected a closed mesh, got {free} sides of triangles without a partner; report it"
        )


def free_mesh_edges(shape: TopoDS_Shape) -> int:
    """How many directed sides of triangles have no partner in OCCT's mesh of a shape; 0 for a closed one.

    A copy is meshed, so the shape stays as it is. Nodes are told to be the same by the edges that
    faces share, not by their place.
    """
    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box, False)
    deflection = 0.002 * box.SquareExtent() ** 0.5
    copy = BRepBuilderAPI_Copy(shape, False, False).Shape()
    BRepMesh_IncrementalMesh(copy, deflection, False, 0.3, False)
    joined, edges = _Joined(), occt_arrays.shape_map()
    faces = [TopoDS.Face_s(f) for f in subshapes(copy, TopAbs_FACE)]
    sides: list[tuple[tuple[Any, ...], ...]] = []
    for k, face in enumerate(faces):
        where = TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(face, where)
        if mesh is None:
            return 1
        for edge in map(TopoDS.Edge_s, subshapes(face, TopAbs_EDGE)):
            line = BRep_Tool.PolygonOnTriangulation_s(edge, mesh, where)
            name, one = edges.Add(edge), BRep_Tool.Degenerated_s(edge)
            for i in range(1, line.NbNodes() + 1):
                joined.join((k, line.Node(i)), ("edge", name, 0 if one else i))
        flip = face.Orientation() == TopAbs_REVERSED
        for i in range(1, mesh.NbTriangles() + 1):
            a, b, c = mesh.Triangle(i).Get()
            a, b, c = (a, c, b) if flip else (a, b, c)
            sides += [((k, a), (k, b)), ((k, b), (k, c)), ((k, c), (k, a))]
    count: Counter[tuple[Any, Any]] = Counter()
    for a, b in sides:
        x, y = joined.find(a), joined.find(b)
        if x != y:
            count[x, y] += 1
    return sum(n != count.get((y, x), 0) for (x, y), n in list(count.items()))


class _Joined:
    """Names that stand for the same thing (union-find)."""

    def __init__(self) -> None:
        self.over: dict[tuple[Any, ...], tuple[Any, ...]] = {}

    def find(self, a: tuple[Any, ...]) -> tuple[Any, ...]:
        while (b := self.over.get(a, a)) != a:
            self.over[a] = self.over.get(b, b)
            a = b
        return a

    def join(self, a: tuple[Any, ...], b: tuple[Any, ...]) -> None:
        self.over[self.find(a)] = self.find(b)
