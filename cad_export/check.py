"""Whether a shape is the solid it should be. OCCT's own validity says nothing: an empty compound is valid."""

from __future__ import annotations

from typing import Any

from OCP.BOPAlgo import BOPAlgo_CheckResult, BOPAlgo_SelfIntersect
from OCP.BRep import BRep_Tool
from OCP.BRepAlgoAPI import BRepAlgoAPI_Check
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Shape


def volume(shape: TopoDS_Shape, tolerance: float = 1e-4) -> float:
    """Signed volume, to a relative tolerance: OCCT's default integration fails on faces with long holes."""
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, tolerance, True, False)
    return float(properties.Mass())


def check_solid(shape: TopoDS_Shape, expected_volume: float, crossings: bool = True) -> None:
    """Raise ValueError unless `shape` is one closed, valid solid of the expected volume (to 1 in 1000).

    `crossings` also looks for faces that run through each other (BRepAlgoAPI_Check): thorough, and the slow
    part, up to seconds for long ridges.
    """
    solids, shells = subshapes(shape, TopAbs_SOLID), subshapes(shape, TopAbs_SHELL)
    if len(solids) != 1:
        raise ValueError(
            f"expected one solid, got {len(solids)}; check that the surface does not touch itself"
        )
    if not shells or not all(BRep_Tool.IsClosed_s(shell) for shell in shells):
        raise ValueError(
            "expected a closed solid, got open borders; check that the surface does not touch itself"
        )
    if not BRepCheck_Analyzer(shape).IsValid():
        raise ValueError(
            "expected a valid solid, OCCT found faulty faces or edges; check the surface's border"
        )
    got = volume(shape)
    if not expected_volume > 0 or abs(got - expected_volume) > 1e-3 * expected_volume:
        raise ValueError(
            f"expected a solid of volume {expected_volume:.6g}, got {got:.6g}; it turns inside out somewhere"
        )
    faults = [fault for fault in BRepAlgoAPI_Check(shape, True, crossings).Result() if not is_seam(fault)]
    if faults:
        raise ValueError(
            "expected a solid without self-intersections; use a thinner one or a shorter stretch"
        )


def is_seam(fault: BOPAlgo_CheckResult) -> bool:
    """Whether OCCT merely takes the seam of one closed face for a self-intersection, as it always does."""
    shapes = [*fault.GetFaultyShapes1(), *fault.GetFaultyShapes2()]
    if (
        fault.GetCheckStatus() != BOPAlgo_SelfIntersect
        or len(shapes) != 1
        or shapes[0].ShapeType() != TopAbs_FACE
    ):
        return False
    geometry = BRep_Tool.Surface_s(TopoDS.Face_s(shapes[0]))
    return bool(geometry.IsUClosed() or geometry.IsVClosed())


def subshapes(shape: TopoDS_Shape, kind: Any) -> list[TopoDS_Shape]:
    """All sub-shapes of a kind, in order, as oriented within the shape; shared ones come more than once."""
    found = []
    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found
