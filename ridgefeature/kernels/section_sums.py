"""What all points of a ridge say of its section: normal equations of a free spline."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.residual import OPTIONS, split
from ridgefeature.kernels.strip import noise_bias, share_of_surface, surface_at, terms_at

Floats = NDArray[np.float64]


@njit(**OPTIONS)
def section_sums(
    points: Floats,
    terms: Floats,
    table: Floats,
    scale: float,
    stray: float,
    even: float,
    spans: int,
    wider: float,
) -> tuple[Floats, Floats]:
    """Normal equations, in units of the noise, of a section and of the base's offset, tilt and curvature.

    points, terms, table and noise as in kernels.strip. The section is a cubic spline on so many equal spans
    over `wider` widths: its coefficients (spans + 3,) are heights in apex heights; the last three unknowns
    change the base everywhere, in powers of y. The matrix is (spans + 6, spans + 6).
    """
    own = split(table)
    n = spans + 6
    matrix, right = np.zeros((n, n)), np.zeros(n)
    index, row = np.empty(7, np.int64), np.empty(7)
    for k in range(3):
        index[4 + k] = spans + 3 + k
    for i in range(points.shape[0]):
        y = points[i, 1]
        _, there = terms_at(terms, points[i, 0])
        base, f, _, eta, slope, bow = surface_at(y, there, own)
        inverse = 1.0 / math.sqrt(1.0 + slope * slope)
        per_scale = inverse / scale
        goal = (points[i, 2] - base) * per_scale - noise_bias(scale, bow, inverse, even)
        weight = share_of_surface(goal - there[4] * f * per_scale, inverse, stray)
        place = (eta / wider + 0.5) * spans
        span = np.int64(min(max(place, 0.0), spans - 0.5))
        t = place - span
        raised = there[4] * per_scale if 0.0 <= t <= 1.0 else 0.0
        s = 1.0 - t
        row[0] = raised * s * s * s / 6.0
        row[1] = raised * (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0
        row[2] = raised * (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0
        row[3] = raised * t * t * t / 6.0
        row[4], row[5], row[6] = per_scale, y * per_scale, y * y * per_scale
        for k in range(4):
            index[k] = span + k
        for k in range(7):
            right[index[k]] += weight * goal * row[k]
            for m in range(k + 1):
                matrix[index[k], index[m]] += weight * row[k] * row[m]
    for k in range(n):
        for m in range(k):
            matrix[m, k] = matrix[k, m]
    return matrix, right
