"""How well a template as it stands agrees with its points: scale, whitening, evidence, deviations, misfit.

Points are (n, 3) in the template's frame; `trend` and `table` are as in kernels.residual.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import solve_in_place, whitening
from ridgefeature.kernels.residual import HUBER, INNER, OPTIONS, loss_jet, residual_jet, split, weight_of

Floats = NDArray[np.float64]


@njit(**OPTIONS)
def residuals(points: Floats, height: float, width: float, trend: Floats, table: Floats) -> Floats:
    """Residuals (n,) of points (n, 3)."""
    bend, rise, widening = trend[0], trend[1], trend[2]
    constant, linear, quadratic, cubic = split(table)
    out = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        out[i] = residual_jet(
            x, y, z, height, width, bend, rise, widening, constant, linear, quadratic, cubic
        )[0]
    return out


@njit(**OPTIONS)
def losses(x: Floats, loss: int, tuning: float) -> Floats:
    """Loss (n,) of residuals x (n,) in units of their scale."""
    out = np.empty(x.size)
    for i in range(x.size):
        out[i] = loss_jet(x[i], loss, tuning)[0]
    return out


@njit(**OPTIONS)
def robust_scale(
    points: Floats, height: float, width: float, trend: Floats, table: Floats, floor: float
) -> float:
    """Standard deviation of the residuals from the median of their absolute values, not below floor."""
    return max(1.4826 * np.median(np.abs(residuals(points, height, width, trend, table))), floor)


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
    total, far = 0.0, 0
    for r in residuals(points, height, width, trend, table):
        total += loss_jet(r / scale, loss, tuning)[0]
        far += abs(r / scale) > 3.0
    return total / points.shape[0], far / points.shape[0]


@njit(**OPTIONS)
def plane_loss(
    points: Floats, scale: float, loss: int, tuning: float, iterations: int
) -> tuple[float, Floats]:
    """Smallest robust loss of a plane z = a + b x + c y that reweighting finds, and its a, b, c (3,)."""
    normal = np.zeros((3, 3))
    right = np.zeros(3)
    plane = np.zeros(3)
    best, best_plane = np.inf, plane.copy()
    for _ in range(iterations):
        normal[:] = 0.0
        right[:] = 0.0
        total = 0.0
        for i in range(points.shape[0]):
            x, y, z = points[i, 0], points[i, 1], points[i, 2]
            r = z - plane[0] - plane[1] * x - plane[2] * y
            weight = weight_of(r / scale, loss, tuning)
            total += loss_jet(r / scale, loss, tuning)[0]
            normal[0, 0] += weight
            normal[1, 0] += weight * x
            normal[2, 0] += weight * y
            normal[1, 1] += weight * x * x
            normal[2, 1] += weight * x * y
            normal[2, 2] += weight * y * y
            right[0] += weight * r
            right[1] += weight * r * x
            right[2] += weight * r * y
        if total < best:
            best, best_plane = total, plane.copy()
        if not solve_in_place(normal, right):
            break
        plane += right
    return best, best_plane


@njit(**OPTIONS)
def evidence(
    points: Floats,
    height: float,
    width: float,
    trend: Floats,
    table: Floats,
    scale: float,
    loss: int,
    tuning: float,
) -> float:
    """Twice the loss that the best plane has more than the template: a log likelihood ratio, doubled."""
    ridge = 0.0
    for r in residuals(points, height, width, trend, table):
        ridge += loss_jet(r / scale, loss, tuning)[0]
    return 2.0 * (plane_loss(points, scale, loss, tuning, 5)[0] - ridge)


@njit(**OPTIONS)
def explained(points: Floats, height: float, width: float, trend: Floats, table: Floats) -> float:
    """Log of the mean absolute residual of the best plane over the template's, both clipped at the height.

    Unlike evidence it grows as the noise found shrinks, so it tells good fits of different windows apart.
    """
    most = abs(height)
    plane = plane_loss(points, 0.3 * most, HUBER, 1.345, 5)[1]
    ridge = residuals(points, height, width, trend, table)
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
    """Robust scale, share of points beyond three scales, evidence at a scale of at least `contrast`."""
    scale = robust_scale(points, height, width, trend, table, floor)
    far = mean_loss(points, height, width, trend, table, scale, HUBER, tuning)[1]
    return scale, far, evidence(points, height, width, trend, table, max(scale, contrast), loss, tuning)


@njit(**INNER)
def _write_row(
    row: Floats, x: float, y: float, z: float, r_x: float, r_y: float, r_z: float, r_h: float, r_w: float
) -> None:
    """Write the residual's derivatives by a template's eight parameters, where it stands, into row (8,)."""
    row[0], row[1], row[2] = -r_x, -r_y, -r_z
    row[3], row[4], row[5] = r_y * z - r_z * y, r_z * x - r_x * z, r_x * y - r_y * x
    row[6], row[7] = r_h, r_w


@njit(**OPTIONS)
def precondition(
    points: Floats,
    height: float,
    width: float,
    trend: Floats,
    table: Floats,
    scale: float,
    prior_weight: Floats,
) -> Floats:
    """Whitening transform (8, 7) of the mean Huber loss of a template as it stands."""
    bend, rise, widening = trend[0], trend[1], trend[2]
    constant, linear, quadratic, cubic = split(table)
    normal = np.zeros((8, 8))
    row = np.empty(8)
    inverse_scale = 1.0 / scale
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        r, r_x, r_y, r_z, r_h, r_w = residual_jet(
            x, y, z, height, width, bend, rise, widening, constant, linear, quadratic, cubic
        )
        root = inverse_scale * math.sqrt(weight_of(r * inverse_scale, HUBER, 1.345))
        _write_row(row, x, y, z, r_x, r_y, r_z, r_h, r_w)
        for j in range(8):
            row[j] *= root
        for j in range(8):
            for k in range(j + 1):
                normal[j, k] += row[j] * row[k]
    for j in range(8):
        for k in range(j + 1):
            normal[j, k] /= points.shape[0]
            normal[k, j] = normal[j, k]
        normal[j, j] += prior_weight[j] / points.shape[0]
    return whitening(normal)


@njit(**OPTIONS)
def prepare(
    points: Floats,
    height: float,
    width: float,
    trend: Floats,
    table: Floats,
    floor: float,
    prior_weight: Floats,
) -> tuple[float, Floats]:
    """Robust scale and whitening transform of a template as it stands."""
    scale = robust_scale(points, height, width, trend, table, floor)
    return scale, precondition(points, height, width, trend, table, scale, prior_weight)


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
    bend, rise, widening = trend[0], trend[1], trend[2]
    constant, linear, quadratic, cubic = split(table)
    normal = np.zeros((8, 8))
    row = np.empty(8)
    inliers = 0
    psi_square = psi_slope = 0.0
    step = 1e-4
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        r, r_x, r_y, r_z, r_h, r_w = residual_jet(
            x, y, z, height, width, bend, rise, widening, constant, linear, quadratic, cubic
        )
        s = r / scale
        if not abs(s) < tuning:
            continue
        inliers += 1
        psi_square += loss_jet(s, loss, tuning)[1] ** 2
        psi_slope += (loss_jet(s + step, loss, tuning)[1] - loss_jet(s - step, loss, tuning)[1]) / (2 * step)
        _write_row(row, x, y, z, r_x, r_y, r_z, r_h, r_w)
        for j in range(8):
            for k in range(j + 1):
                normal[j, k] += row[j] * row[k]
    std = np.full(8, np.inf)
    std[0] = 0.0
    if inliers <= 8 or not psi_slope > 0.0:
        return std, inliers
    factor = scale * scale * psi_square * inliers * inliers / (psi_slope * psi_slope * (inliers - 7))
    free = normal[1:, 1:]
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
    r = residuals(points, height, width, trend, table)
    per_bin = bins.shape[1] / width
    for i in range(points.shape[0]):
        k = int(abs(points[i, 1]) * per_bin)
        if k < bins.shape[1]:
            bins[0, k] += 1.0
            bins[1, k] += min(max(r[i] / scale, -2.0), 2.0)
