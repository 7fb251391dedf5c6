"""Synthetic scans with known answers, for the demo, the examples, the tests and the benchmarks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ridgefeature.section import bell

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spiral:
    """A ridge along a circle on the plane z = 0, height and width falling linearly along it.

    The paper's first experiment. Lengths in one unit; the circle's centre is the origin; the ridge starts at
    angle 0 and runs counter-clockwise; `section` maps y / width to height over the apex height. Both ends are
    rounded: the section turned about the end point.
    """

    radius: float = 30.0
    turns: float = 0.9
    heights: tuple[float, float] = (6.0, 1.0)
    widths: tuple[float, float] = (12.0, 5.0)
    region: float = 100.0
    section: Callable[[Array], Array] = field(default_factory=bell)
    rounded: bool = False

    @property
    def arc_length(self) -> float:
        """Arc length of the whole path."""
        return 2 * np.pi * self.turns * self.radius

    def height(self, s: Array) -> Array:
        """Apex height at arc length s."""
        return np.interp(s, [0, self.arc_length], self.heights)

    def width(self, s: Array) -> Array:
        """Width between the feet at arc length s."""
        return np.interp(s, [0, self.arc_length], self.widths)

    def spine(self, s: Array) -> Array:
        """Points (..., 3) of the path at arc length s."""
        angle = np.asarray(s) / self.radius
        return np.stack([self.radius * np.cos(angle), self.radius * np.sin(angle), 0 * angle], -1)

    def path_coordinates(self, xy: Array) -> tuple[Array, Array]:
        """Arc length (may lie beyond both ends) and distance to the left of the path for points (n, 2)."""
        total = self.arc_length
        angle = np.arctan2(xy[:, 1], xy[:, 0]) % (2 * np.pi)
        s = angle * self.radius
        gap = 2 * np.pi * self.radius - total
        s = np.where(s > total + gap / 2, s - 2 * np.pi * self.radius, s)
        return s, self.radius - np.hypot(xy[:, 0], xy[:, 1])

    def elevation(self, xy: Array) -> Array:
        """Height of the surface over the plane at points (n, 2)."""
        s, y = self.path_coordinates(xy)
        inside = np.clip(s, 0.0, self.arc_length)
        on_path = s == inside
        if self.rounded:
            beyond = np.hypot(*(xy - self.spine(inside)[:, :2]).T)
            y = np.where(on_path, y, beyond)
            on_path = np.ones_like(on_path)
        return np.where(on_path, self.height(inside) * self.section(y / self.width(inside)), 0.0)

    def points(self, n: int, noise: float = 0.0, outliers: float = 0.0, seed: int = 0) -> Array:
        """n unordered points (n, 3), uniform at random over the region.

        noise: standard deviation, the same in x, y and z. outliers: share of points drawn instead from a box
        three times the largest height tall, centred on half the largest height.
        """
        random = np.random.default_rng(seed)
        xy = random.uniform(-self.region / 2, self.region / 2, (n, 2))
        points = np.column_stack([xy, self.elevation(xy)])
        if noise > 0:
            points += random.normal(0.0, noise, points.shape)
        strays = round(outliers * n)
        if strays:
            tallest = max(self.heights)
            points[:strays, 2] = random.uniform(-tallest, 2 * tallest, strays)
        return points[random.permutation(n)]
