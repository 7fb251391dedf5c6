"""Whether a change of a solid did what it should: a fast certificate, and OCCT's thorough checks. OCP only."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp_Domain, BRepGProp_Face, BRepGProp_Vinert
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_EDGE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape, TopoDS_Solid

from ridgefeature.bspline import Surface

VOLUME = 1e-3
"""Largest relative error of the volume added."""
TOLERANCE = 1e-3
"""Largest edge tolerance, as a part of the ridge's breadth."""


@dataclass(frozen=True, eq=False)
class Change:
    """A solid made from a host by new faces in place of one, and the volume that they should add."""

    host: TopoDS_Shape
    face: TopoDS_Face
    solid: TopoDS_Solid
    new: tuple[TopoDS_Face, ...]
    volume_expected: float
    size: float
    surface: Surface
    base: Surface

    @property
    def slack(self) -> float:
        """Volume that may be missing where there is hardly a height: the accepted gap over the footprint."""
        return (
            1e-6
            * self.size
            * self.size
            * float(np.linalg.norm(self.base.poles[:, 0] - self.base.poles[:, -1], axis=1).max())
        )

    @cached_property
    def volume_added(self) -> float:
        """Volume between the new faces and the old one: what they enclose, seen from near by.

        The host's other faces are the same before and after, so their part cancels and is left out.
        """
        (u0, u1), (v0, v1) = self.base.domain
        u, v = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
        near = gp_Pnt(*(self.base(u, v) - 0.25 * self.size * self.base.normal(u, v)).tolist())
        return sum(_cone(f, near) for f in self.new) - _cone(self.face, near)


def subshapes(shape: TopoDS_Shape, kind: Any) -> list[TopoDS_Shape]:
    """All sub-shapes of a kind, in order, as oriented within the shape; shared ones come more than once."""
    found = []
    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


def _cone(face: TopoDS_Face, point: gp_Pnt) -> float:
    """Signed volume between a face and a point."""
    return float(BRepGProp_Vinert(BRepGProp_Face(face), BRepGProp_Domain(face), point, point, 1e-4).Mass())


def certify(change: Change, crossings: bool = True) -> float:
    """The largest tolerance of the new edges, once all checks have passed; ValueError names the one that failed."""
    solids = subshapes(change.solid, TopAbs_SOLID)
    if len(solids) != 1:
        raise ValueError(f"expected one solid, got {len(solids)}")
    shells = subshapes(change.solid, TopAbs_SHELL)
    if not all(BRep_Tool.IsClosed_s(shell) for shell in shells):
        raise ValueError("expected a closed shell, got open edges")
    largest = max(
        BRep_Tool.Tolerance_s(TopoDS.Edge_s(e)) for f in change.new for e in subshapes(f, TopAbs_EDGE)
    )
    if largest > TOLERANCE * change.size:
        raise ValueError(f"tolerance {largest}")
    got, expected = change.volume_added, change.volume_expected
    if abs(got - expected) > VOLUME * abs(expected) + change.slack:
        raise ValueError(f"expected an added volume of {expected:.6g}, got {got:.6g}")
    if crossings and not BRepCheck_Analyzer(change.solid).IsValid():
        raise ValueError("expected a valid solid")
    return largest
