"""What points say of a steep ridge by their likelihood itself: its derivatives with terms and section.

Beside a steep flank a point is high or low, and its mean height (kernels.strip) tells less than the mixture
of heights that its noise may have carried it from (as in `smeared.log_likelihood`). The information is the
sum of outer products of the derivatives (Berndt, Hall, Hall and Hausman 1974).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.residual import INNER, OPTIONS, split
from ridgefeature.kernels.section_sums import BASE
from ridgefeature.kernels.smeared import Columns, crowded, section_at
from ridgefeature.kernels.strip import TERMS, A, B, C, E, H, W, terms_at

Floats = NDArray[np.float64]


@njit(**INNER)
def _mixture(
    aside: float,
    z: float,
    h: float,
    w: float,
    own: Columns,
    even: float,
    abscissae: Floats,
    shares: Floats,
    noise: float,
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Points d seen at a place and part n of them at a height; derivatives d_e, d_h, d_w, n_z, n_e, n_h, n_w.

    aside: y from the middle between the feet; z: over the base.
    """
    d = d_e = d_h = d_w = n = n_z = n_e = n_h = n_w = 0.0
    if abs(aside) > 0.5 * w + noise * abscissae[-1]:
        n = math.exp(-0.5 * min(z * z / (noise * noise), 1e3))
        return 1.0, 0.0, 0.0, 0.0, n, n * z / (noise * noise), 0.0, 0.0, 0.0
    for k in range(abscissae.size):
        eta = (aside + noise * abscissae[k]) / w
        f, slope, bow = section_at(eta, own)
        dense, steeper, taller = crowded(slope, h / w, even)
        r = (z - h * f) / noise
        near = math.exp(-0.5 * min(r * r, 1e3))
        # With the place on the section, and with the apex height in widths.
        crowd, more = -shares[k] * steeper * bow / w, shares[k] * taller / w
        pull = shares[k] * near * dense * r / noise
        d += shares[k] * dense
        d_e += crowd
        d_h += more
        d_w += crowd * eta - more * h / w
        n += shares[k] * near * dense
        n_z += pull
        rise = -pull * h * slope / w
        n_e += rise + near * crowd
        n_h += pull * f + near * more
        n_w += rise * eta + near * (crowd * eta - more * h / w)
    return d, d_e, d_h, d_w, n, n_z, n_e, n_h, n_w


@njit(**INNER)
def _mirror(matrix: Floats) -> None:
    """Fill the upper half of a symmetric matrix (n, n)."""
    for p in range(matrix.shape[0]):
        for q in range(p):
            matrix[q, p] = matrix[p, q]


@njit(**OPTIONS)
def scores(
    points: Floats,
    terms: Floats,
    table: Floats,
    even: float,
    abscissae: Floats,
    shares: Floats,
    noise: float,
    strays: float,
    span: float,
) -> tuple[Floats, Floats]:
    """Information (nodes - 1, 6, 6) and derivatives (nodes - 1, 6) of the log likelihood of each stretch.

    points (n, 3) in path coordinates and terms (nodes, 6) as in kernels.strip; the rest as for
    `smeared.log_likelihood`.
    """
    own = split(table)
    stretches = terms.shape[0] - 1
    matrix, right = np.zeros((stretches, TERMS, TERMS)), np.zeros((stretches, TERMS))
    least, density = strays / span, (1.0 - strays) / (math.sqrt(2.0 * math.pi) * noise)
    row = np.empty(TERMS)
    for i in range(points.shape[0]):
        y = points[i, 1]
        j, (a, b, c, e, h, w) = terms_at(terms, points[i, 0])
        z = points[i, 2] - a - y * (b + c * y)
        found = _mixture(y - e, z, h, w, own, even, abscissae, shares, noise)
        d, d_e, d_h, d_w, n, n_z, n_e, n_h, n_w = found
        if n <= 0.0:
            continue
        on = density * n / d
        share = on / (least + on)
        row[A] = share * n_z / n
        row[B], row[C] = y * row[A], y * y * row[A]
        row[E] = share * (n_e / n - d_e / d)
        row[H] = share * (n_h / n - d_h / d)
        row[W] = share * (n_w / n - d_w / d)
        for p in range(TERMS):
            right[j, p] += row[p]
            for q in range(p + 1):
                matrix[j, p, q] += row[p] * row[q]
    for j in range(stretches):
        _mirror(matrix[j])
    return matrix, right


