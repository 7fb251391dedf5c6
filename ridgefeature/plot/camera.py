"""Where to look at a ridge from: parallel projections framed on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ridgefeature.ridge import Ridge

Array = NDArray[np.float64]

_LONG = 2.2
"""A ridge at least this many times as long as broad, seen from above, is laid along the picture."""
_ELEVATION = np.radians(44.0)
_AZIMUTH = np.radians(18.0)


@dataclass(frozen=True)
class Camera:
    """A parallel projection. Unit axes (3,) in the scan's frame; `centre` is in the middle of the picture.

    half_width, half_height: what is seen to each side of the centre, in the scan's unit.
    """

    right: Array
    up: Array
    toward: Array
    centre: Array
    half_width: float
    half_height: float

    def project(self, points: Array) -> Array:
        """(..., 2): right and up of the centre, in the scan's unit."""
        offset = np.asarray(points) - self.centre
        return np.stack([offset @ self.right, offset @ self.up], axis=-1)


def is_long(ridge: Ridge) -> bool:
    """Whether the ridge, seen from above, is long rather than compact."""
    _, _, normal = _frame(ridge)
    spread = _spread(ridge, normal)
    return bool(spread[0][1] > _LONG * spread[1][1])


def from_above(ridge: Ridge, surface: Array, aspect: float) -> Camera:
    """Along the ridge's mean normal. surface (..., 3): what to frame; aspect: width / height."""
    return _framed(*_frame(ridge), surface, aspect)


def oblique(ridge: Ridge, surface: Array, aspect: float) -> Camera:
    """From above, in front and a little to the side."""
    right, up, normal = _frame(ridge)
    turn = 0.3 * _AZIMUTH if is_long(ridge) else _AZIMUTH
    right, back = np.cos(turn) * right + np.sin(turn) * up, np.cos(turn) * up - np.sin(turn) * right
    toward = np.sin(_ELEVATION) * normal - np.cos(_ELEVATION) * back
    return _framed(right, np.cross(toward, right), toward, surface, aspect)


def _frame(ridge: Ridge) -> tuple[Array, Array, Array]:
    """Right, up and normal: along a long ridge, from its start; else as the scan's x axis lies."""
    mean = ridge.normal.mean(axis=0)
    normal = (
        mean / np.linalg.norm(mean) if np.linalg.norm(mean) > 0.2 else ridge.normal[len(ridge.normal) // 2]
    )
    (long, a), (_, b) = _spread(ridge, normal)
    if a > _LONG * b:
        right = long if (ridge.spine[-1] - ridge.spine[0]) @ long >= 0 else -long
    else:
        axis = np.eye(3)[0 if abs(normal[0]) < 0.9 else 1]
        right = axis - normal * (axis @ normal)
        right /= np.linalg.norm(right)
    return right, np.cross(normal, right), normal


def _spread(ridge: Ridge, normal: Array) -> tuple[tuple[Array, float], tuple[Array, float]]:
    """The two directions square to the normal in which the spine is longest and shortest, and how long."""
    flat = ridge.spine - ridge.spine.mean(axis=0)
    flat = flat - np.outer(flat @ normal, normal)
    axes = np.linalg.svd(flat, full_matrices=False)[2]
    extent = [float(np.ptp(flat @ axis) + 2 * ridge.border.max()) for axis in axes[:2]]
    return (axes[0], extent[0]), (axes[1], extent[1])


def _framed(right: Array, up: Array, toward: Array, surface: Array, aspect: float) -> Camera:
    flat = surface.reshape(-1, 3)
    low, high = flat.min(axis=0), flat.max(axis=0)
    camera = Camera(right, up, toward, 0.5 * (low + high), 1.0, 1.0)
    seen = camera.project(flat)
    shift = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    half = 0.5 * np.ptp(seen, axis=0)
    half += 0.1 * half.max()
    half_height = max(half[1], half[0] / aspect)
    centre = camera.centre + shift[0] * right + shift[1] * up
    return Camera(right, up, toward, centre, half_height * aspect, half_height)
