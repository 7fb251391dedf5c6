"""Symmetric positive definite systems of a small bandwidth: Cholesky's factor, solutions, variances.

A matrix (n, n) whose entries vanish more than m places from the diagonal is held as its lower band
(n, m + 1): band[i, k] is the entry at row i and column i - k. Source: Golub and Van Loan, Matrix
Computations, 4.3.5; for the inverse within the band Erisman and Tinney 1975 (Takahashi's recursion).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.residual import INNER

Floats = NDArray[np.float64]


@njit(**INNER)
def factor(band: Floats) -> tuple[Floats, bool]:
    """The lower band of Cholesky's factor, and whether the matrix is positive definite."""
    n, m = band.shape[0], band.shape[1] - 1
    # By columns, and what each changes of those after it at once: then all loops run along rows.
    columns, out, column = np.zeros((n, m + 1)), np.zeros_like(band), np.empty(m + 1)
    for j in range(n):
        for k in range(min(m, n - 1 - j) + 1):
            columns[j, k] = band[j + k, k]
    for j in range(n):
        own = columns[j]
        if not own[0] > 0.0:
            return out, False
        scale = 1.0 / math.sqrt(own[0])
        for k in range(m + 1):
            column[k] = scale * own[k]
        for i in range(min(m, n - 1 - j) + 1):
            out[j + i, i] = column[i]
        for i in range(1, min(m, n - 1 - j) + 1):
            after, entry = columns[j + i], column[i]
            for k in range(m + 1 - i):
                after[k] -= entry * column[i + k]
    return out, True


@njit(**INNER)
def solve(factored: Floats, right: Floats) -> Floats:
    """Solution (n,) for a right side (n,), by the factor."""
    n, m = factored.shape[0], factored.shape[1] - 1
    x = right.copy()
    for i in range(n):
        for k in range(1, min(m, i) + 1):
            x[i] -= factored[i, k] * x[i - k]
        x[i] /= factored[i, 0]
    for i in range(n - 1, -1, -1):
        for k in range(1, min(m, n - 1 - i) + 1):
            x[i] -= factored[i + k, k] * x[i + k]
        x[i] /= factored[i, 0]
    return x


@njit(**INNER)
def inverse_band(factored: Floats) -> Floats:
    """The lower band of the inverse (n, m + 1), by the factor."""
    n, m = factored.shape[0], factored.shape[1] - 1
    out = np.zeros_like(factored)
    # The inverse's block of the m rows after that at hand, whole, so that sums run along its rows: row i of
    # the inverse is row i modulo m there.
    block, column, new = np.zeros((m, m)), np.zeros(m), np.zeros(m)
    for i in range(n - 1, -1, -1):
        pivot = 1.0 / factored[i, 0]
        for k in range(i + 1, min(i + m, n - 1) + 1):
            column[k % m] = factored[k, k - i] * pivot
        variance = pivot * pivot
        for j in range(m):
            total = 0.0
            for k in range(m):
                total -= block[j, k] * column[k]
            new[j] = total
            variance -= total * column[j]
        out[i, 0] = variance
        for j in range(i + 1, min(i + m, n - 1) + 1):
            out[j, j - i] = new[j % m]
        own = i % m
        for j in range(m):
            block[own, j] = block[j, own] = new[j]
        block[own, own] = variance
    return out