@njit(**INNER)
def _section_mixture(
    aside: float,
    z: float,
    h: float,
    w: float,
    own: Columns,
    even: float,
    abscissae: Floats,
    shares: Floats,
    noise: float,
    spans: int,
    wider: float,
    change: Floats,
) -> tuple[float, float, float, np.int64, np.int64]:
    """As `_mixture`: d, n and n_z, and into `change` (2, spans + 3) how n and d change with the coefficients.

    Also the first of those that they change with, and the one after the last.
    """
    low, high = np.int64(change.shape[1]), np.int64(0)
    d = n = n_z = 0.0
    if abs(aside) > 0.5 * max(wider, 1.0) * w + noise * abscissae[-1]:
        n = math.exp(-0.5 * min(z * z / (noise * noise), 1e3))
        return 1.0, n, n * z / (noise * noise), low, high
    change[:] = 0.0
    for k in range(abscissae.size):
        eta = (aside + noise * abscissae[k]) / w
        f, slope, _ = section_at(eta, own)
        dense, steeper, _ = crowded(slope, h / w, even)
        r = (z - h * f) / noise
        near = math.exp(-0.5 * min(r * r, 1e3))
        pull = shares[k] * near * dense * r / noise
        d += shares[k] * dense
        n += shares[k] * near * dense
        n_z += pull
        place = (eta / wider + 0.5) * spans
        if not 0.0 <= place < spans:
            continue
        first = np.int64(place)
        low, high = min(low, first), max(high, first + 4)
        t = place - first
        s = 1.0 - t
        crowd = shares[k] * steeper * spans / wider
        for p, value, rate in (
            (0, s * s * s / 6.0, -0.5 * s * s),
            (1, (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0, t * (1.5 * t - 2.0)),
            (2, (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0, -s * (1.5 * s - 2.0)),
            (3, t * t * t / 6.0, 0.5 * t * t),
        ):
            change[0, first + p] += pull * h * value + near * crowd * rate
            change[1, first + p] += crowd * rate
    return d, n, n_z, low, high


@njit(**OPTIONS)
def section_scores(
    points: Floats,
    terms: Floats,
    table: Floats,
    even: float,
    abscissae: Floats,
    shares: Floats,
    noise: float,
    strays: float,
    span: float,
    spans: int,
    wider: float,
) -> tuple[Floats, Floats]:
    """The same (spans + 6, spans + 6), (spans + 6,) with the coefficients of a spline section and the base.

    They are those of cubic B-splines on so many even knots over `wider` widths, in apex heights, and changes
    of the base in powers of y.
    """
    own = split(table)
    size = spans + 3
    matrix, right = np.zeros((size + BASE, size + BASE)), np.zeros(size + BASE)
    least, density = strays / span, (1.0 - strays) / (math.sqrt(2.0 * math.pi) * noise)
    change, row = np.zeros((2, size)), np.empty(size + BASE)
    for i in range(points.shape[0]):
        y = points[i, 1]
        _, (a, b, c, e, h, w) = terms_at(terms, points[i, 0])
        z = points[i, 2] - a - y * (b + c * y)
        found = _section_mixture(y - e, z, h, w, own, even, abscissae, shares, noise, spans, wider, change)
        d, n, n_z, low, high = found
        if n <= 0.0:
            continue
        on = density * n / d
        share = on / (least + on)
        for p in range(low, high):
            row[p] = share * (change[0, p] / n - change[1, p] / d)
            right[p] += row[p]
            for q in range(low, p + 1):
                matrix[p, q] += row[p] * row[q]
        for k in range(size, size + BASE):
            row[k] = share * n_z / n * y ** (k - size)
            right[k] += row[k]
            for p in range(low, high):
                matrix[k, p] += row[k] * row[p]
            for p in range(size, k + 1):
                matrix[k, p] += row[k] * row[p]
    _mirror(matrix)
    return matrix, right
