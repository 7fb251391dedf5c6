"""Colours of scan points: by height over their best plane, by deviation from a ridge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]
_GREY = 190
_RAMP = ((68, 1, 84), (49, 104, 142), (53, 183, 121), (253, 231, 37))
_SIGNED = ((33, 72, 170), (120, 160, 230), (225, 225, 225), (236, 140, 100), (170, 30, 30))


def by_height(points: Array) -> Pixels:
    """Colours (n, 3) by height over the plane of least squares, from the lowest to the highest 1 %."""
    return ramp((points - points.mean(axis=0)) @ plane_axes(points)[2])


def plane_axes(points: Array) -> Array:
    """(3, 3) rows: along the longest way of points, across, and the normal of their best plane, upwards.

    Upwards is where its largest coordinate is positive.
    """
    centred = points - points.mean(axis=0)
    vectors = np.linalg.eigh(centred.T @ centred)[1]
    normal, along = vectors[:, 0], vectors[:, 2]
    normal, along = (v * (np.sign(v[np.argmax(np.abs(v))]) or 1.0) for v in (normal, along))
    return np.array([along, np.cross(normal, along), normal])


def ramp(values: Array) -> Pixels:
    """Colours (n, 3) from violet over green to yellow, from the lowest to the highest 1 %; grey where NaN."""
    known = values[np.isfinite(values)]
    low, high = np.quantile(known, [0.01, 0.99]) if len(known) else (0.0, 1.0)
    return _blended(values, low, high, _RAMP)


def by_deviation(values: Array) -> Pixels:
    """Colours (n, 3) of signed distances: blue below, red above, to three robust deviations; NaN is grey."""
    known = values[np.isfinite(values)]
    far = 3.0 * 1.4826 * float(np.median(np.abs(known))) if len(known) else 1.0
    return _blended(values, -far, far, _SIGNED)


def _blended(values: Array, low: float, high: float, stops: tuple[tuple[int, int, int], ...]) -> Pixels:
    out = np.full((len(values), 3), _GREY, dtype=np.uint8)
    known = np.isfinite(values)
    part = np.clip((values[known] - low) / max(high - low, 1e-300), 0.0, 1.0)
    at = np.linspace(0.0, 1.0, len(stops))
    for k, column in enumerate(np.array(stops, dtype=float).T):
        out[known, k] = np.interp(part, at, column).round().astype(np.uint8)
    return out
