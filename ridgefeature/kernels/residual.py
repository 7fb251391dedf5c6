"""Kernels of one template against scan points, in the template's frame (x along, y across, z up).

The residual of a point is its height over the ridge section, divided by the length of its gradient: the
first-order distance to the surface (Sampson 1982). Parameters are ordered

    t_x t_y t_z   translation in the start frame
    o_x o_y o_z   rotation vector about the start frame's origin
    height, width

`table` holds the section as cubics, one row a span: coefficients of 1, x, x^2, x^3 with x in [0, 1); the first and
the last row are zeros and stand for what lies outside the feet.
`trend` (3,) holds what the neighbours tell and the fit takes as given: the curvature of the path (y is measured
from the osculating circle, to second order), and the slopes of height and width along x. A template alone has
zeros.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from ridgefeature.kernels.algebra import rotation_of, solve_in_place, whitening

HUBER, TUKEY, SQUARE, CAUCHY = 0, 1, 2, 3

# Sums may be reordered and divisions go unchecked: the loops over points then run in SIMD, three times faster.
_INNER: dict[str, Any] = {"fastmath": True, "error_model": "numpy"}
_OPTIONS: dict[str, Any] = {"cache": True, **_INNER}


@njit(**_INNER)
def residual_jet(x, y, z, height, width, bend, rise, widening, constant, linear, quadratic, cubic):
    """Residual and its derivatives with respect to x, y, z, height and width. Free of branches, for SIMD.

    The trend as its three numbers, the table as its four columns: tuples would hinder SIMD.
    """
    spans = constant.size - 2.0
    lean = bend * x / max(1.0 - bend * y, 0.2)
    height += rise * x
    inverse_width = 1.0 / max(width + widening * x, 0.1 * width)
    eta = (y - 0.5 * lean * x) * inverse_width
    position = min(max((eta + 0.5) * spans + 1.0, 0.5), spans + 1.5)
    span = np.int64(position)
    t = position - span
    b, c, d = linear[span], quadratic[span], cubic[span]
    g = constant[span] + t * (b + t * (c + t * d))
    per_y = spans * inverse_width
    slope = per_y * (b + t * (2.0 * c + 3.0 * t * d))
    f1 = height * slope
    f2 = height * per_y * per_y * (2.0 * c + 6.0 * t * d)
    square = 1.0 / (1.0 + f1 * f1)
    inverse = math.sqrt(square)
    r = (z - height * g) * inverse
    curl = r * f1 * square
    r_y = -f1 * inverse - curl * f2
    r_h = -g * inverse - curl * slope
    r_w = eta * f1 * inverse + curl * (eta * f2 + f1 * inverse_width)
    r_x = -r_y * lean + r_h * rise + r_w * widening
    r_y *= 1.0 - 0.5 * lean * lean
    return r, r_x, r_y, inverse, r_h, r_w


@njit(**_INNER)
def columns(array):
    """The columns of an array (n, 3), each contiguous: loops over them run in SIMD, which is worth the copy."""
    return array[:, 0].copy(), array[:, 1].copy(), array[:, 2].copy()


@njit(**_INNER)
def split(table):
    """The four columns of a section's table, each contiguous."""
    return table[:, 0].copy(), table[:, 1].copy(), table[:, 2].copy(), table[:, 3].copy()


@njit(**_INNER)
def loss_jet(x, loss, tuning):
    """Loss rho(x) and its derivative psi(x), for a residual in units of its scale."""
    if loss == TUKEY:
        q = max(1.0 - (x / tuning) * (x / tuning), 0.0)
        return tuning * tuning / 6.0 * (1.0 - q * q * q), x * q * q
    if loss == HUBER:
        psi = min(max(x, -tuning), tuning)
        return psi * (x - 0.5 * psi), psi
    if loss == CAUCHY:
        q = 1.0 + (x / tuning) * (x / tuning)
        return 0.5 * tuning * tuning * math.log(q), x / q
    return 0.5 * x * x, x


@njit(**_INNER)
def weight_of(x, loss, tuning):
    """Weight psi(x) / x of a residual in units of its scale."""
    if loss == TUKEY:
        return max(1.0 - (x / tuning) * (x / tuning), 0.0) ** 2
    if loss == HUBER:
        return tuning / max(abs(x), tuning)
    if loss == CAUCHY:
        return 1.0 / (1.0 + (x / tuning) * (x / tuning))
    return 1.0


