"""A reference ridge as functions: spine, height, widths, ends, and the surface itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from reference.hosts import Array, Host
from reference.paths import Path
from reference.sections import Profile

SEEN = 30.0
"""Evidence of a stretch one width long and 1.6 wide from which on a fading end counts as visible."""


@dataclass(frozen=True)
class Wave:
    """size (1 + swing sin(2 pi (s / length + phase))): how a height or a width varies along a ridge."""

    size: float
    swing: float = 0.0
    length: float = 1.0
    phase: float = 0.0

    def __call__(self, s: Array) -> Array:
        return self.size * (1 + self.swing * np.sin(2 * np.pi * (np.asarray(s) / self.length + self.phase)))


@dataclass(frozen=True, eq=False)
class Pose:
    """From the host's frame, in largest foot widths, to the scan's: scale * rotation @ p + shift."""

    rotation: Array
    shift: Array
    scale: float

    def points(self, p: Array) -> Array:
        return self.scale * p @ self.rotation.T + self.shift

    def directions(self, d: Array) -> Array:
        return d @ self.rotation.T

    def back(self, p: Array) -> Array:
        return (p - self.shift) @ self.rotation / self.scale


@dataclass(frozen=True, eq=False)
class Truth:
    """The exact answer. All methods take and give the scan's unit and frame; s (k,) is arc length from 0.

    The path is the middle between the feet; `spine` lies under the apex, which for four of the five sections
    is the same. `fades` are the lengths over which the height sinks to 0 at either end, 0: abrupt; `ends`
    says "abrupt", "fading", "border" (there the data end too) or "none" (closed). `visible` is the stretch
    that a method is expected to find. A negative height is a groove.
    """

    path: Path
    section: Profile
    heights: Wave
    widths: Wave
    pose: Pose
    ends: tuple[str, str] = ("abrupt", "abrupt")
    fades: tuple[float, float] = (0.0, 0.0)
    visible: tuple[float, float] = (0.0, 0.0)

    @property
    def closed(self) -> bool:
        return self.path.bends.closed

    @property
    def base(self) -> Host:
        """The host, in its own frame: `pose` takes it to the scan's."""
        return self.path.host

    @property
    def length(self) -> float:
        return self.path.bends.length * self.pose.scale

    def height(self, s: Array) -> Array:
        """(k,) apex over the base."""
        x = np.asarray(s, dtype=np.float64) / self.pose.scale
        return self.pose.scale * self.heights(x) * self._fade(x)

    def _fade(self, x: Array) -> Array:
        factor = np.ones_like(x)
        for fade, beyond in zip(self.fades, (x, self.path.bends.length - x), strict=True):
            if fade:
                u = np.clip(beyond / fade, 0.0, 1.0)
                factor = factor * u**3 * (10 - 15 * u + 6 * u * u)
        return factor

    def width(self, s: Array) -> Array:
        """(k,) between the feet, along the geodesic square to the path."""
        return self.pose.scale * self.widths(np.asarray(s, dtype=np.float64) / self.pose.scale)

    def half_height_width(self, s: Array) -> Array:
        """(k,) full width at half height, measured as the width."""
        return self.section.half_height_width * self.width(s)

    def path_points(self, s: Array) -> Array:
        """(k, 3) the middle between the feet."""
        return self.pose.points(self.path.frames(np.asarray(s) / self.pose.scale)[0])

    def spine(self, s: Array) -> Array:
        """(k, 3) on the base, under the apex."""
        return self.pose.points(self._spine(s)[0])

    def frame(self, s: Array) -> tuple[Array, Array, Array]:
        """Unit tangent, left and normal (k, 3) of the path."""
        _, t, n = self.path.frames(np.asarray(s) / self.pose.scale)
        return tuple(self.pose.directions(d) for d in (t, np.cross(n, t), n))  # type: ignore[return-value]

    def _spine(self, s: Array) -> tuple[Array, Array]:
        s = np.asarray(s, dtype=np.float64)
        x = s / self.pose.scale
        return self.path.fermi(x, self.section.apex * self.widths(x))

    def surface(self, s: Array, y: Array) -> Array:
        """(k, 3) points of the true surface at s (k,) and distances y (k,) from the path; flat beside it."""
        x = np.asarray(s, dtype=np.float64) / self.pose.scale
        p, n = self.path.fermi(x, np.asarray(y) / self.pose.scale)
        return self.pose.points(p + self.elevation(x, np.asarray(y) / self.pose.scale)[:, None] * n)

    def elevation(self, x: Array, y: Array) -> Array:
        """Height over the host (k,), all in the host's unit; 0 beyond the ends and the feet."""
        on = np.ones_like(x, dtype=bool) if self.closed else (x >= 0) & (x <= self.path.bends.length)
        return np.where(on, self.heights(x) * self._fade(x) * self.section(y / self.widths(x)), 0.0)

    def nearest(self, points: Array, step: float = 0.01) -> tuple[Array, Array]:
        """s (n,) of the nearest place of the spine between its ends, and offsets (n, 3) from there.

        By a spine sampled every `step` largest widths, then by its tangent.
        """
        s = np.linspace(0.0, self.length, int(self.path.bends.length / step) + 2)
        spine = self.spine(s)
        _, nearest = cKDTree(spine).query(points)
        at = s[nearest]
        gap = s[1]
        for _ in range(2):
            ahead = (self.spine(at + 1e-4 * gap) - self.spine(at - 1e-4 * gap)) / (2e-4 * gap)
            slide = ((points - self.spine(at)) * ahead).sum(axis=1) / (ahead**2).sum(axis=1)
            at = at + np.clip(slide, -gap, gap)
            at = np.mod(at, self.length) if self.closed else np.clip(at, 0.0, self.length)
        return at, points - self.spine(at)


def seen(truth: Truth, noise: float, spacing: float) -> tuple[float, float]:
    """The stretch that statistics can tell from no ridge; noise and spacing in the host's unit.

    All of it where no end fades. Else a stretch one width long is seen where points of this spacing and noise
    give twice the log likelihood ratio against a plane of at least SEEN, and where the height is at least 2 %
    of the largest.
    """
    s = np.linspace(0.0, truth.length, 2001)
    x = s / truth.pose.scale
    eta = np.linspace(-0.8, 0.8, 1601)
    f = truth.section(eta)
    columns = np.stack([np.ones_like(eta), eta], axis=1)
    variance = float(np.mean((f - columns @ np.linalg.lstsq(columns, f, rcond=None)[0]) ** 2))
    height = np.abs(truth.height(s)) / truth.pose.scale
    points = 1.6 * truth.widths(x) ** 2 / spacing**2
    good = height >= 0.02 * height.max()
    if noise > 0:
        good &= points * variance * (height / noise) ** 2 >= SEEN
    on = s[good]
    low = float(on[0]) if truth.fades[0] else 0.0
    high = float(on[-1]) if truth.fades[1] else truth.length
    return low, high
