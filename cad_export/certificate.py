"""Whether a change of a solid did what it should: a fast certificate, and OCCT's thorough checks.

OCP only, no cadquery.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepAlgoAPI import BRepAlgoAPI_Check
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp_Domain, BRepGProp_Face, BRepGProp_Vinert
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape, TopoDS_Solid

from cad_export import occt_arrays
from cad_export.check import is_seam, subshapes
from ridgefeature.bspline import Surface

VOLUME = 1e-3
"""Largest relative error of the volume added."""
TOLERANCE = 5e-4
"""Largest tolerance of an edge, as a part of the ridge's breadth."""
INTEGRATION = (1e-3, 1e-5, 1e-7)
"""Relative accuracies asked of OCCT's integration, whose default fails on faces with long holes; the finer
ones, which take longer, only where the coarser do not bear out the expected volume."""


@dataclass(frozen=True, eq=False)
class Change:
    """A solid made from a host by new faces in place of old ones.

    base: the surface for height 0. volume_expected: what the change should add, below 0 for a groove.
    """

    old: tuple[TopoDS_Face, ...]
    solid: TopoDS_Solid
    new: tuple[TopoDS_Face, ...]
    base: Surface
    volume_expected: float

    @cached_property
    def volume_added(self) -> float:
        """Volume between the new faces and the old ones, as OCCT integrates it.

        The host's other faces are the same before and after, so their part cancels and is left out.
        The cones to the faces start from a point near by, off the base: a face that runs through the point
        would not count.
        """
        (u0, u1), (v0, v1) = self.base.domain
        u, v = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
        near = gp_Pnt(*(self.base(u, v) - 0.25 * self.breadth * self.base.normal(u, v)).tolist())
        got = 0.0
        for accuracy in INTEGRATION:
            got = sum(_cone(f, near, accuracy) for f in self.new) - sum(
                _cone(f, near, accuracy) for f in self.old
            )
            if abs(got - self.volume_expected) <= 0.5 * self.volume_error:
                break
        return got

    @property
    def volume_error(self) -> float:
        """By how much the volume added may differ: VOLUME, and OCCT's own precision over the footprint."""
        extent = float(np.ptp(self.base.poles, axis=(0, 1)).max())
        return VOLUME * abs(self.volume_expected) + 1e-6 * self.breadth**2 * extent

    @cached_property
    def breadth(self) -> float:
        """Distance between the borders of the flanks, the largest."""
        p = self.base.poles
        return float(np.linalg.norm(p[:, 0] - p[:, -1], axis=1).max())

    @cached_property
    def largest_tolerance(self) -> float:
        """Largest tolerance of the edges of new faces."""
        edges = (e for f in self.new for e in subshapes(f, TopAbs_EDGE))
        return max(BRep_Tool.Tolerance_s(TopoDS.Edge_s(e)) for e in edges)


def _cone(face: TopoDS_Face, point: gp_Pnt, accuracy: float) -> float:
    """Signed volume between a face and a point."""
    parts = BRepGProp_Face(face), BRepGProp_Domain(face)
    return float(BRepGProp_Vinert(*parts, point, point, accuracy).Mass())


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
