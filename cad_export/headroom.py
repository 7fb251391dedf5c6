"""How high a ridge may stand on a face, and how deep a groove may go: before it crosses itself or the host.

A ridge is a graph over its base in (s, y, z) -> point(s, y) + z normal(s, y). That map folds where z reaches
a principal radius of the base: where neighbouring normals meet (do Carmo, Differential Geometry of Curves and
Surfaces, 3-5, parallel surfaces). And it ends where another face of the host stands in the way (OCCT's
IntCurvesFace_ShapeIntersector). OCP only, no cadquery.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from OCP.Bnd import Bnd_Box
from OCP.BRepBndLib import BRepBndLib
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt
from OCP.IntCurvesFace import IntCurvesFace_ShapeIntersector
from OCP.TopoDS import TopoDS_Shape

from cad_export.face_base import FaceBase
from cad_export.geometry import DEGENERATE
from cad_export.host_surface import dot
from cad_export.strip import places_along
from ridgefeature.ridge import Ridge

Floats = NDArray[np.float64]

_MOST_PLACES = 129  # along, for the base's curvature
_MOST_LINES = 33  # along, for other faces
_ETA = np.linspace(-0.5, 0.5, 17)
_LINES = slice(4, 13, 4)  # which of them look for other faces: the crest and halfway to the feet
_ROOM = 0.98  # of a radius: nearer to it the surface's normals turn too fast for CAD
_KEPT = 4


@dataclass(frozen=True)
class Limit:
    """The largest rate h of one sign: where it is reached, by which height, and what stands in the way."""

    rate: float
    s: float
    height: float
    folds: bool
    """Whether the face's normals meet there; else it is another face of the host."""


@dataclass(frozen=True)
class Headroom:
    """The largest rates h, and -h, for one ridge at one place of a host; rate inf where there is none."""

    raised: Limit
    engraved: Limit


_KNOWN: WeakKeyDictionary[FaceBase, list[tuple[TopoDS_Shape, Ridge, Headroom]]] = WeakKeyDictionary()


def check_height(solid: TopoDS_Shape, base: FaceBase, ridge: Ridge, h: float = 1.0) -> None:
    """Raise ValueError where the ridge, h times as high, crosses itself or another face of the solid.

    solid: that whose face the base is of. ridge: as it stands on the base (see face_base), its width final;
    lengths in the solid's unit. What does not depend on h is worked out once and remembered.
    """
    room = _known(solid, base, ridge)
    limit = room.raised if h > 0 else room.engraved
    if abs(h) < limit.rate:
        return
    most = f"{'at most' if h > 0 else 'at least'} {np.copysign(limit.rate, h):.4g}"
    if limit.folds:
        raise ValueError(
            f"h: expected {most}, or the surface runs through itself where normals of the face meet, "
            f"{limit.height:.4g} from it, at arc length {limit.s:.4g}; got {h:g}; use a smaller h, or a "
            "face that bends less"
        )
    raise ValueError(
        f"h: expected {most}, or the surface runs into another part of the host, {limit.height:.4g} from the "
        f"face, at arc length {limit.s:.4g}; got {h:g}; use a smaller h, or move the path"
    )


def _known(solid: TopoDS_Shape, base: FaceBase, ridge: Ridge) -> Headroom:
    known = _KNOWN.setdefault(base, [])
    for other, same, room in known:
        if _alike(same, ridge) and other.IsSame(solid):
            return room
    room = headroom(solid, base, ridge)
    known.append((solid, ridge, room))
    del known[:-_KEPT]
    return room


def _alike(a: Ridge, b: Ridge) -> bool:
    same = a.section is b.section and np.array_equal(a.width, b.width)
    return same and np.array_equal(a.height, b.height)


def headroom(solid: TopoDS_Shape, base: FaceBase, ridge: Ridge) -> Headroom:
    """The largest rates h of both signs; see check_height. On at most 129 by 17 places, 33 by 3 for faces."""
    s = places_along(base)
    width, height = (np.interp(s, ridge.arc_length, x) for x in (ridge.width, ridge.height))
    x = base.parameters(s, width[:, None] * _ETA)
    few = _even(len(s), _MOST_PLACES)
    least, largest = _curvatures(base, x[few])
    rise = height[:, None] * ridge.section(_ETA)
    lines = _even(len(s), _MOST_LINES)
    below, above = _gaps(solid, base, x[lines][:, _LINES])
    limits = []
    for sign in (1.0, -1.0):
        towards = sign * rise[few]
        bend = np.where(towards > 0, largest, -least)  # towards the side where the ridge stands
        with np.errstate(divide="ignore"):
            radius = np.where(bend > 0, _ROOM / np.maximum(bend, 0), np.inf)
        up = sign * rise[lines][:, _LINES]
        gap = np.where(up > 0, above, below)
        found = [_limit(radius, towards, s[few], True), _limit(gap, up, s[lines], False)]
        limits.append(min(found, key=lambda limit: limit.rate))
    return Headroom(*limits)


def _limit(room: Floats, rise: Floats, s: Floats, folds: bool) -> Limit:
    rate = np.divide(room, np.abs(rise), out=np.full_like(room, np.inf), where=rise != 0)
    i, j = np.unravel_index(int(rate.argmin()), rate.shape)
    return Limit(float(rate[i, j]), float(s[i]), float(room[i, j]), folds)


def _even(n: int, most: int) -> NDArray[np.intp]:
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(np.intp))


def _curvatures(base: FaceBase, x: Floats) -> tuple[Floats, Floats]:
    """Principal curvatures (...) at parameters (..., 2), the lesser first; positive where normals meet."""
    _, pu, pv, puu, puv, pvv = base.host.jet(x[..., 0], x[..., 1])
    normal = base.host.normal(pu, pv)
    e, f, g = dot(pu, pu), dot(pu, pv), dot(pv, pv)
    ll, m, n = dot(puu, normal), dot(puv, normal), dot(pvv, normal)
    area = e * g - f * f
    mean = 0.5 * (e * n - 2 * f * m + g * ll) / area
    spread = np.sqrt(np.maximum(mean**2 - (ll * n - m * m) / area, 0.0))
    return mean - spread, mean + spread


def _gaps(solid: TopoDS_Shape, base: FaceBase, x: Floats) -> tuple[Floats, Floats]:
    """Distances along the face's normals to the solid's next face, below and above; inf without one."""
    points, normals = base.host.frame(x[..., 0], x[..., 1])
    box = Bnd_Box()
    BRepBndLib.Add_s(solid, box, False)
    far = 1.01 * box.SquareExtent() ** 0.5
    near = 1e-3 * float(base.breadth(np.array([0.5 * base.length]))[0])
    meeting = IntCurvesFace_ShapeIntersector()
    meeting.Load(solid, DEGENERATE)
    gaps = np.full((2, points[..., 0].size), np.inf)
    for i, (p, d) in enumerate(np.stack([points, normals], axis=-2).reshape(-1, 2, 3).tolist()):
        line = gp_Lin(gp_Pnt(*p), gp_Dir(*d))
        meeting.Perform(line, -far, far)
        hits = [meeting.WParameter(k) for k in range(1, meeting.NbPnt() + 1)]
        gaps[0, i] = min((-at for at in hits if -at > near), default=np.inf)
        gaps[1, i] = min((at for at in hits if at > near), default=np.inf)
    return gaps[0].reshape(x.shape[:-1]), gaps[1].reshape(x.shape[:-1])
