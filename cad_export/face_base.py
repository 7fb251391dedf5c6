"""The base that a ridge stands on when it is pasted: a strip of a host face along a path. No cadquery."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Face

from cad_export.face_path import FacePath, developed_path, follow, nearest, projected_path, settled
from cad_export.flanks import narrowed
from cad_export.geometry import topods
from cad_export.host_surface import Host, host_of
from cad_export.ring_path import closed_path
from cad_export.strip import check_strip, inner_point, longer_direction, samples_of
from ridgefeature.base import developed
from ridgefeature.fitting import joined, mirrored
from ridgefeature.merge import along
from ridgefeature.ridge import Ridge

Floats = NDArray[np.float64]

NEAR = 0.25
"""How far a path or `at` may lie from the face, in widths."""
_DEGREE = 16
_KEPT = 8


@dataclass(frozen=True, eq=False)
class FaceBase:
    """A strip of a host face: s is arc length along a path on it, y geodesic distance to the left of it.

    Points lie on the face's surface, which goes on beyond the face; normals point out of the solid. y runs
    along geodesics square to the path (Fermi coordinates). What was integrated for given s is kept: the
    parameters as Chebyshev polynomials of y; other y then cost an evaluation.
    """

    host: Host
    path: FacePath
    reach: tuple[Floats, Floats]
    """Arc lengths (k,) and breadths (k,) of the strip to either side, for which polynomials are made."""
    kept: dict[bytes, tuple[Floats, Floats]] = field(default_factory=dict, repr=False)
    slim: bool = False
    """Whether the flanks were narrowed."""

    @property
    def length(self) -> float:
        """Arc length of the path."""
        return self.path.length

    @property
    def closed(self) -> bool:
        """Whether the path ends where it starts."""
        return self.path.closed

    @property
    def face(self) -> TopoDS_Face:
        """The host face."""
        return self.host.face

    def breadth(self, s: Floats) -> Floats:
        """(k,) breadth of the strip to either side at arc lengths s (k,)."""
        return np.asarray(along(*self.reach, np.asarray(s), 0, self.closed), dtype=np.float64)

    def __call__(self, s: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Points on the face's surface and its outward unit normals (k, m, 3) at s (k,), y (k, m)."""
        x = self.parameters(s, y)
        return self.host.frame(x[..., 0], x[..., 1])

    def parameters(self, s: Floats, y: Floats) -> Floats:
        """Parameters u, v (k, m, 2) on the face's surface at s (k,), y (k, m).

        Continuous: over the seam of a periodic surface they run on beyond its range. Raises ValueError for
        s off the path or values that are not finite.
        """
        s, y = np.asarray(s, dtype=np.float64), np.asarray(y, dtype=np.float64)
        if s.ndim != 1 or y.ndim != 2 or len(s) != len(y) or y.size == 0:
            raise ValueError(f"expected s of shape (k,) and y of shape (k, m), got {s.shape} and {y.shape}")
        slack = 1e-9 * self.length
        if not (np.isfinite(y).all() and (s >= -slack).all() and (s <= self.length + slack).all()):
            raise ValueError(
                f"expected finite y and arc lengths s from 0 to {self.length:g}; stay on the path"
            )
        if not y.any():  # the path itself
            return np.repeat(self.path(np.clip(s, 0.0, self.length))[0][:, None], y.shape[1], axis=1)
        reach, coefficients = self._polynomials(s, np.abs(y).max(axis=1))
        powers = np.polynomial.chebyshev.chebvander(y / reach[:, None], coefficients.shape[1] - 1)
        return np.asarray(np.matmul(powers, coefficients), dtype=np.float64)

    def _polynomials(self, s: Floats, needed: Floats) -> tuple[Floats, Floats]:
        """Reach (k,) and Chebyshev coefficients (k, terms, 2) of the parameters over it."""
        key = s.tobytes()
        if key not in self.kept:
            if len(self.kept) >= _KEPT:
                self.kept.pop(next(iter(self.kept)))
            self.kept[key] = self._integrated(s, self.breadth(s))
        found = self.kept[key]
        if (needed > found[0] * (1 + 1e-9)).any():
            # not kept: what is found within the strip must not depend on what was asked before
            return self._integrated(s, np.maximum(found[0], needed))
        return found

    def _integrated(self, s: Floats, reach: Floats) -> tuple[Floats, Floats]:
        x, rate = self.path(np.clip(s, 0.0, self.length))
        _, pu, pv = self.host.jet(x[:, 0], x[:, 1], 1)[:3]
        ahead = rate[:, :1] * pu + rate[:, 1:] * pv
        left = np.cross(self.host.normal(pu, pv), ahead)
        aside = self.host.parameters(left / np.linalg.norm(left, axis=1, keepdims=True), pu, pv)
        if self.host.straight:
            return reach, np.stack([x, reach[:, None] * aside], axis=1)
        start, rates = np.concatenate([x, x]), np.concatenate([aside, -aside])
        half = _DEGREE // 2
        nodes = np.sin(0.5 * np.pi * np.arange(half + 1) / half)  # Chebyshev points, from 0 to 1
        steps = np.diff(nodes)[:, None] * np.tile(reach, 2)
        parts, before = 1, None
        for round_ in range(7):
            fine = np.repeat(steps / parts, parts, axis=0)
            with np.errstate(all="ignore"):
                both = follow(self.host, start, rates, fine)[0][::parts]
                if settled(self.host, both, before, float(reach.min()), round_):
                    break
            before, parts = both, 2 * parts
        if not np.isfinite(both).all():
            raise ValueError(
                "expected a face that the strip can be laid on, it runs into a pole of the surface; "
                "move it away from the pole"
            )
        left_side, right_side = both[:, : len(s)], both[:, len(s) :]
        values = np.concatenate([right_side[:0:-1], left_side])
        grid = np.concatenate([-nodes[:0:-1], nodes])
        matrix = np.linalg.inv(np.polynomial.chebyshev.chebvander(grid, _DEGREE))
        return reach, np.asarray(np.einsum("ij,jkd->kid", matrix, values), dtype=np.float64)


