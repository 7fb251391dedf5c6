"""Products of the errors of points that lie in one line."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.residual import OPTIONS

Floats = NDArray[np.float64]


@njit(**OPTIONS)
def pair_products(
    places: Floats, errors: Floats, angles: Floats, breadth: float, length: float
) -> tuple[Floats, Floats]:
    """Sums (k,) of the products of errors over all pairs of points in one part of a line, and those pairs.

    places (m, 2), errors (m,); angles (k,): directions of lines, so broad, whose parts are so long. Parts are
    kept in a table with four rows for each point; two that come to the same row count as one.
    """
    products, pairs = np.zeros(angles.size), np.zeros(angles.size)
    rows = 1
    while rows < 4 * errors.size:
        rows *= 2
    sums, counts = np.zeros(rows), np.zeros(rows, dtype=np.int64)
    own = np.empty(errors.size, dtype=np.int64)
    squares = 0.0
    for n in range(errors.size):
        squares += errors[n] * errors[n]
    for k in range(angles.size):
        c, s = math.cos(angles[k]) / breadth, math.sin(angles[k]) / breadth
        shorter = breadth / length
        for n in range(errors.size):
            x, y = places[n, 0], places[n, 1]
            i, j = math.floor(c * y - s * x), math.floor(shorter * (c * x + s * y))
            own[n] = (int(i) * 73856093 + int(j) * 19349663) & (rows - 1)
            sums[own[n]] += errors[n]
            counts[own[n]] += 1
        for n in range(errors.size):
            row = own[n]
            total, count = sums[row], counts[row]
            products[k] += total * total
            pairs[k] += count * (count - 1)
            sums[row], counts[row] = 0.0, 0  # counted once
        products[k] -= squares
    return products, pairs
