"""Where a ridge cannot be set into one face: faces split at their seams, or a block fused with the host.

OCP only, no cadquery. First the border is split where it runs over seams (`split_inset`). Where that cannot
be done a block under the ridge is fused with the host, or cut out of it. The block's ridge is sunk by a
little, as OCCT's boolean operations lose or tear what only touches; so the solid's ridge face is the surface
moved by that much, and trimmed at its feet.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeSolid, BRepBuilderAPI_MakeVertex, BRepBuilderAPI_Sewing
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepLib import BRepLib
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopoDS import TopoDS, TopoDS_Shape, TopoDS_Solid

from cad_export.certificate import Change, certify
from cad_export.check import subshapes
from cad_export.geometry import DEGENERATE, make_face
from cad_export.seam import OffFacesError, split_inset
from cad_export.site import SeamError, Site
from cad_export.slab import _sides, _up
from cad_export.volume_by_height import volume_between
from ridgefeature.bspline import Surface

SUNK = (5e-5, 2e-5, 1.5e-4)
"""How far the block is sunk, in the largest height: the first that passes the certificate is taken."""
_BELOW = 0.5  # thickness of the block under the base, in the largest height


_HOVER = 0.05
"""How far the base may be off the host for a fuse, in the largest height; what it adds counts as an error."""


def fallback(host: TopoDS_Shape, site: Site, h: float, check: bool = True) -> tuple[Change, str]:
    """The host with a site's surface at height h, its footprint over a seam or several faces; the method.

    "split seam": over seams, once round the face, or over other faces on its surface; exact. "sunk fuse":
    where the border runs along a seam, or over faces on other surfaces that follow the base closely. Either
    has passed the certificate. The host is not altered. Raises ValueError, saying what to change, where
    neither can be right.
    """
    try:
        change = split_inset(host, site, h, rough=not check)
        certify(change, thorough=check)
        return change, "split seam"
    except SeamError:
        pass
    except OffFacesError as error:
        _check_on_host(host, site, h, str(error))
        try:
            return sunk_fuse(host, site.at(h), site.base, check), "sunk fuse"
        except ValueError as failed:
            raise ValueError(f"{error} ({failed})") from failed
    return sunk_fuse(host, site.at(h), site.base, check), "sunk fuse"


def _check_on_host(host: TopoDS_Shape, site: Site, h: float, message: str) -> None:
    """Raise ValueError with this message where the base hovers over the host, or lies deep in it."""
    (u0, u1), (v0, v1) = site.base.domain
    points = site.base.on_grid(np.linspace(u0, u1, 25), np.linspace(v0, v1, 7)).reshape(-1, 3)
    most = _HOVER * float(np.linalg.norm(site.at(h).poles - site.base.poles, axis=-1).max())
    shells = subshapes(host, TopAbs_SHELL)
    for point in points:
        vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point.tolist())).Vertex()
        off = min(BRepExtrema_DistShapeShape(vertex, shell).Value() for shell in shells)
        if off > most:
            where = np.round(point, 4).tolist()
            raise ValueError(f"{message} (near {where} the host is {off:.3g} off, more than {most:.3g})")


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
