"""Bases: what a ridge stands on, as maps (s, y) to points and normals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ridgefeature.merge import along
from ridgefeature.stations import Stations, unit

Array = NDArray[np.float64]


@runtime_checkable
class Base(Protocol):
    """A map (s, y) to points and unit normals of what a ridge stands on.

    s is arc length along the path, from 0 to `length`; y the distance from the path within the base,
    positive to its left, which is normal x tangent. `closed`: s = length is s = 0 again.
    Called with s (k,) and y (k, m), it returns points (k, m, 3) and unit normals (k, m, 3).
    """

    @property
    def length(self) -> float: ...

    @property
    def closed(self) -> bool: ...

    def __call__(self, s: Array, y: Array) -> tuple[Array, Array]: ...


@dataclass(frozen=True, eq=False)
class RuledBase:
    """Rules square to a path: the base of stations as they were registered; flat on a flat path.

    arc_length (k,) even from 0; spine (k, 3); tangent and normal (k, 3) unit and square to each other;
    curvature (k,) of the rules, which are arcs of circles, straight where it is 0 or not given.
    Between stations all of them are C2 splines, closed: periodic ones.
    """

    arc_length: Array
    spine: Array
    tangent: Array
    normal: Array
    closed: bool = False
    curvature: Array | None = None

    @property
    def length(self) -> float:
        """Arc length of the path."""
        return float(self.arc_length[-1])

    def __call__(self, s: Array, y: Array) -> tuple[Array, Array]:
        """Points and unit normals (k, m, 3) at s (k,), y (k, m)."""
        spine, left, normal, curvature = self.frames(s)
        if curvature.any():
            return self._arcs(spine, left, normal, curvature[:, None], y)
        points = spine[:, None] + y[..., None] * left[:, None]
        return points, np.broadcast_to(normal[:, None], points.shape)

    def frames(self, s: Array) -> tuple[Array, Array, Array, Array]:
        """Spine, unit vectors to the left and along the normal (k, 3 each), and curvature (k,), at s (k,)."""
        spread = along(self.arc_length, np.eye(len(self.arc_length)), s, closed=self.closed)
        left = unit(spread @ np.cross(self.normal, self.tangent))
        curvature = np.zeros(len(s)) if self.curvature is None else spread @ self.curvature
        return spread @ self.spine, left, unit(spread @ self.normal), curvature

    @staticmethod
    def _arcs(spine: Array, left: Array, normal: Array, curvature: Array, y: Array) -> tuple[Array, Array]:
        """Points and unit normals (k, m, 3) at y (k, m) along circles of curvature (k, 1)."""
        angle = curvature * y
        sideways, half = y * np.sinc(angle / np.pi), np.sinc(0.5 * angle / np.pi)
        rise = 0.5 * y * angle * half * half
        left, normal = left[:, None], normal[:, None]
        points = spine[:, None] + sideways[..., None] * left + rise[..., None] * normal
        return points, np.cos(angle)[..., None] * normal - np.sin(angle)[..., None] * left


def registered_base(stations: Stations) -> RuledBase:
    """The base that a ridge was registered on."""
    closed = bool(getattr(stations, "closed", False)) and np.array_equal(
        stations.spine[0], stations.spine[-1]
    )
    return RuledBase(
        stations.arc_length,
        stations.spine,
        stations.tangent,
        stations.normal,
        closed,
        curvature=stations.curvature,
    )


def geodesic_curvature(stations: Stations, at: Array | None = None) -> Array:
    """Curvature of the path within its base at the stations or at arc lengths (m,), positive to the left."""
    s = stations.arc_length if at is None else at
    spread = [along(stations.arc_length, x, s) for x in (stations.tangent, stations.normal)]
    tangent, normal = (unit(x) for x in spread)
    turn = along(stations.arc_length, stations.tangent, s, derivative=1)
    return np.asarray((np.cross(normal, tangent) * turn).sum(axis=1), dtype=np.float64)


def developed(stations: Stations, per_station: int = 8) -> tuple[Array, Array]:
    """The path unrolled to a plane by its geodesic curvature: points (k, 2) and tangent angles (k,).

    It starts at the origin along x. Angle and points by Simpson's rule on `per_station` parts of a step.
    """
    s = stations.arc_length
    fine = np.linspace(0.0, s[-1], 4 * per_station * (len(s) - 1) + 1)
    angle = _integral(geodesic_curvature(stations, fine), fine[1])
    points = _integral(np.stack([np.cos(angle), np.sin(angle)], axis=1), 2 * fine[1])
    return points[::per_station], angle[:: 2 * per_station]


def plane_base(
    stations: Stations,
    origin: ArrayLike = (0, 0, 0),
    direction: ArrayLike = (1, 0, 0),
    normal: ArrayLike = (0, 0, 1),
) -> RuledBase:
    """The plane through `origin` with the ridge's path developed on it, its start along `direction`.

    direction and normal (3,) of any length; the direction is laid into the plane. Raises ValueError where
    they are not finite, zero, or along each other.
    """
    o, x, z = (_vector(a, n) for a, n in ((origin, "origin"), (direction, "direction"), (normal, "normal")))
    if not np.linalg.norm(z) > 0:
        raise ValueError("normal: expected a vector that is not zero; give the plane's normal")
    z = unit(z)
    flat = x - z * (x @ z)
    if not np.linalg.norm(flat) > 1e-9 * np.linalg.norm(x):
        raise ValueError(f"direction: expected one across the normal, got {x.tolist()}; choose another")
    axes = np.stack([unit(flat), np.cross(z, unit(flat))])
    points, angle = developed(stations)
    tangent = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes
    return RuledBase(stations.arc_length, o + points @ axes, tangent, np.tile(z, (len(angle), 1)))


def _integral(values: Array, step: float) -> Array:
    """Integral up to every second place of values (2 n + 1, ...) at even places, by Simpson's rule."""
    pieces = step / 3 * (values[:-2:2] + 4 * values[1::2] + values[2::2])
    return np.concatenate([np.zeros_like(pieces[:1]), np.cumsum(pieces, axis=0)])


def _vector(value: ArrayLike, name: str) -> Array:
    vector = np.asarray(value, dtype=np.float64)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ValueError(f"{name}: expected three finite numbers, got {value!r}")
    return vector
