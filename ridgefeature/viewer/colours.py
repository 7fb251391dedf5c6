"""Colours of scan points: by height over their best plane, by deviation from a ridge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]
_GREY = 190
_ALONG_X = 0.9
_RAMP = ((68, 1, 84), (49, 104, 142), (53, 183, 121), (253, 231, 37))
_SIGNED = ((33, 72, 170), (120, 160, 230), (225, 225, 225), (236, 140, 100), (170, 30, 30))


@dataclass(frozen=True)
class Colouring:
    """Colours (n, 3) of points, and what they mean: values from low to high, along stops."""

    pixels: Pixels
    low: float
    high: float
    stops: tuple[tuple[int, int, int], ...]

    @property
    def gradient(self) -> str:
        """The stops, as CSS has a gradient."""
        return f"linear-gradient(to right, {', '.join(f'rgb{stop}' for stop in self.stops)})"


def by_height(points: Array) -> Colouring:
    """By height over the plane of least squares, from the lowest to the highest 1 %."""
    return ramp((points - points.mean(axis=0)) @ plane_axes(points)[2])


def plane_axes(points: Array) -> Array:
    """(3, 3) rows: along x as far as that lies in the best plane of points, across, and the plane's normal.

    Its largest coordinate is positive. Where it runs along x, y takes the place of x.
    """
    centred = points - points.mean(axis=0)
    normal = np.linalg.eigh(centred.T @ centred)[1][:, 0]
    normal = normal * (np.sign(normal[np.argmax(np.abs(normal))]) or 1.0)
    along = np.eye(3)[int(abs(normal[0]) > _ALONG_X)]
    along = along - (along @ normal) * normal
    along /= np.linalg.norm(along)
    return np.array([along, np.cross(normal, along), normal])


def ramp(values: Array) -> Colouring:
    """From violet over green to yellow, from the lowest to the highest 1 %; grey where NaN."""
    known = values[np.isfinite(values)]
    low, high = np.quantile(known, [0.01, 0.99]) if len(known) else (0.0, 1.0)
    return _blended(values, float(low), float(high), _RAMP)


def by_deviation(values: Array) -> Colouring:
    """Of signed distances: blue below, red above, to three robust deviations; grey where NaN."""
    known = values[np.isfinite(values)]
    far = 3.0 * 1.4826 * float(np.median(np.abs(known))) if len(known) else 1.0
    return _blended(values, -far, far, _SIGNED)


def _blended(values: Array, low: float, high: float, stops: tuple[tuple[int, int, int], ...]) -> Colouring:
    out = np.full((len(values), 3), _GREY, dtype=np.uint8)
    known = np.isfinite(values)
    part = np.clip((values[known] - low) / max(high - low, 1e-300), 0.0, 1.0)
    at = np.linspace(0.0, 1.0, len(stops))
    for k, column in enumerate(np.array(stops, dtype=float).T):
        out[known, k] = np.interp(part, at, column).round().astype(np.uint8)
    return Colouring(out, low, high, stops)
