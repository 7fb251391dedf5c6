"""Synthetic scans of ridges along any path in the plane, closed or not, on a plane or a round base."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from ridgefeature.section import bell


@dataclass(frozen=True, eq=False)
class Scene:
    """A ridge along a polyline `path` (m, 2), dense; heights and widths by the share of its length, 0 to 1.

    ends: how a ridge that is open ends, "abrupt" or "rounded".
    """

    path: np.ndarray
    closed: bool = True
    height: Callable[[np.ndarray], np.ndarray] = lambda u: 3.0 + 0 * u
    width: Callable[[np.ndarray], np.ndarray] = lambda u: 8.0 + 0 * u
    ends: str = "abrupt"
    margin: float = 12.0
    lift: Callable[[np.ndarray], np.ndarray] | None = None
    """Maps (x, y, elevation) (n, 3) to points in space."""
    arc: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        steps = np.linalg.norm(np.diff(self.path, axis=0), axis=1)
        object.__setattr__(self, "arc", np.concatenate([[0.0], np.cumsum(steps)]))

    @property
    def length(self) -> float:
        return float(self.arc[-1])

    @property
    def true_length(self) -> float:
        """Length of the path in space."""
        flat = np.column_stack([self.path, np.zeros(len(self.path))])
        line = flat if self.lift is None else self.lift(flat)
        return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())

    def share(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Share of the length of the nearest place of the path, and the distance from it."""
        distance, i = cKDTree(self.path).query(xy)
        return self.arc[i] / self.length, distance

    def elevation(self, xy: np.ndarray) -> np.ndarray:
        u, y = self.share(xy)
        z = self.height(u) * bell()(y / self.width(u))
        if not self.closed and self.ends == "abrupt":
            first, last = self.path[0], self.path[-1]
            before = (xy - first) @ (self.path[1] - first) < 0
            behind = (xy - last) @ (last - self.path[-2]) > 0
            z = np.where(((u == 0) & before) | ((u == 1) & behind), 0.0, z)
        return z

    def points(self, n: int, noise: float, seed: int, outliers: float = 0.0) -> np.ndarray:
        random = np.random.default_rng(seed)
        low, high = self.path.min(axis=0) - self.margin, self.path.max(axis=0) + self.margin
        xy = random.uniform(low, high, (n, 2))
        points = np.column_stack([xy, self.elevation(xy)])
        points = points if self.lift is None else self.lift(points)
        points += random.normal(0.0, noise, points.shape)
        strays = round(outliers * n)
        points[:strays, 2] += random.uniform(-6, 6, strays)
        return points

    def pick(self, u: float) -> np.ndarray:
        """The point of the crest at a share of the length."""
        xy = np.array([np.interp(u * self.length, self.arc, c) for c in self.path.T])
        at = np.array([[*xy, float(self.height(np.array(u)))]])
        return (at if self.lift is None else self.lift(at))[0]


def sampled(curve: Callable[[np.ndarray], np.ndarray], low: float, high: float, n: int = 4000) -> np.ndarray:
    """(n, 2) points of a curve t -> (n, 2)."""
    return curve(np.linspace(low, high, n))


def circle(radius: float, gap: float = 0.0) -> np.ndarray:
    """A circle about the origin, or an arc that lacks `gap` of its length at angle 0."""
    half = 0.5 * gap / radius
    return sampled(lambda t: radius * np.stack([np.cos(t), np.sin(t)], -1), half, 2 * np.pi - half)


def ellipse(a: float, b: float) -> np.ndarray:
    return sampled(lambda t: np.stack([a * np.cos(t), b * np.sin(t)], -1), 0, 2 * np.pi)


def rounded_rectangle(a: float, b: float, r: float) -> np.ndarray:
    """Half sizes a and b, corners of radius r; it starts in the middle of the right side."""
    corners = [(a - r, b - r, 0), (r - a, b - r, 1), (r - a, r - b, 2), (a - r, r - b, 3)]
    t = np.linspace(0, np.pi / 2, 60)
    arcs = [
        np.stack([x + r * np.cos(t + q * np.pi / 2), y + r * np.sin(t + q * np.pi / 2)], -1)
        for x, y, q in corners
    ]
    return evenly(np.vstack([[[a, 0.0]], *arcs, [[a, 0.0]]]))


def evenly(line: np.ndarray, n: int = 4000) -> np.ndarray:
    """A polyline (m, 2) resampled at n even places."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    return np.stack([np.interp(np.linspace(0, s[-1], n), s, c) for c in line.T], -1)


def u_turn(leg: float, apart: float) -> np.ndarray:
    """Two parallel legs whose spines lie `apart`, joined by half a circle."""
    t = np.linspace(-np.pi / 2, np.pi / 2, 200)
    bend = 0.5 * apart * np.stack([np.cos(t), np.sin(t)], -1)
    return evenly(np.vstack([[[-leg, -0.5 * apart]], bend, [[-leg, 0.5 * apart]]]))


def inward_spiral(radius: float, step: float, turns: float) -> np.ndarray:
    """A spiral whose radius falls by `step` a turn."""

    def curve(t: np.ndarray) -> np.ndarray:
        r = radius - step * t / (2 * np.pi)
        return np.stack([r * np.cos(t), r * np.sin(t)], -1)

    return evenly(sampled(curve, 0, 2 * np.pi * turns))
