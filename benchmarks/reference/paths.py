"""Paths on a host by their geodesic curvature, and Fermi coordinates (s, y) about them.

s is arc length along the path; y is the length of the geodesic that leaves the path square to it, positive to
its left. Lengths are in units of the ridge's largest foot width.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.integrate import OdeSolution, solve_ivp
from scipy.spatial import cKDTree

from reference.hosts import Array, Host

KINK_RADIUS = 0.6
"""Radius of a kink: no less, so that no foot lies beyond the centre of the bend."""
BEYOND = 0.8
"""How far the path is continued straight beyond both ends of the ridge, to tell what lies beside it."""
_FINE = 0.02
FAR = 1.2
"""Points further from the path have no coordinates about it."""


@dataclass(frozen=True)
class Bends:
    """Geodesic curvature (k,) by arc length (k,), smooth between `breaks`; closed: of period `length`."""

    length: float
    curvature: Callable[[Array], Array]
    breaks: tuple[float, ...] = ()
    closed: bool = False


def straight(length: float) -> Bends:
    return Bends(length, lambda s: 0.0 * s)


def winding(length: float, swing: float) -> Bends:
    """An S: it turns by `swing` radians, and back."""
    return Bends(length, lambda s: swing * np.pi / length * np.sin(2 * np.pi * s / length))


def spiral(start: float, end: float, pitch: float, side: float) -> Bends:
    """Radius of curvature from `start` down to `end`; its windings lie about `pitch` apart."""
    rate = pitch / np.pi
    length = (start**2 - end**2) / rate
    return Bends(length, lambda s: side / np.sqrt(np.clip(start**2 - rate * s, end**2, start**2)))


def kink(length: float, at: float, angle: float) -> Bends:
    """Two straight legs; the path turns by `angle` radians from arc length `at` on."""
    far = at + KINK_RADIUS * abs(angle)
    return Bends(length, lambda s: np.sign(angle) / KINK_RADIUS * ((s > at) & (s < far)), (at, far))


def ring(radius: float, oval: float = 0.0) -> Bends:
    """Closed on a plane and on a cylinder; radius of curvature radius (1 + oval cos 2 angle)."""
    length = 2 * np.pi * radius

    def curvature(s: Array) -> Array:
        s = np.asarray(s, dtype=np.float64)
        angle = s / radius
        for _ in range(8):
            turned = angle + 0.5 * oval * np.sin(2 * angle) - s / radius
            angle = angle - turned / (1 + oval * np.cos(2 * angle))
        return np.asarray(1 / (radius * (1 + oval * np.cos(2 * angle))))

    return Bends(length, curvature, closed=True)


def small_circle(radius: float, sphere: float) -> Bends:
    """A circle of a radius about an axis through a sphere's centre."""
    curvature = np.sqrt(1 / radius**2 - 1 / sphere**2)
    return Bends(2 * np.pi * radius, lambda s: curvature + 0.0 * s, closed=True)


