"""Where a ridge cannot be set into one face: a block under it is fused with the host, or cut out of it.

OCP only, no cadquery. The block's ridge is sunk by a little, as OCCT's boolean operations lose or tear what
only touches; so the solid's ridge face is the surface moved by that much, and trimmed at its feet.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeSolid, BRepBuilderAPI_Sewing
from OCP.BRepLib import BRepLib
from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopoDS import TopoDS, TopoDS_Shape, TopoDS_Solid

from cad_export.certificate import Change, certify
from cad_export.check import subshapes
from cad_export.end_caps import volume_between
from cad_export.geometry import DEGENERATE, make_face
from cad_export.slab import _sides, _up
from ridgefeature.bspline import Surface

SUNK = (5e-5, 2e-5, 1.5e-4)
"""How far the block is sunk, in the largest height: the first that passes the certificate is taken."""
_BELOW = 0.5  # thickness of the block under the base, in the largest height


def sunk_fuse(host: TopoDS_Shape, surface: Surface, base: Surface, check: bool = True) -> Change:
    """The host with a block under the ridge fused to it; for a groove, with a block over it cut out.

    surface, base: as for an inset, but their border may lie on several faces of the host, or run over a seam.
    Lengths in the host's unit. Ridges that are partly raised and partly sunk are refused. Raises ValueError
    when no attempt passes the certificate; the message is that of the last one.
    """
    up = _up(base)
    rise = np.einsum("ijd,id->ij", surface.poles - base.poles, up)
    height = rise.flat[np.argmax(np.abs(rise))]
    if min(rise.max(), -rise.min()) > 1e-3 * abs(height):
        raise ValueError("surface: expected a ridge or a groove all along for a fuse, got both; split it")
    if height == 0:
        raise ValueError("surface: expected a height that is not 0 for a fuse; set it into one face instead")
    failed = ""
    for part in SUNK:
        try:
            return _attempt(host, surface, base, up, part * abs(height), height, check)
        except ValueError as error:
            failed = str(error)
    raise ValueError(f"fuse: {failed}")


def _attempt(
    host: TopoDS_Shape,
    surface: Surface,
    base: Surface,
    up: np.ndarray,
    sunk: float,
    height: float,
    check: bool,
) -> Change:
    towards = -1.0 if height > 0 else 1.0
    ridge = replace(surface, poles=surface.poles + towards * sunk * up[:, None])
    away = sunk + _BELOW * abs(height)
    other = replace(base, poles=base.poles + towards * away * up[:, None])
    block = _block(ridge, other) if height > 0 else _block(other, ridge)
    made = (BRepAlgoAPI_Fuse if height > 0 else BRepAlgoAPI_Cut)(host, block).Shape()
    solids = subshapes(made, TopAbs_SOLID)
    if len(solids) != 1:
        raise ValueError(f"expected one solid, got {len(solids)}; move the path")
    before, after = subshapes(host, TopAbs_FACE), subshapes(solids[0], TopAbs_FACE)
    new = tuple(TopoDS.Face_s(f) for f in after if not any(f.IsSame(g) for g in before))
    old = tuple(TopoDS.Face_s(f) for f in before if not any(f.IsSame(g) for g in after))
    expected = volume_between(surface, base)
    change = Change(old, TopoDS.Solid_s(solids[0]), new, base, expected)
    certify(change, thorough=check)
    return change


def _block(top: Surface, low: Surface) -> TopoDS_Solid:
    """The solid between two surfaces of the same knots."""
    sewing = BRepBuilderAPI_Sewing(DEGENERATE * 10)
    for face in (make_face(top), make_face(low).Reversed(), *map(make_face, _sides(top, low))):
        sewing.Add(face)
    sewing.Perform()
    shell = sewing.SewedShape()
    if shell.IsNull() or shell.ShapeType() != TopAbs_SHELL or sewing.NbFreeEdges() > 0:
        raise ValueError(
            "expected a block that closes, it does not; check that the surface does not touch itself"
        )
    solid = BRepBuilderAPI_MakeSolid(TopoDS.Shell_s(shell)).Solid()
    BRepLib.OrientClosedSolid_s(solid)
    return solid
