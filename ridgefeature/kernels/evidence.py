"""Ridge or no ridge: a template against the best plane through the same points.

Points are (n, 3) in the template's frame; `trend` and `table` are as in kernels.residual.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import solve_in_place
from ridgefeature.kernels.appraise import loss_sum, residuals_of, share_beyond
from ridgefeature.kernels.residual import HUBER, INNER, OPTIONS, TUKEY, columns, loss_jet, weight_of

Floats = NDArray[np.float64]


@njit(**INNER)
def _plane_sums(
    x: Floats, y: Floats, z: Floats, plane: Floats, scale: float, loss: int, tuning: float
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """Loss of a plane, and the sums that a reweighted step takes: of 1, x, y, xx, xy, yy, r, rx, ry."""
    a, b, c, inverse = plane[0], plane[1], plane[2], 1.0 / scale
    total = s = s_x = s_y = s_xx = s_xy = s_yy = s_r = s_rx = s_ry = 0.0
    for i in range(x.size):
        r = z[i] - a - b * x[i] - c * y[i]
        weight = weight_of(r * inverse, loss, tuning)
        total += loss_jet(r * inverse, loss, tuning)[0]
        w_x, w_y, w_r = weight * x[i], weight * y[i], weight * r
        s += weight
        s_x += w_x
        s_y += w_y
        s_xx += w_x * x[i]
        s_xy += w_x * y[i]
        s_yy += w_y * y[i]
        s_r += w_r
        s_rx += w_r * x[i]
        s_ry += w_r * y[i]
    return total, s, s_x, s_y, s_xx, s_xy, s_yy, s_r, s_rx, s_ry


@njit(**INNER)
def plane_loss(
    points: Floats, scale: float, loss: int, tuning: float, iterations: int
) -> tuple[float, Floats]:
    """Smallest robust loss of a plane z = a + b x + c y that reweighting finds, and its a, b, c (3,)."""
    normal = np.zeros((3, 3))
    right = np.zeros(3)
    plane = np.zeros(3)
    best, best_plane = np.inf, plane.copy()
    x, y, z = columns(points)
    for _ in range(iterations):
        if loss == TUKEY:
            sums = _plane_sums(x, y, z, plane, scale, TUKEY, tuning)
        elif loss == HUBER:
            sums = _plane_sums(x, y, z, plane, scale, HUBER, tuning)
        else:
            sums = _plane_sums(x, y, z, plane, scale, loss, tuning)
        total, normal[0, 0], normal[1, 0], normal[2, 0] = sums[0], sums[1], sums[2], sums[3]
        normal[1, 1], normal[2, 1], normal[2, 2] = sums[4], sums[5], sums[6]
        right[0], right[1], right[2] = sums[7], sums[8], sums[9]
        if total < best:
            best, best_plane = total, plane.copy()
        if not solve_in_place(normal, right):
            break
        plane += right
    return best, best_plane


@njit(**OPTIONS)
def explained(points: Floats, height: float, width: float, trend: Floats, table: Floats) -> float:
    """Log of the mean absolute residual of the best plane over the template's, both clipped at the height.

    Unlike evidence it grows as the noise found shrinks, so it tells good fits of different windows apart.
    """
    most = abs(height)
    plane = plane_loss(points, 0.3 * most, HUBER, 1.345, 5)[1]
    ridge = residuals_of(points, height, width, trend, table)
    flat = points[:, 2] - plane[0] - plane[1] * points[:, 0] - plane[2] * points[:, 1]
    least = 1e-3 * most * points.shape[0]
    return math.log(
        (np.minimum(np.abs(flat), most).sum() + least) / (np.minimum(np.abs(ridge), most).sum() + least)
    )


@njit(**OPTIONS)
def assess(
    points: Floats,
    height: float,
    width: float,
    trend: Floats,
    table: Floats,
    floor: float,
    contrast: float,
    loss: int,
    tuning: float,
) -> tuple[float, float, float]:
    """Robust scale, not below floor; share of points beyond three scales; evidence.

    The scale is the standard deviation that the median absolute residual tells. Evidence is twice the loss
    that the best plane has more than the template, a log likelihood ratio, at a scale of at least `contrast`.
    """
    r = residuals_of(points, height, width, trend, table)
    scale = max(1.4826 * np.median(np.abs(r)), floor)
    unit = max(scale, contrast)
    ridge, plane = loss_sum(r, unit, loss, tuning), plane_loss(points, unit, loss, tuning, 5)[0]
    return scale, share_beyond(r, 3.0 * scale), 2.0 * (plane - ridge)