@dataclass(frozen=True, eq=False)
class Path:
    """A path on a host, the middle of its length at the origin, where it runs along `heading` radians."""

    host: Host
    bends: Bends
    heading: float = 0.0
    pieces: list[tuple[float, float, OdeSolution]] = field(init=False, repr=False)
    places: Array = field(init=False, repr=False)
    fine: tuple[Array, Array, Array] = field(init=False, repr=False)
    tree: cKDTree = field(init=False, repr=False)

    def __post_init__(self) -> None:
        beyond = 0.0 if self.bends.closed else BEYOND
        low, high = -beyond, self.bends.length + beyond
        middle = 0.5 * self.bends.length
        start = np.array([0.0, 0.0, 0.0, np.cos(self.heading), np.sin(self.heading), 0.0])
        stops = sorted({low, high, 0.0, self.bends.length, *self.bends.breaks})
        after = self._integrated(start, [middle, *(x for x in stops if x > middle)])
        before = self._integrated(start, [middle, *(x for x in reversed(stops) if x < middle)])
        object.__setattr__(self, "pieces", sorted([*before, *after], key=lambda piece: piece[0]))
        places = np.linspace(low, high, int((high - low) / _FINE) + 2)
        object.__setattr__(self, "places", places)
        object.__setattr__(self, "fine", self.frames(places))
        object.__setattr__(self, "tree", cKDTree(self.fine[0]))

    def _integrated(self, state: Array, stops: list[float]) -> list[tuple[float, float, OdeSolution]]:
        pieces = []
        for a, b in pairwise(stops):
            inside = (min(a, b), max(a, b))
            within = self.bends.closed or 0 <= 0.5 * (a + b) <= self.bends.length

            def rate(
                s: float, q: Array, inside: tuple[float, float] = inside, within: bool = within
            ) -> Array:
                p, t = q[None, :3], q[None, 3:]
                n = self.host.normal(p)
                # A step may look just beyond a break; what holds there is the limit from inside.
                at = np.clip(s, inside[0] + 1e-9, inside[1] - 1e-9)
                turn = self.bends.curvature(np.array([at])) if within else np.zeros(1)
                pull = turn[:, None] * np.cross(n, t) + self.host.bend(p, t)[:, None] * n
                return np.concatenate([t[0], pull[0]])

            done = solve_ivp(
                rate, (a, b), state, "DOP853", rtol=1e-12, atol=1e-12, dense_output=True, max_step=0.5
            )
            pieces.append((*inside, done.sol))
            state = done.y[:, -1]
        return pieces

    def frames(self, s: Array) -> tuple[Array, Array, Array]:
        """Points, unit tangents and unit normals (k, 3) at arc lengths (k,), exactly on the host.

        Arc lengths may lie up to BEYOND off the ends; on a closed path they may be any.
        """
        s = np.mod(s, self.bends.length) if self.bends.closed else s
        states = np.empty((len(s), 6))
        for k, (low, high, solution) in enumerate(self.pieces):
            on = (s >= low if k else s >= -np.inf) & (s < high if k < len(self.pieces) - 1 else s < np.inf)
            if on.any():
                states[on] = solution(np.clip(s[on], low, high)).T
        p = self.host.place(self.host.chart(states[:, :3]))
        n = self.host.normal(p)
        t = states[:, 3:] - n * (n * states[:, 3:]).sum(axis=1, keepdims=True)
        return p, np.asarray(t / np.linalg.norm(t, axis=1, keepdims=True)), n

    def curvature(self, s: Array) -> Array:
        """Geodesic curvature (k,); 0 beyond the ends."""
        if self.bends.closed:
            return np.asarray(self.bends.curvature(np.mod(s, self.bends.length)))
        on = (s >= 0) & (s <= self.bends.length)
        return np.where(on, self.bends.curvature(np.clip(s, 0, self.bends.length)), 0.0)

    def fermi(self, s: Array, y: Array) -> tuple[Array, Array]:
        """Points and unit normals (k, 3) of the host at s (k,), y (k,): exact."""
        p, t, n = self.frames(s)
        p = self.host.geodesic(p, np.cross(n, t), y)
        return p, self.host.normal(p)

    def coordinates(self, points: Array) -> tuple[Array, Array]:
        """s and y (n,) of points (n, 3) near the host, within some per cent: exact places come from `fermi`.

        s from the nearest of many frames and its tangent, y from the chord; y is inf beyond FAR and off
        both ends.
        """
        p, t, n = self.fine
        away, nearest = self.tree.query(points, distance_upper_bound=FAR)
        y = np.full(len(points), np.inf)
        s = np.full(len(points), np.nan)
        on = np.isfinite(away)
        k = nearest[on]
        offset = points[on] - p[k]
        side = (offset * np.cross(n[k], t[k])).sum(axis=1)
        ahead = (offset * t[k]).sum(axis=1) / np.clip(1 - self.curvature(self.places[k]) * side, 0.3, 3.0)
        s[on] = self.places[k] + ahead
        y[on] = np.copysign(np.sqrt(np.maximum(away[on] ** 2 - ahead**2, 0.0)), side)
        off = (s < self.places[0]) | (s > self.places[-1])
        if not self.bends.closed:
            s[off], y[off] = np.nan, np.inf
        return s, y

    def clear(self, distance: float, along: float) -> bool:
        """Whether places more than `along` apart in arc length lie at least `distance` apart."""
        pairs = self.tree.query_pairs(distance, output_type="ndarray")
        apart = np.abs(np.diff(self.places[pairs], axis=1))
        if self.bends.closed:
            apart = np.minimum(apart, self.bends.length - apart)
        return not bool((apart > along).any())
