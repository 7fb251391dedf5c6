"""How well a template as it stands agrees with its points: scale, whitening, deviations, misfit.

Points are (n, 3) in the template's frame; `trend` and `table` are as in kernels.residual.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import copy_into, solve_in_place, whitening
from ridgefeature.kernels.objective import pack
from ridgefeature.kernels.residual import (
    HUBER,
    INNER,
    OPTIONS,
    TUKEY,
    columns,
    loss_jet,
    residual_jet,
    split,
    weight_of,
)

Floats = NDArray[np.float64]


@njit(**INNER)
def residuals_of(points: Floats, height: float, width: float, trend: Floats, table: Floats) -> Floats:
    """Residuals (n,) of points (n, 3)."""
    bend, rise, widening = trend[0], trend[1], trend[2]
    constant, linear, quadratic, cubic = split(table)
    column_x, column_y, column_z = columns(points)
    out = np.empty(column_x.size)
    for i in range(column_x.size):
        x, y, z = column_x[i], column_y[i], column_z[i]
        out[i] = residual_jet(
            x, y, z, height, width, bend, rise, widening, constant, linear, quadratic, cubic
        )[0]
    return out


@njit(**OPTIONS)
def residuals(points: Floats, height: float, width: float, trend: Floats, table: Floats) -> Floats:
    """`residuals_of`, for who is no kernel."""
    return residuals_of(points, height, width, trend, table)


@njit(**OPTIONS)
def losses(x: Floats, loss: int, tuning: float) -> Floats:
    """Loss (n,) of residuals x (n,) in units of their scale."""
    out = np.empty(x.size)
    for i in range(x.size):
        out[i] = loss_jet(x[i], loss, tuning)[0]
    return out


@njit(**INNER)
def loss_sum(r: Floats, scale: float, loss: int, tuning: float) -> float:
    """Sum of the losses of residuals (n,)."""
    inverse, total = 1.0 / scale, 0.0
    # One loop for each loss, as in kernels.objective.
    if loss == TUKEY:
        for i in range(r.size):
            total += loss_jet(r[i] * inverse, TUKEY, tuning)[0]
    elif loss == HUBER:
        for i in range(r.size):
            total += loss_jet(r[i] * inverse, HUBER, tuning)[0]
    else:
        for i in range(r.size):
            total += loss_jet(r[i] * inverse, loss, tuning)[0]
    return total


@njit(**INNER)
def share_beyond(r: Floats, most: float) -> float:
    """Share of residuals (n,) larger than `most`."""
    far = 0.0
    for i in range(r.size):
        far += 1.0 if abs(r[i]) > most else 0.0
    return far / r.size


@njit(**OPTIONS)
def mean_loss(
    points: Floats,
    height: float,
    width: float,
    trend: Floats,
    table: Floats,
    scale: float,
    loss: int,
    tuning: float,
) -> tuple[float, float]:
    """Mean robust loss of a template as it stands, and the share of points beyond three scales."""
    r = residuals_of(points, height, width, trend, table)
    return loss_sum(r, scale, loss, tuning) / r.size, share_beyond(r, 3.0 * scale)


@njit(**INNER)
def _rows(
    points: Floats, height: float, width: float, trend: Floats, table: Floats
) -> tuple[Floats, tuple[Floats, ...]]:
    """Residuals (n,), and seven rows (n,): their derivatives by all parameters but the first, sliding.

    Rows apart from each other, so that the loop and the sums of `_gram` run in SIMD.
    """
    bend, rise, widening = trend[0], trend[1], trend[2]
    constant, linear, quadratic, cubic = split(table)
    column_x, column_y, column_z = columns(points)
    n = column_x.size
    r = np.empty(n)
    d1, d2, d3, d4 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    d5, d6, d7 = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        x, y, z = column_x[i], column_y[i], column_z[i]
        r[i], r_x, r_y, r_z, r_h, r_w = residual_jet(
            x, y, z, height, width, bend, rise, widening, constant, linear, quadratic, cubic
        )
        d1[i], d2[i] = -r_y, -r_z
        d3[i], d4[i], d5[i] = r_y * z - r_z * y, r_z * x - r_x * z, r_x * y - r_y * x
        d6[i], d7[i] = r_h, r_w
    return r, (d1, d2, d3, d4, d5, d6, d7)


@njit(**INNER)
def _gram(rows: tuple[Floats, ...], weights: Floats) -> Floats:
    """Weighted sums (7, 7) of the products of seven rows."""
    normal = np.empty((7, 7))
    for j in range(7):
        for k in range(j + 1):
            a, b = rows[j], rows[k]
            total = 0.0
            for i in range(weights.size):
                total += weights[i] * a[i] * b[i]
            normal[j, k] = total
            normal[k, j] = total
    return normal


@njit(**INNER)
def prepared(
    points: Floats,
    height: float,
    width: float,
    trend: Floats,
    table: Floats,
    floor: float,
    prior: Floats,
    loss: int,
    tuning: float,
) -> tuple[float, Floats, Floats]:
    """What an optimisation from a template as it stands needs.

    The robust scale, not below floor; the whitening transform (8, 7) of the mean Huber loss; and the packed
    problem of this loss (see kernels.objective). prior (2, 8): expected parameters, reciprocal variances.
    """
    r, rows = _rows(points, height, width, trend, table)
    scale = max(1.4826 * np.median(np.abs(r)), floor)
    weights = np.empty(r.size)
    for i in range(r.size):
        weights[i] = weight_of(r[i] / scale, HUBER, 1.345) / (scale * scale * r.size)
    normal = np.zeros((8, 8))
    gram = _gram(rows, weights)
    for j in range(1, 8):
        copy_into(normal[j, 1:], gram[j - 1])
    for j in range(8):
        normal[j, j] += prior[1, j] / r.size
    transform = whitening(normal)
    start = np.zeros(8)
    start[6], start[7] = height, width
    return scale, transform, pack(points, start, prior, trend, transform, table, scale, loss, tuning)


@njit(**OPTIONS)
def prepare(
    points: Floats,
    height: float,
    width: float,
    trend: Floats,
    table: Floats,
    floor: float,
    prior: Floats,
    loss: int,
    tuning: float,
) -> tuple[float, Floats, Floats]:
    """`prepared`, for who is no kernel."""
    return prepared(points, height, width, trend, table, floor, prior, loss, tuning)


@njit(**OPTIONS)
def deviations(
    points: Floats,
    height: float,
    width: float,
    trend: Floats,
    table: Floats,
    scale: float,
    loss: int,
    tuning: float,
) -> tuple[Floats, int]:
    """Standard deviations (8,) of a fitted template's parameters, and its number of inliers.

    The asymptotic variance of an M-estimator (Huber 1981, 7.6) with its small-sample factor, from the points
    within `tuning` scales. Infinite where the points do not tell. The first, sliding, is fixed: 0.
    """
    r, rows = _rows(points, height, width, trend, table)
    inside = np.zeros(r.size)
    inliers = 0
    psi_square = psi_slope = 0.0
    step = 1e-4
    for i in range(r.size):
        s = r[i] / scale
        if abs(s) < tuning:
            inside[i] = 1.0
            inliers += 1
            psi_square += loss_jet(s, loss, tuning)[1] ** 2
            above, below = loss_jet(s + step, loss, tuning)[1], loss_jet(s - step, loss, tuning)[1]
            psi_slope += (above - below) / (2 * step)
    std = np.full(8, np.inf)
    std[0] = 0.0
    if inliers <= 8 or not psi_slope > 0.0:
        return std, inliers
    factor = scale * scale * psi_square * inliers * inliers / (psi_slope * psi_slope * (inliers - 7))
    free = _gram(rows, inside)
    column = np.empty(7)
    for i in range(7):
        column[:] = 0.0
        column[i] = 1.0
        if solve_in_place(free.copy(), column):
            std[i + 1] = math.sqrt(factor * column[i])
    return std, inliers


@njit(**OPTIONS)
def add_misfit(
    bins: Floats, points: Floats, height: float, width: float, trend: Floats, table: Floats, scale: float
) -> None:
    """Add to bins (2, m) the number and the sum of clipped residuals, in scales, by distance from the spine.

    The m bins share the distances up to the width.
    """
    r = residuals_of(points, height, width, trend, table)
    per_bin = bins.shape[1] / width
    for i in range(points.shape[0]):
        k = int(abs(points[i, 1]) * per_bin)
        if k < bins.shape[1]:
            bins[0, k] += 1.0
            bins[1, k] += min(max(r[i] / scale, -2.0), 2.0)