@njit(**_INNER)
def _sums(points, p, rotation, trend, table, scale, loss, tuning):
    """Sum of the loss, and of psi times the residual's gradient: by x, y, z, rotation about x, y, z, height, width."""
    inverse_scale = 1.0 / scale
    p0, p1, p2, height, width = p[0], p[1], p[2], p[6], p[7]
    r00, r10, r20 = rotation[0, 0], rotation[1, 0], rotation[2, 0]
    r01, r11, r21 = rotation[0, 1], rotation[1, 1], rotation[2, 1]
    r02, r12, r22 = rotation[0, 2], rotation[1, 2], rotation[2, 2]
    total = g_x = g_y = g_z = c_x = c_y = c_z = g_h = g_w = 0.0
    column_x, column_y, column_z = columns(points)
    bend, rise, widening = trend[0], trend[1], trend[2]
    constant, linear, quadratic, cubic = split(table)
    for i in range(column_x.size):
        dx, dy, dz = column_x[i] - p0, column_y[i] - p1, column_z[i] - p2
        x = r00 * dx + r10 * dy + r20 * dz
        y = r01 * dx + r11 * dy + r21 * dz
        z = r02 * dx + r12 * dy + r22 * dz
        r, r_x, r_y, r_z, r_h, r_w = residual_jet(
            x, y, z, height, width, bend, rise, widening, constant, linear, quadratic, cubic
        )
        rho, psi = loss_jet(r * inverse_scale, loss, tuning)
        total += rho
        a, b, c = psi * r_y, psi * r_z, psi * r_x
        g_x += c
        g_y += a
        g_z += b
        # A rotation phi of the body moves a point by u x phi, so the sum is of gradient x u.
        c_x += a * z - b * y
        c_y += b * x - c * z
        c_z += c * y - a * x
        g_h += psi * r_h
        g_w += psi * r_w
    return total, g_x, g_y, g_z, c_x, c_y, c_z, g_h, g_w


@njit(**_OPTIONS)
def objective(q, gradient, transform, start, prior, trend, points, table, scale, loss, tuning):
    """Mean robust loss at parameters start + transform @ q; its gradient in q is written to `gradient`.

    points (n, 3) in the start frame; start (8,); transform (8, m); q (m,). prior (2, 8): expected parameters and
    their reciprocal variances; it counts once, whatever the number of points.
    """
    p = start.copy()
    for i in range(8):
        for j in range(q.size):
            p[i] += transform[i, j] * q[j]
    rotation, jacobian = rotation_of(p[3:6])
    # One loop for each loss: a loop that asks which loss it is does not run in SIMD.
    if loss == TUKEY:
        sums = _sums(points, p, rotation, trend, table, scale, TUKEY, tuning)
    elif loss == HUBER:
        sums = _sums(points, p, rotation, trend, table, scale, HUBER, tuning)
    elif loss == CAUCHY:
        sums = _sums(points, p, rotation, trend, table, scale, CAUCHY, tuning)
    else:
        sums = _sums(points, p, rotation, trend, table, scale, SQUARE, tuning)
    total, g_x, g_y, g_z, c_x, c_y, c_z, g_h, g_w = sums
    if gradient.size > 0:
        full = np.empty(8)
        for i in range(3):
            full[i] = -(rotation[i, 0] * g_x + rotation[i, 1] * g_y + rotation[i, 2] * g_z)
            full[3 + i] = jacobian[0, i] * c_x + jacobian[1, i] * c_y + jacobian[2, i] * c_z
        full[6], full[7] = g_h, g_w
        for i in range(8):
            full[i] += scale * prior[1, i] * (p[i] - prior[0, i])
        norm = 1.0 / (scale * points.shape[0])
        for j in range(q.size):
            s = 0.0
            for i in range(8):
                s += transform[i, j] * full[i]
            gradient[j] = s * norm
    for i in range(8):
        total += 0.5 * prior[1, i] * (p[i] - prior[0, i]) ** 2
    return total / points.shape[0]


