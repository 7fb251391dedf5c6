"""Penalised splines of several terms along a path: their normal equations, and how smooth they should be.

Cubic splines on even knots; a difference of a term's coefficients should be what is wanted of it (Eilers and
Marx 1996). Unknown 6 i + k is the i-th coefficient of the k-th term.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.banded import factor, inverse_band, solve
from ridgefeature.kernels.residual import INNER, OPTIONS
from ridgefeature.kernels.strip import TERMS, H, W

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
_BAND = 4 * TERMS
_HARDEST = 1e6
"""Largest weight of a penalty, in parts of what the data say of a coefficient."""
_LEAST_RIDGE = 1e-9
_UNSURE = 2.0
"""Variance of a weight's logarithm, times the differences that the data tell, by normal theory."""


@njit(**OPTIONS)
def assembled(matrix: Floats, goal: Floats, first: Indices, basis: Floats, n: int) -> tuple[Floats, Floats]:
    """The band (6 n, 24) and right side (6 n,) of normal equations for the coefficients of six cubic splines.

    matrix (m, 6, 6), goal (m, 6) of m stretches; first (m,), basis (m, 4): the basis functions there.
    """
    band, out = np.zeros((TERMS * n, _BAND)), np.zeros(TERMS * n)
    for j in range(matrix.shape[0]):
        for p in range(TERMS):
            for k in range(4):
                i = TERMS * (first[j] + k) + p
                out[i] += basis[j, k] * goal[j, p]
                for m in range(4):
                    for q in range(TERMS):
                        other = TERMS * (first[j] + m) + q
                        if other <= i:
                            band[i, i - other] += basis[j, k] * basis[j, m] * matrix[j, p, q]
    return band, out


@njit(**INNER)
def _add_penalty(band: Floats, right: Floats, term: int, order: int, weight: float, wanted: Floats) -> None:
    """Add to normal equations the squares of differences less what is wanted of them, times a weight."""
    n = band.shape[0] // TERMS
    steps = _steps(order)
    for d in range(n - order):
        for k in range(order + 1):
            i = TERMS * (d + k) + term
            right[i] += weight * steps[k] * wanted[d]
            for m in range(k + 1):
                band[i, TERMS * (k - m)] += weight * steps[k] * steps[m]


@njit(**INNER)
def _steps(order: int) -> Floats:
    """Coefficients of a difference: binomial, of alternating sign."""
    out = np.zeros(order + 1)
    out[0] = 1.0
    for _ in range(order):
        for k in range(order, 0, -1):
            out[k] = out[k - 1] - out[k]
        out[0] = -out[0]
    return out