def face_base(
    face: Any,
    ridge: Ridge,
    path: Any = None,
    at: Any = None,
    direction: Any = None,
    fit: str = "length",
    mirror: bool = False,
    reverse: bool = False,
    w: float | None = None,
    beyond: bool = False,
) -> tuple[FaceBase, Ridge]:
    """The base of a host face along a path, and the ridge fitted to it: on that stands ridge.surface(base).

    face: a TopoDS_Face, or anything with one in `.wrapped`; lengths in its unit. Without a path the ridge's
    own is developed onto the face, its bends kept as geodesic curvature: its middle at the point of the face
    nearest to `at` (3,), by default nearest to the face's centre, and its mean direction (from start to end;
    of a ridge that ends near its start, the tangent in the middle) along `direction` (3,), laid into the
    face. By default that is the mean direction that the ridge has in space, unless it stands across the face:
    then the face's longer parametric direction.
    path: an edge or wire within NEAR widths of the face, in the direction of its orientation; fit, as in
    Ridge.stretched: "length" stretches the ridge to the path, "scale" scales it too, "trim" keeps it, cut
    where the path is shorter; a longer path is used up to the ridge's length. A closed path gives a closed
    base, on which the ridge's ends are blended into each other; so does a ring that closes on the face.
    w: rate of width that the ridge will have at most; given, its flanks are narrowed where path or face would
    fold them, but not the feet's own (see flanks.narrowed).
    mirror: what lay to the left of the ridge's path lies to its right. reverse: the ridge runs the other way.
    beyond: the strip may leave the face over its outline, along the face's surface.
    Raises ValueError, in words, where the strip of the ridge's borders leaves the face, lies on a hole of it,
    folds in a bend, or overlaps itself; for a path or `at` off the face, corners, no length, no direction.
    """
    base, fitted = laid(face, ridge, path, at, direction, fit, mirror, reverse)
    strip = samples_of(base)
    if w is not None and (slim := narrowed(strip, fitted, w)) is not fitted:
        base, fitted = replace(base, reach=(slim.arc_length, slim.border), kept={}, slim=True), slim
        strip = samples_of(base)
    check_strip(base, strip, beyond)
    return base, fitted


def laid(
    face: Any,
    ridge: Ridge,
    path: Any = None,
    at: Any = None,
    direction: Any = None,
    fit: str = "length",
    mirror: bool = False,
    reverse: bool = False,
) -> tuple[FaceBase, Ridge]:
    """face_base, without a look at whether the strip fits: it may fold, overlap itself or leave the face."""
    host = host_of(_face(face))
    if not isinstance(ridge, Ridge):
        raise ValueError(f"ridge: expected a Ridge, got {type(ridge).__name__}; register or load one first")
    fitted = mirrored(ridge) if mirror else ridge
    near = NEAR * float(np.median(ridge.width))
    if path is None:
        place = _place(host, at, near)
        curve = developed_path(host, fitted, place, _tangent(host, fitted, place, direction, reverse))
        curve = closed_path(host, curve, float(np.median(ridge.width))) if fitted.closed else curve
    elif at is not None or direction is not None:
        raise ValueError("expected either a path, or at and direction, got both; drop one")
    else:
        curve = projected_path(host, path, near, reverse)
        goal = min(ridge.length, curve.length) if fit == "trim" else curve.length
        fitted, curve = fitted.stretched(goal, fit), curve.cut(goal)
        fitted = joined(fitted) if curve.closed else fitted
    return FaceBase(host, curve, (fitted.arc_length, fitted.border)), fitted