@njit(**_OPTIONS)
def deviations(points, height, width, trend, table, scale, loss, tuning):
    """Standard deviations (8,) of a fitted template's parameters, and its number of inliers.

    The asymptotic variance of an M-estimator (Huber 1981, 7.6) with its small-sample factor, from the points within
    `tuning` scales. points (n, 3) in the template's frame. Infinite where the points do not tell.
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
        row[0], row[1], row[2] = -r_x, -r_y, -r_z
        row[3], row[4], row[5] = r_y * z - r_z * y, r_z * x - r_x * z, r_x * y - r_y * x
        row[6], row[7] = r_h, r_w
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


@njit(**_OPTIONS)
def robust_scale(points, height, width, trend, table, floor):
    """Standard deviation of the residuals from the median of their absolute values, not below floor."""
    bend, rise, widening = trend[0], trend[1], trend[2]
    constant, linear, quadratic, cubic = split(table)
    out = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        out[i] = abs(
            residual_jet(
                points[i, 0],
                points[i, 1],
                points[i, 2],
                height,
                width,
                bend,
                rise,
                widening,
                constant,
                linear,
                quadratic,
                cubic,
            )[0]
        )
    return max(1.4826 * np.median(out), floor)


@njit(**_OPTIONS)
def precondition(points, height, width, trend, table, scale, prior_weight):
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
        row[0], row[1], row[2] = -r_x * root, -r_y * root, -r_z * root
        row[3], row[4], row[5] = (
            (r_y * z - r_z * y) * root,
            (r_z * x - r_x * z) * root,
            (r_x * y - r_y * x) * root,
        )
        row[6], row[7] = r_h * root, r_w * root
        for j in range(8):
            for k in range(j + 1):
                normal[j, k] += row[j] * row[k]
    for j in range(8):
        for k in range(j + 1):
            normal[j, k] /= points.shape[0]
            normal[k, j] = normal[j, k]
        normal[j, j] += prior_weight[j] / points.shape[0]
    return whitening(normal)


@njit(**_OPTIONS)
def prepare(points, height, width, trend, table, floor, prior_weight):
    """Robust scale and whitening transform of a template as it stands."""
    scale = robust_scale(points, height, width, trend, table, floor)
    return scale, precondition(points, height, width, trend, table, scale, prior_weight)


@njit(**_OPTIONS)
def assess(points, height, width, trend, table, floor, contrast, loss, tuning):
    """Robust scale, share of points beyond three scales, and evidence at no less than the scale `contrast`."""
    scale = robust_scale(points, height, width, trend, table, floor)
    far = mean_loss(points, height, width, trend, table, scale, HUBER, tuning)[1]
    return scale, far, evidence(points, height, width, trend, table, max(scale, contrast), loss, tuning)


@njit(**_OPTIONS)
def mean_loss(points, height, width, trend, table, scale, loss, tuning):
    """Mean robust loss of a template as it stands, and the share of points beyond three scales."""
    bend, rise, widening = trend[0], trend[1], trend[2]
    constant, linear, quadratic, cubic = split(table)
    total, far = 0.0, 0
    for i in range(points.shape[0]):
        r = (
            residual_jet(
                points[i, 0],
                points[i, 1],
                points[i, 2],
                height,
                width,
                bend,
                rise,
                widening,
                constant,
                linear,
                quadratic,
                cubic,
            )[0]
            / scale
        )
        total += loss_jet(r, loss, tuning)[0]
        far += abs(r) > 3.0
    return total / points.shape[0], far / points.shape[0]


@njit(**_OPTIONS)
def residuals(points, height, width, trend, table):
    """Residuals (n,) of points (n, 3) in the template's frame."""
    bend, rise, widening = trend[0], trend[1], trend[2]
    constant, linear, quadratic, cubic = split(table)
    out = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        out[i] = residual_jet(
            points[i, 0],
            points[i, 1],
            points[i, 2],
            height,
            width,
            bend,
            rise,
            widening,
            constant,
            linear,
            quadratic,
            cubic,
        )[0]
    return out


@njit(**_OPTIONS)
def add_misfit(bins, points, height, width, trend, table, scale):
    """Add to bins (2, m) the number and the sum of clipped residuals, in scales, by distance from the spine.

    The m bins share the distances up to the width. points (n, 3) in the template's frame.
    """
    bend, rise, widening = trend[0], trend[1], trend[2]
    constant, linear, quadratic, cubic = split(table)
    per_bin = bins.shape[1] / width
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        r = residual_jet(x, y, z, height, width, bend, rise, widening, constant, linear, quadratic, cubic)[0]
        k = int(abs(y) * per_bin)
        if k < bins.shape[1]:
            bins[0, k] += 1.0
            bins[1, k] += min(max(r / scale, -2.0), 2.0)


@njit(**_OPTIONS)
def evidence(points, height, width, trend, table, scale, loss, tuning):
    """Twice the loss that a plane has more than the template; points (n, 3) in the template's frame."""
    bend, rise, widening = trend[0], trend[1], trend[2]
    constant, linear, quadratic, cubic = split(table)
    ridge = 0.0
    for i in range(points.shape[0]):
        r = residual_jet(
            points[i, 0],
            points[i, 1],
            points[i, 2],
            height,
            width,
            bend,
            rise,
            widening,
            constant,
            linear,
            quadratic,
            cubic,
        )[0]
        ridge += loss_jet(r / scale, loss, tuning)[0]
    return 2.0 * (plane_loss(points, scale, loss, tuning, 5)[0] - ridge)


@njit(**_OPTIONS)
def losses(x, loss, tuning):
    """Loss (n,) of residuals x (n,) in units of their scale."""
    out = np.empty(x.size)
    for i in range(x.size):
        out[i] = loss_jet(x[i], loss, tuning)[0]
    return out


@njit(**_OPTIONS)
def plane_loss(points, scale, loss, tuning, iterations):
    """Smallest robust loss of a plane z = a + b x + c y found by reweighting, and the plane; points (n, 3)."""
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


@njit(**_OPTIONS)
def explained(points, height, width, trend, table):
    """Log of the mean absolute residual of the best plane over that of the template, both clipped at the height.

    points (n, 3) in the template's frame. Unlike evidence it grows as the noise found shrinks, so it tells good
    fits of different windows apart.
    """
    most = abs(height)
    plane = plane_loss(points, 0.3 * most, HUBER, 1.345, 5)[1]
    ridge = residuals(points, height, width, trend, table)
    flat = points[:, 2] - plane[0] - plane[1] * points[:, 0] - plane[2] * points[:, 1]
    least = 1e-3 * most * points.shape[0]
    return math.log(
        (np.minimum(np.abs(flat), most).sum() + least) / (np.minimum(np.abs(ridge), most).sum() + least)
    )
