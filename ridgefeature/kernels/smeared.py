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
VALUE, RATE, SPREAD, LOW, HIGH, GROWTH = range(6)
_RARE = 3.0
"""Deviations of the noise beyond which a point on an even slope is as rare as one so far over its top."""


@njit(**INNER)
def section_at(eta: float, own: Columns) -> tuple[float, float, float]:
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
def crowded(slope: float, steepness: float, even: float) -> tuple[float, float, float]:
    """How many points lie over a unit of the base there, and how that changes with the section's slope and
    with the steepness.

    even: 0 where they lie evenly over the base, 1 where evenly over the surface.
    """
    if even == 0.0:
        return 1.0, 0.0, 0.0
    rise = steepness * slope
    stretch = math.sqrt(1.0 + rise * rise)
    change = even * rise / stretch
    return 1.0 + even * (stretch - 1.0), change * steepness, change * slope


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
    symmetric: bool,
) -> Floats:
    """What is seen of a section (m, cells + 1, 6), for m amounts of noise, at even places up to reach.

    The mean height, its slope, its variance by that of the noise, the least and the largest height as far
    aside as noise may well carry points, and the derivative of the mean with the apex height, by which steep
    places are crowded too. table: as in Section; blur (m,): standard deviations of the noise; steepness (m,):
    apex heights in widths; even: as in `crowded`; abscissae, shares (k,): of a quadrature over the standard
    normal distribution;
    symmetric: whether the section is, and only half of an even number of cells need be worked out.
    """
    own = split(table)
    out = np.zeros((blur.size, cells + 1, 6))
    heights = np.empty(abscissae.size)
    for m in range(blur.size):
        square = 1.0 / (blur[m] * blur[m])
        for i in range(cells // 2 + 1 if symmetric else cells + 1):
            eta = (2.0 * i / cells - 1.0) * reach
            level = section_at(eta, own)[0]
            d = d1 = n = n1 = v = g = g1 = 0.0
            for k in range(abscissae.size):
                f, slope, bow = section_at(eta + blur[m] * abscissae[k], own)
                dense, steeper, _ = crowded(slope, steepness[m], even)
                dense, steeper = shares[k] * dense, shares[k] * steeper
                change = steeper * bow
                heights[k] = f
                f -= level  # so that no digits are lost where there is little noise
                d += dense
                d1 += change
                n += dense * f
                n1 += change * f + dense * slope
                v += dense * f * f
                g += steeper * slope
                g1 += steeper * slope * f
            mean = n / d
            out[m, i, VALUE] = level + mean
            out[m, i, RATE] = (n1 - mean * d1) / d
            out[m, i, SPREAD] = max(v / d - mean * mean, 0.0) * square
            out[m, i, GROWTH] = level + mean + (g1 - mean * g) / d
            steep = steepness[m] * math.sqrt(out[m, i, SPREAD])
            near = _RARE * (math.sqrt(1.0 + steep * steep) - 1.0) / max(steep, 1e-6)
            low = high = level
            for k in range(abscissae.size):
                if abs(abscissae[k]) <= near:
                    low, high = min(low, heights[k]), max(high, heights[k])
            out[m, i, LOW], out[m, i, HIGH] = low, high
            if symmetric:
                out[m, cells - i] = out[m, i]
                out[m, cells - i, RATE] = -out[m, i, RATE]
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
    """How the mean height at places (n,) changes with the coefficients (n, spans + 3) of a section.

    They are those of cubic B-splines on even knots over `wider` widths; all else is as for `smeared`.
    """
    own = split(table)
    out = np.zeros((places.size, spans + 3))
    per_eta = spans / wider
    for i in range(places.size):
        d = mean = 0.0
        for k in range(abscissae.size):
            f, slope, _ = section_at(places[i] + blur * abscissae[k], own)
            dense = shares[k] * crowded(slope, steepness, even)[0]
            d += dense
            mean += dense * f
        mean /= d
        for k in range(abscissae.size):
            eta = places[i] + blur * abscissae[k]
            place = (eta / wider + 0.5) * spans
            if not 0.0 <= place < spans:
                continue
            f, slope, _ = section_at(eta, own)
            dense, steeper, _ = crowded(slope, steepness, even)
            dense, steeper = shares[k] * dense / d, shares[k] * steeper * (f - mean) * per_eta / d
            first = np.int64(place)
            t = place - first
            s = 1.0 - t
            row = out[i, first:]
            row[0] += dense * s * s * s / 6.0 - steeper * 0.5 * s * s
            row[1] += dense * (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0 + steeper * t * (1.5 * t - 2.0)
            row[2] += dense * (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0 - steeper * s * (1.5 * s - 2.0)
            row[3] += dense * t * t * t / 6.0 + steeper * 0.5 * t * t
    return out


@njit(**INNER)
def smeared_at(
    eta: float, values: Floats, reach: float
) -> tuple[float, float, float, float, float, float, float]:
    """Mean height, slope, second derivative, variance by that of the noise, least and largest height, and
    derivative with the apex height; values (cells + 1, 6) as `smeared` has them."""
    cells = values.shape[0] - 1
    step = 2.0 * reach / cells
    place = (eta + reach) / step
    if not 0.0 <= place < cells:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    i = np.int64(place)
    t = place - i
    u = 1.0 - t
    here, after = values[i], values[i + 1]
    one, other = here[RATE], after[RATE]
    f = (
        u * u * (1.0 + 2.0 * t) * here[VALUE]
        + t * t * (3.0 - 2.0 * t) * after[VALUE]
        + step * t * u * (u * one - t * other)
    )
    return (
        f,
        u * one + t * other,
        (other - one) / step,
        u * here[SPREAD] + t * after[SPREAD],
        u * here[LOW] + t * after[LOW],
        u * here[HIGH] + t * after[HIGH],
        u * here[GROWTH] + t * after[GROWTH],
    )


@njit(**OPTIONS)
def log_likelihood(
    points: Floats,
    table: Floats,
    sizes: Floats,
    even: float,
    abscissae: Floats,
    shares: Floats,
    noise: float,
    strays: float,
    span: float,
) -> float:
    """Of points' heights where they are seen: of a section with noisy points, and even strays over `span`.

    points (n, 2): y from the middle between the feet, and z from the base there; sizes (n, 2): height and
    width there; the rest as for `smeared`, but the noise in the unit of the points.
    """
    own = split(table)
    total, least = 0.0, strays / span
    density = (1.0 - strays) / (math.sqrt(2.0 * math.pi) * noise)
    for i in range(points.shape[0]):
        h, w = sizes[i, 0], sizes[i, 1]
        d = n = 0.0
        for k in range(abscissae.size):
            f, slope, _ = section_at((points[i, 0] + noise * abscissae[k]) / w, own)
            dense = shares[k] * crowded(slope, h / w, even)[0]
            r = (points[i, 1] - h * f) / noise
            d += dense
            n += dense * math.exp(-0.5 * min(r * r, 1e3))
        total += math.log(least + density * n / d)
    return total