@njit(**INNER)
def _differences(found: Floats, term: int, order: int, wanted: Floats) -> Floats:
    """Differences (n - order,) of a term's coefficients, less what is wanted of them."""
    steps = _steps(order)
    left = -wanted[: found.size // TERMS - order]
    for d in range(left.size):
        for k in range(order + 1):
            left[d] += steps[k] * found[TERMS * (d + k) + term]
    return left


@njit(**INNER)
def _free(inverse: Floats, term: int, order: int, weight: float) -> float:
    """Differences of a term that the data tell: all of them, less those that the penalty holds."""
    rows = inverse.shape[0] // TERMS - order
    steps = _steps(order)
    trace = 0.0
    for d in range(rows):
        for k in range(order + 1):
            i = TERMS * (d + k) + term
            for m in range(k + 1):
                twice = 1.0 if m == k else 2.0
                trace += twice * steps[k] * steps[m] * inverse[i, TERMS * (k - m)]
    return float(max(rows - weight * trace, 1e-3))


@njit(**INNER)
def _next_weight(
    found: Floats, inverse: Floats, term: int, order: int, weight: float, wanted: Floats, doubted: float
) -> float:
    """The weight that makes differences left over as large as chance does (Wood and Fasiolo 2017).

    doubted: 1 if it is never so large that nothing is free: what the data do not tell from a straight line
    need not be one. That is a prior for the deviation of differences that is 0 at 0 (Chung et al. 2013: a
    gamma distribution of shape 2 and no rate). 0: without.
    """
    left = _differences(found, term, order, wanted)
    rough = float((left * left).sum())
    return weight * min(
        max(_free(inverse, term, order, weight) / max(weight * rough + doubted, 1e-300), 1e-3), 1e3
    )


@njit(**OPTIONS)
def most_likely(
    band: Floats,
    right: Floats,
    orders: Indices,
    wanted: Floats,
    weights: Floats,
    rounds: int,
    doubted: float = 1.0,
) -> tuple[Floats, Floats, Floats, float]:
    """Coefficients (n, 6), band of their covariance (6 n, 24) and weights (6,), most likely together; and how
    many coefficients the data tell, in all. The covariance of heights and widths knows that weights are not
    known for sure.

    wanted (6, n): of the differences of each term; weights: to begin with. There are always as many
    rounds: stopping early would let rounding decide on the result. doubted: as for `_next_weight`.
    """
    n = band.shape[0] // TERMS
    most, least = np.zeros(TERMS), np.zeros(TERMS)
    for k in range(TERMS):
        size = 0.0
        for i in range(n):
            size += band[TERMS * i + k, 0] / n
        least[k] = _LEAST_RIDGE * size + 1e-300
        most[k] = _HARDEST * size + 1e-290
    lam = np.minimum(weights, most)
    used, factored = lam.copy(), np.zeros_like(band)
    found, inverse, freedom = np.zeros(TERMS * n), np.zeros_like(band), 0.0
    for _ in range(rounds):
        whole, pull = band.copy(), right.copy()
        for k in range(TERMS):
            for i in range(n):
                whole[TERMS * i + k, 0] += least[k]
            _add_penalty(whole, pull, k, orders[k], lam[k], wanted[k])
        tried, good = factor(whole)
        if not good:
            least *= 1e3
            continue
        factored = tried
        found = solve(factored, pull)
        inverse = inverse_band(factored)
        used[:] = lam
        freedom = 0.0
        for k in range(TERMS):
            freedom += orders[k] + _free(inverse, k, orders[k], lam[k])
            lam[k] = min(_next_weight(found, inverse, k, orders[k], lam[k], wanted[k], doubted), most[k])
    if freedom > 0.0:
        for k in (H, W):
            _add_unsure(inverse, factored, found, k, orders[k], used[k], wanted[k])
    return found.reshape(n, TERMS), inverse, lam, freedom


@njit(**INNER)
def _add_unsure(
    inverse: Floats, factored: Floats, found: Floats, term: int, order: int, weight: float, wanted: Floats
) -> None:
    """Add to a covariance what coefficients change where a term's weight is another one, as likely.

    By the derivative of the coefficients by the weight's logarithm (Wood, Pya and Saefken 2016, equation 7).
    """
    left = _differences(found, term, order, wanted)
    steps = _steps(order)
    pull = np.zeros(found.size)
    for d in range(left.size):
        for k in range(order + 1):
            pull[TERMS * (d + k) + term] += weight * steps[k] * left[d]
    moved = solve(factored, pull)
    variance = _UNSURE / max(_free(inverse, term, order, weight), 1.0)
    for i in range(inverse.shape[0]):
        for j in range(min(i + 1, _BAND)):
            inverse[i, j] += variance * moved[i] * moved[i - j]


@njit(**OPTIONS)
def changed_band(band: Floats, change: Floats) -> Floats:
    """The band (6 n, 24) of a covariance for other terms, `change` (6, 6) times these."""
    out = np.zeros_like(band)
    half = np.empty((TERMS, TERMS))
    for i in range(band.shape[0] // TERMS):
        for j in range(max(0, i - 3), i + 1):
            for p in range(TERMS):
                for q in range(TERMS):
                    half[p, q] = 0.0
                    for r in range(TERMS):
                        one, other = TERMS * i + r, TERMS * j + q
                        half[p, q] += change[p, r] * band[max(one, other), abs(one - other)]
            for p in range(TERMS):
                for q in range(TERMS):
                    one, other = TERMS * i + p, TERMS * j + q
                    if other <= one:
                        for r in range(TERMS):
                            out[one, one - other] += half[p, r] * change[q, r]
    return out


@njit(**OPTIONS)
def local_covariances(band: Floats, first: Indices, basis: Floats, one: int, other: int) -> Floats:
    """Covariances (m,) of two terms where the basis functions from `first` (m,) on are `basis` (m, 4)."""
    out = np.zeros(first.size)
    for n in range(first.size):
        for k in range(4):
            for m in range(4):
                i, j = TERMS * (first[n] + k) + one, TERMS * (first[n] + m) + other
                out[n] += basis[n, k] * basis[n, m] * band[max(i, j), abs(i - j)]
    return out
