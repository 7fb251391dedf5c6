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
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.Geom import Geom_BSplineSurface
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopoDS import (
    TopoDS,
    TopoDS_Face,
    TopoDS_Shape,
    TopoDS_Shell,
    TopoDS_Solid,
)

from cad_export.certificate import Change, certify
from cad_export.check import subshapes
from cad_export.fallbacks import fallback
from cad_export.inset_edges import Maker
from cad_export.site import SeamError, Site
from ridgefeature.bspline import Surface

_SUNK = 1e-3
"""How far the face of a fused ridge may lie off its surface, in heights."""


@dataclass(frozen=True)
class InsetReport:
    """How a surface was set into a host.

    method: "inset", "split seam" or "sunk fuse"; volumes and tolerance in the host's unit; volume_added is
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
    solid, _, report = inset_at(host, Site(face_of(host, face), surface, base), 1.0, check)
    return solid, report


def inset_at(
    host: TopoDS_Shape, site: Site, h: float, check: bool = True
) -> tuple[TopoDS_Solid, TopoDS_Face, InsetReport]:
    """As `inset`, at height h of a site on a face of this host: the solid, the ridge's face in it, a report.

    All that does not depend on the height is kept by the site: the next height costs less.
    """
    start = time.perf_counter()
    try:
        change, method = _changed(host, site, h, not check), "inset"
        grown = change.new[0]
        certify(change, thorough=check)
    except SeamError:
        surface = site.at(h)
        change, method = fallback(host, site, h, check)
        grown = face_with(change.solid, surface, _SUNK * float(np.abs(surface.poles - site.base.poles).max()))
    report = InsetReport(
        method,
        change.volume_added,
        change.volume_expected,
        change.largest_tolerance,
        time.perf_counter() - start,
    )
    return change.solid, grown, report


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


def face_of(host: TopoDS_Shape, face: TopoDS_Face) -> TopoDS_Face:
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


def _changed(host: TopoDS_Shape, site: Site, h: float, rough: bool) -> Change:
    site.volume.check(h)
    maker = Maker(site, h)
    border = maker.border()
    grown = maker.ridge_face(border)
    new, ground = [grown, *maker.caps(border)], maker.ground(border)
    solid = _replaced(host, site.face, [*new, *ground])
    expected = site.volume.at(h)
    return Change((site.face,), solid, tuple(new), site.base, expected, tuple(ground), site.ground, rough)


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
