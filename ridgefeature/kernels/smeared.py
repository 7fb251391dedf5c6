"""A section as noisy points show it: smeared, since their places across the ridge are as noisy as heights.

The mean height of the points seen at one y is that of the surface's points whose noise carries them there,
each weighted by how likely that is (Berkson's and classical errors in variables, Carroll et al. 2006, ch. 4).
Lengths are in widths, heights in apex heights.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.residual import INNER, OPTIONS, split

Floats = NDArray[np.float64]
Columns = tuple[Floats, Floats, Floats, Floats]
VALUE, RATE, SPREAD = range(3)


@njit(**INNER)
def _section_at(eta: float, own: Columns) -> tuple[float, float, float]:
    """Height of a section, its slope and second derivative."""
    constant, linear, quadratic, cubic = own
    spans = constant.size - 2.0
    position = min(max((eta + 0.5) * spans + 1.0, 0.5), spans + 1.5)
    span = np.int64(position)
    t = position - span
    p, q, r = linear[span], quadratic[span], cubic[span]
    return (
        constant[span] + t * (p + t * (q + t * r)),
        spans * (p + t * (2.0 * q + 3.0 * t * r)),
        spans * spans * (2.0 * q + 6.0 * t * r),
    )


@njit(**INNER)
def _crowded(slope: float, bow: float, steepness: float, even: float) -> tuple[float, float]:
    """How many points lie over a unit of the base there, and how that changes with eta.

    even: 0 where they lie evenly over the base, 1 where evenly over the surface.
    """
    square = steepness * steepness
    stretch = math.sqrt(1.0 + square * slope * slope)
    return 1.0 + even * (stretch - 1.0), even * square * slope * bow / stretch


@njit(**OPTIONS)
def smeared(
    table: Floats,
    blur: Floats,
    steepness: Floats,
    even: float,
    abscissae: Floats,
    shares: Floats,
    reach: float,
    cells: int,
) -> Floats:
    """Mean height, its slope, and variance by that of the noise (m, cells + 1, 3), for m amounts of noise.

    Each at cells + 1 even places from -reach to reach. table: as in Section; blur (m,): standard deviations
    of the noise; steepness (m,): apex heights in widths; even: as in `_crowded`; abscissae, shares (k,): of a
    quadrature over the standard normal distribution.
    """
    own = split(table)
    out = np.zeros((blur.size, cells + 1, 3))
    for m in range(blur.size):
        square = 1.0 / (blur[m] * blur[m])
        for i in range(cells + 1):
            eta = (2.0 * i / cells - 1.0) * reach
            level = _section_at(eta, own)[0]
            d = d1 = n = n1 = v = 0.0
            for k in range(abscissae.size):
                f, slope, bow = _section_at(eta + blur[m] * abscissae[k], own)
                dense, change = _crowded(slope, bow, steepness[m], even)
                dense, change = shares[k] * dense, shares[k] * change
                f -= level  # so that no digits are lost where there is little noise
                d += dense
                d1 += change
                n += dense * f
                n1 += change * f + dense * slope
                v += dense * f * f
            mean = n / d
            out[m, i, VALUE] = level + mean
            out[m, i, RATE] = (n1 - mean * d1) / d
            out[m, i, SPREAD] = max(v / d - mean * mean, 0.0) * square
    return out


@njit(**OPTIONS)
def smeared_basis(
    table: Floats,
    blur: float,
    steepness: float,
    even: float,
    abscissae: Floats,
    shares: Floats,
    places: Floats,
    spans: int,
    wider: float,
) -> Floats:
    """Means (n, spans + 3) of cubic B-splines on even knots over `wider` widths, at places (n,); see `smeared`."""
    own = split(table)
    out = np.zeros((places.size, spans + 3))
    for i in range(places.size):
        d = 0.0
        for k in range(abscissae.size):
            eta = places[i] + blur * abscissae[k]
            _, slope, bow = _section_at(eta, own)
            dense = shares[k] * _crowded(slope, bow, steepness, even)[0]
            d += dense
            place = (eta / wider + 0.5) * spans
            if not 0.0 <= place < spans:
                continue
            first = np.int64(place)
            t = place - first
            s = 1.0 - t
            out[i, first] += dense * s * s * s / 6.0
            out[i, first + 1] += dense * (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0
            out[i, first + 2] += dense * (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0
            out[i, first + 3] += dense * t * t * t / 6.0
        out[i] /= d
    return out


@njit(**INNER)
def smeared_at(eta: float, values: Floats, reach: float) -> tuple[float, float, float, float]:
    """Mean height, its slope and second derivative, and variance by that of the noise; values (cells + 1, 3)."""
    cells = values.shape[0] - 1
    step = 2.0 * reach / cells
    place = (eta + reach) / step
    if not 0.0 <= place < cells:
        return 0.0, 0.0, 0.0, 0.0
    i = np.int64(place)
    t = place - i
    u = 1.0 - t
    one, other = values[i, RATE], values[i + 1, RATE]
    f = (
        u * u * (1.0 + 2.0 * t) * values[i, VALUE]
        + t * t * (3.0 - 2.0 * t) * values[i + 1, VALUE]
        + step * t * u * (u * one - t * other)
    )
    return f, u * one + t * other, (other - one) / step, u * values[i, SPREAD] + t * values[i + 1, SPREAD]
