"""How high a ridge may stand on a face, and how deep a groove may go: before it crosses itself or the host.

A ridge is a graph over its base in (s, y, z) -> point(s, y) + z normal(s, y). That map folds where z reaches
a principal radius of the base: where neighbouring normals meet (do Carmo, Differential Geometry of Curves and
Surfaces, 3-5, parallel surfaces). And it ends where another face of the host stands in the way (OCCT's
IntCurvesFace_ShapeIntersector). OCP only, no cadquery.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from functools import cached_property

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
_BESIDE = slice(4, 13, 8)  # the latter
_ROOM = 0.98  # of a radius: nearer to it the surface's normals turn too fast for CAD
_KEPT, _KEPT_PLACES = 4, 16


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


@dataclass(frozen=True, eq=False)
class _Place:
    """A base and the solid around it: what all ridges there have in common, and what was found for some."""

    solid: TopoDS_Shape
    base: FaceBase
    found: list[tuple[Ridge, Headroom]] = field(default_factory=list)

    @cached_property
    def s(self) -> Floats:
        """(n,) arc lengths that are looked at."""
        return places_along(self.base)

    @cached_property
    def few(self) -> NDArray[np.intp]:
        """Those at which the base's curvature is looked at."""
        return _even(len(self.s), _MOST_PLACES)

    @cached_property
    def lines(self) -> NDArray[np.intp]:
        """Those from which other faces are looked for."""
        return _even(len(self.s), _MOST_LINES)

    @cached_property
    def near(self) -> float:
        """Nearer than this it is the base's own face."""
        return 1e-3 * float(self.base.breadth(np.array([0.5 * self.base.length]))[0])

    @cached_property
    def far(self) -> float:
        """Beyond this there is nothing."""
        box = Bnd_Box()
        BRepBndLib.Add_s(self.solid, box, False)
        return float(1.01 * box.SquareExtent() ** 0.5)

    @cached_property
    def faces(self) -> IntCurvesFace_ShapeIntersector:
        """The solid's faces, to be met by lines."""
        meeting = IntCurvesFace_ShapeIntersector()
        meeting.Load(self.solid, DEGENERATE)
        return meeting

    @cached_property
    def over_crest(self) -> Floats:
        """(2, lines, 1) gaps over the path, where the crest is at all widths."""
        return self.gaps(self.base.parameters(self.s[self.lines], np.zeros((len(self.lines), 1))))

    def gaps(self, x: Floats) -> Floats:
        """(2, ...) distances along the face's normals at parameters (..., 2) to the solid's next face.

        Below and above; inf without one.
        """
        points, normals = self.base.host.frame(x[..., 0], x[..., 1])
        faces, near, far = self.faces, self.near, self.far
        gaps = []
        for p, d in np.stack([points, normals], axis=-2).reshape(-1, 2, 3).tolist():
            faces.Perform(gp_Lin(gp_Pnt(*p), gp_Dir(*d)), -far, far)
            below = above = np.inf
            for k in range(1, faces.NbPnt() + 1):
                at = faces.WParameter(k)
                if at > near:
                    above = min(above, at)
                elif at < -near:
                    below = min(below, -at)
            gaps.append((below, above))
        return np.array(gaps).T.reshape(2, *x.shape[:-1])


_PLACES: deque[_Place] = deque(maxlen=_KEPT_PLACES)


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
            f"{limit.height:.4g} from it, at arc length {limit.s:.4g}; got {h:g}; use an h nearer to 0, or a "
            "face that bends less"
        )
    raise ValueError(
        f"h: expected {most}, or the surface runs into another part of the host, {limit.height:.4g} from the "
        f"face, at arc length {limit.s:.4g}; got {h:g}; use an h nearer to 0, or move the path"
    )


def _known(solid: TopoDS_Shape, base: FaceBase, ridge: Ridge) -> Headroom:
    place = next((p for p in _PLACES if p.base is base and p.solid.IsSame(solid)), None)
    if place is None:
        place = _Place(solid, base)
        _PLACES.append(place)
    for same, room in place.found:
        if _alike(same, ridge):
            return room
    room = _headroom(place, ridge)
    place.found.append((ridge, room))
    del place.found[:-_KEPT]
    return room


def _alike(a: Ridge, b: Ridge) -> bool:
    same = a.section is b.section and np.array_equal(a.width, b.width)
    return same and np.array_equal(a.height, b.height)


def headroom(solid: TopoDS_Shape, base: FaceBase, ridge: Ridge) -> Headroom:
    """The largest rates h of both signs; see check_height. On at most 129 by 17 places, 33 by 3 for faces."""
    return _headroom(_Place(solid, base), ridge)


def _headroom(place: _Place, ridge: Ridge) -> Headroom:
    s, base, few, lines = place.s, place.base, place.few, place.lines
    width, height = (np.interp(s, ridge.arc_length, x) for x in (ridge.width, ridge.height))
    x = base.parameters(s, width[:, None] * _ETA)
    least, largest = _curvatures(base, x[few])
    rise = height[:, None] * ridge.section(_ETA)
    left, right = np.split(place.gaps(x[lines][:, _BESIDE]), 2, axis=2)
    below, above = np.concatenate([left, place.over_crest, right], axis=2)
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