def _face(shape: Any) -> TopoDS_Face:
    found = topods(shape)
    if found.ShapeType() == TopAbs_FACE:
        return TopoDS.Face_s(found)
    explorer, faces = TopExp_Explorer(found, TopAbs_FACE), []
    while explorer.More():
        faces.append(explorer.Current())
        explorer.Next()
    if len(faces) != 1:
        raise ValueError(
            f"face: expected one face, got a shape with {len(faces)}; select one, as .faces('>Z')"
        )
    return TopoDS.Face_s(faces[0])


def _place(host: Host, at: Any, near: float) -> Floats:
    """Parameters (2,) of where the middle of the ridge goes."""
    if at is None:
        return inner_point(host)
    point = vector(at, "at")
    x = nearest(host.face, host, point[None])[0]
    gap = float(np.linalg.norm(host.points(x[0], x[1]) - point))
    if not gap <= near:
        raise ValueError(
            f"at: expected a point within {near:g} of the face, a quarter of the ridge's width, got one "
            f"{gap:g} off; give a point on the face"
        )
    return x


def direction_at(face: Any, ridge: Ridge, at: Any) -> tuple[Floats, Floats]:
    """The direction (3,) that a ridge has on a face at a place (3,) unless another one is given, and the
    face's normal (3,) there."""
    host = host_of(_face(face))
    place = nearest(host.face, host, vector(at, "at")[None])[0]
    normal = host.frame(place[0], place[1])[1]
    return _own_direction(host, place, normal, _mean(ridge)[1]), normal


def _mean(ridge: Ridge) -> tuple[Floats, Floats, Floats]:
    """A ridge's mean direction, unrolled (2,) and in space (3,), in its middle where it has none; and the
    angles (k,) of its path, unrolled."""
    points, angles = developed(ridge)
    mean, chord = points[-1] - points[0], ridge.spine[-1] - ridge.spine[0]
    if np.linalg.norm(mean) < 0.1 * ridge.length:  # a ring or a spiral
        middle = len(ridge.arc_length) // 2
        mean, chord = np.array([np.cos(angles[middle]), np.sin(angles[middle])]), ridge.tangent[middle]
    return mean, chord, angles


def _own_direction(host: Host, place: Floats, normal: Floats, chord: Floats) -> Floats:
    along_face = chord - normal * (chord @ normal)
    if np.linalg.norm(along_face) < 0.5 * np.linalg.norm(chord):
        return longer_direction(host, place)
    return along_face


def _tangent(host: Host, ridge: Ridge, place: Floats, direction: Any, reverse: bool) -> Floats:
    """The path's tangent (3,) in the middle of the ridge, for its mean direction to lie along `direction`."""
    mean, chord, angles = _mean(ridge)
    normal = host.frame(place[0], place[1])[1]
    if direction is None:
        along_face = _own_direction(host, place, normal, chord)
    else:
        given = vector(direction, "direction")
        along_face = given - normal * (given @ normal)
        if not np.linalg.norm(along_face) > 1e-6 * np.linalg.norm(given):
            what = "one along the face's normal" if given.any() else "a zero vector"
            raise ValueError(f"direction: expected one along the face, got {what}; choose another")
    ahead = along_face / np.linalg.norm(along_face) * (-1 if reverse else 1)
    turn = float(np.interp(0.5 * ridge.length, ridge.arc_length, angles) - np.arctan2(mean[1], mean[0]))
    return np.cos(turn) * ahead + np.sin(turn) * np.cross(normal, ahead)


def vector(value: Any, name: str) -> Floats:
    """(3,) from numbers, a cq.Vector or anything with toTuple; ValueError unless they are three, finite."""
    raw = value.toTuple() if hasattr(value, "toTuple") else value
    try:
        array = np.asarray(raw, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise ValueError(f"{name}: expected three finite numbers, got {value!r}")
    return array
