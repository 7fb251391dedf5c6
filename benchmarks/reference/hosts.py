"""Surfaces that a reference ridge stands on: normals, normal curvature and geodesics, exact.

Lengths are in units of the ridge's largest foot width. Every host passes through the origin with its normal
along z there. A negative radius is the inside of a cylinder or of a sphere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Host(Protocol):
    """A smooth surface with one chart."""

    def normal(self, p: Array) -> Array:
        """Unit normals (n, 3) at points (n, 3) of the surface."""
        ...

    def bend(self, p: Array, t: Array) -> Array:
        """Normal curvature (n,) at p in unit tangent directions t (n, 3)."""
        ...

    def geodesic(self, p: Array, d: Array, y: Array) -> Array:
        """Ends (n, 3) of geodesics from p (n, 3) along unit d (n, 3), of signed length y (n,)."""
        ...

    def place(self, uv: Array) -> Array:
        """Points (n, 3) at chart coordinates (n, 2)."""
        ...

    def chart(self, p: Array) -> Array:
        """Chart coordinates (n, 2) of points (n, 3); of points beside the surface, those of one near by."""
        ...

    def stretch(self, uv: Array) -> Array:
        """Area on the surface by area in the chart (n,); 0 outside the chart."""
        ...


@dataclass(frozen=True)
class Plane:
    """The plane z = 0."""

    def normal(self, p: Array) -> Array:
        return np.tile([0.0, 0.0, 1.0], (len(p), 1))

    def bend(self, p: Array, t: Array) -> Array:
        return np.zeros(len(p))

    def geodesic(self, p: Array, d: Array, y: Array) -> Array:
        return p + y[:, None] * d

    def place(self, uv: Array) -> Array:
        return np.column_stack([uv, np.zeros(len(uv))])

    def chart(self, p: Array) -> Array:
        return p[:, :2]

    def stretch(self, uv: Array) -> Array:
        return np.ones(len(uv))


@dataclass(frozen=True)
class Cylinder:
    """A cylinder about an axis along x through (0, 0, -radius); its chart is the cylinder developed."""

    radius: float

    def _angle(self, p: Array) -> Array:
        r = self.radius
        return np.arctan2(p[:, 1] / r, (p[:, 2] + r) / r)

    def normal(self, p: Array) -> Array:
        angle = self._angle(p)
        return np.column_stack([0 * angle, np.sin(angle), np.cos(angle)])

    def _around(self, p: Array) -> Array:
        angle = self._angle(p)
        return np.column_stack([0 * angle, np.cos(angle), -np.sin(angle)])

    def bend(self, p: Array, t: Array) -> Array:
        return -((t * self._around(p)).sum(axis=1) ** 2) / self.radius

    def geodesic(self, p: Array, d: Array, y: Array) -> Array:
        step = np.column_stack([d[:, 0], (d * self._around(p)).sum(axis=1)])
        return self.place(self.chart(p) + y[:, None] * step)

    def place(self, uv: Array) -> Array:
        r, angle = self.radius, uv[:, 1] / self.radius
        return np.column_stack([uv[:, 0], r * np.sin(angle), r * (np.cos(angle) - 1)])

    def chart(self, p: Array) -> Array:
        return np.column_stack([p[:, 0], self.radius * self._angle(p)])

    def stretch(self, uv: Array) -> Array:
        return (np.abs(uv[:, 1]) < np.pi * abs(self.radius)).astype(np.float64)


@dataclass(frozen=True)
class Sphere:
    """A sphere about (0, 0, -radius); its chart is Lambert's azimuthal equal-area one about the origin."""

    radius: float

    def normal(self, p: Array) -> Array:
        out = (p + np.array([0.0, 0.0, self.radius])) / self.radius
        return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True))

    def bend(self, p: Array, t: Array) -> Array:
        return np.full(len(p), -1 / self.radius)

    def geodesic(self, p: Array, d: Array, y: Array) -> Array:
        turn = (y / self.radius)[:, None]
        return p + self.radius * ((np.cos(turn) - 1) * self.normal(p) + np.sin(turn) * d)

    def place(self, uv: Array) -> Array:
        r = self.radius
        square = (uv * uv).sum(axis=1)
        root = np.sqrt(np.maximum(1 - square / (4 * r * r), 0.0))
        return np.column_stack([uv * root[:, None], -square / (2 * r)])

    def chart(self, p: Array) -> Array:
        n = self.normal(p)
        return np.asarray(self.radius * n[:, :2] * np.sqrt(2 / np.maximum(1 + n[:, 2:], 1e-12)))

    def stretch(self, uv: Array) -> Array:
        return ((uv * uv).sum(axis=1) < 3.6 * self.radius**2).astype(np.float64)


@dataclass(frozen=True)
class Saddle:
    """z = (y^2 - x^2) / (2 radius); its chart is x, y. Geodesics are integrated (Runge-Kutta, order 4)."""

    radius: float
    steps: int = 24

    def normal(self, p: Array) -> Array:
        out = np.column_stack([p[:, 0] / self.radius, -p[:, 1] / self.radius, np.ones(len(p))])
        return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True))

    def bend(self, p: Array, t: Array) -> Array:
        slope = (p[:, 0] ** 2 + p[:, 1] ** 2) / self.radius**2
        return (t[:, 1] ** 2 - t[:, 0] ** 2) / (self.radius * np.sqrt(1 + slope))

    def geodesic(self, p: Array, d: Array, y: Array) -> Array:
        h = (y / self.steps)[:, None]

        def force(q: Array, v: Array) -> Array:
            return np.asarray(self.bend(q, v)[:, None] * self.normal(q))

        for _ in range(self.steps):
            a1 = force(p, d)
            a2 = force(p + 0.5 * h * d, d + 0.5 * h * a1)
            a3 = force(p + 0.5 * h * d + 0.25 * h * h * a1, d + 0.5 * h * a2)
            a4 = force(p + h * d + 0.5 * h * h * a2, d + h * a3)
            p = p + h * d + h * h / 6 * (a1 + a2 + a3)
            d = d + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        return self.place(p[:, :2])

    def place(self, uv: Array) -> Array:
        x, y = uv.T
        return np.column_stack([x, y, (y * y - x * x) / (2 * self.radius)])

    def chart(self, p: Array) -> Array:
        return p[:, :2]

    def stretch(self, uv: Array) -> Array:
        return np.sqrt(1 + (uv * uv).sum(axis=1) / self.radius**2)
