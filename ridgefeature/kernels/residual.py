"""Kernels of one template against scan points, in the template's frame (x along, y across, z up).

The residual of a point is its height over the ridge section, divided by the length of its gradient: the
first-order distance to the surface (Sampson 1982). Parameters are ordered

    t_x t_y t_z   translation in the start frame
    o_x o_y o_z   rotation vector about the start frame's origin
    height, width

`table` holds the section as cubics, one row a span: coefficients of 1, x, x^2, x^3 with x in [0, 1).
`trend` (3,) holds what the neighbours tell and the fit takes as given: the curvature of the path (y is measured
from the osculating circle, to second order), and the slopes of height and width along x. A template alone has
zeros.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ridgefeature.kernels.algebra import rotation_of, solve_in_place, whitening

HUBER, TUKEY, SQUARE, CAUCHY = 0, 1, 2, 3


@njit(cache=True, inline="always")
def residual_jet(x, y, z, height, width, trend, table):
    """Residual and its derivatives with respect to x, y, z, height and width."""
    spans = table.shape[0]
    across = 1.0 / max(1.0 - trend[0] * y, 0.2)
    lean = trend[0] * x * across
    y -= 0.5 * lean * x
    height += trend[1] * x
    inverse_width = 1.0 / max(width + trend[2] * x, 0.1 * width)
    eta = y * inverse_width
    position = (eta + 0.5) * spans
    if not 0.0 <= position < spans:
        return z, 0.0, 0.0, 1.0, 0.0, 0.0
    span = int(position)
    t = position - span
    b, c, d = table[span, 1], table[span, 2], table[span, 3]
    g = table[span, 0] + t * (b + t * (c + t * d))
    per_y = spans * inverse_width
    slope = per_y * (b + t * (2.0 * c + 3.0 * t * d))
    f1 = height * slope
    f2 = height * per_y * per_y * (2.0 * c + 6.0 * t * d)
    square = 1.0 / (1.0 + f1 * f1)
    inverse = math.sqrt(square)
    r = (z - height * g) * inverse
    bend = r * f1 * square
    r_y = -f1 * inverse - bend * f2
    r_h = -g * inverse - bend * slope
    r_w = eta * f1 * inverse + bend * (eta * f2 + f1 * inverse_width)
    r_x = -r_y * lean + r_h * trend[1] + r_w * trend[2]
    r_y *= 1.0 - 0.5 * lean * lean
    return r, r_x, r_y, inverse, r_h, r_w


@njit(cache=True, inline="always")
def loss_jet(x, loss, tuning):
    """Loss rho(x), its derivative psi(x) and the weight psi(x) / x, for a residual in units of its scale."""
    if loss == TUKEY:
        if abs(x) >= tuning:
            return tuning * tuning / 6.0, 0.0, 0.0
        q = 1.0 - (x / tuning) ** 2
        return tuning * tuning / 6.0 * (1.0 - q * q * q), x * q * q, q * q
    if loss == HUBER:
        if abs(x) <= tuning:
            return 0.5 * x * x, x, 1.0
        return tuning * (abs(x) - 0.5 * tuning), math.copysign(tuning, x), tuning / abs(x)
    if loss == CAUCHY:
        q = 1.0 + (x / tuning) ** 2
        return 0.5 * tuning * tuning * math.log(q), x / q, 1.0 / q
    return 0.5 * x * x, x, 1.0


@njit(cache=True)
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
    height, width = p[6], p[7]
    inverse_scale = 1.0 / scale
    total = 0.0
    g_x = g_y = g_z = c_x = c_y = c_z = g_h = g_w = 0.0
    for i in range(points.shape[0]):
        dx, dy, dz = points[i, 0] - p[0], points[i, 1] - p[1], points[i, 2] - p[2]
        x = rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz
        y = rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz
        z = rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz
        r, r_x, r_y, r_z, r_h, r_w = residual_jet(x, y, z, height, width, trend, table)
        rho, psi, _ = loss_jet(r * inverse_scale, loss, tuning)
        total += rho
        a, b, c = psi * r_y, psi * r_z, psi * r_x
        g_x += c
        g_y += a
        g_z += b
        c_x += a * z - b * y
        c_y += b * x - c * z
        c_z += c * y - a * x
        g_h += psi * r_h
        g_w += psi * r_w
    # The residual's gradient in the body frame is (r_x, r_y, r_z); a body rotation moves u by u x phi.
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


@njit(cache=True)
def deviations(points, height, width, trend, table, scale, loss, tuning):
    """Standard deviations (8,) of a fitted template's parameters, and its number of inliers.

    The asymptotic variance of an M-estimator (Huber 1981, 7.6) with its small-sample factor, from the points within
    `tuning` scales. points (n, 3) in the template's frame. Infinite where the points do not tell.
    """
    normal = np.zeros((8, 8))
    row = np.empty(8)
    inliers = 0
    psi_square = psi_slope = 0.0
    step = 1e-4
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        r, r_x, r_y, r_z, r_h, r_w = residual_jet(x, y, z, height, width, trend, table)
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


@njit(cache=True)
def robust_scale(points, height, width, trend, table, floor):
    """Standard deviation of the residuals from the median of their absolute values, not below floor."""
    out = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        out[i] = abs(residual_jet(points[i, 0], points[i, 1], points[i, 2], height, width, trend, table)[0])
    return max(1.4826 * np.median(out), floor)


@njit(cache=True)
def precondition(points, height, width, trend, table, scale, prior_weight):
    """Whitening transform (8, 7) of the mean Huber loss of a template as it stands, from a few hundred points."""
    normal = np.zeros((8, 8))
    row = np.empty(8)
    step = max(points.shape[0] // 300, 1)
    count = 0
    inverse_scale = 1.0 / scale
    for i in range(0, points.shape[0], step):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        r, r_x, r_y, r_z, r_h, r_w = residual_jet(x, y, z, height, width, trend, table)
        root = inverse_scale * math.sqrt(loss_jet(r * inverse_scale, HUBER, 1.345)[2])
        row[0], row[1], row[2] = -r_x * root, -r_y * root, -r_z * root
        row[3], row[4], row[5] = (r_y * z - r_z * y) * root, (r_z * x - r_x * z) * root, (r_x * y - r_y * x) * root
        row[6], row[7] = r_h * root, r_w * root
        for j in range(8):
            for k in range(j + 1):
                normal[j, k] += row[j] * row[k]
        count += 1
    for j in range(8):
        for k in range(j + 1):
            normal[j, k] /= count
            normal[k, j] = normal[j, k]
        normal[j, j] += prior_weight[j] / points.shape[0]
    return whitening(normal)


@njit(cache=True)
def mean_loss(points, height, width, trend, table, scale, loss, tuning):
    """Mean robust loss of a template as it stands, and the share of points beyond three scales."""
    total, far = 0.0, 0
    for i in range(points.shape[0]):
        r = residual_jet(points[i, 0], points[i, 1], points[i, 2], height, width, trend, table)[0] / scale
        total += loss_jet(r, loss, tuning)[0]
        far += abs(r) > 3.0
    return total / points.shape[0], far / points.shape[0]


@njit(cache=True)
def residuals(points, height, width, trend, table):
    """Residuals (n,) of points (n, 3) in the template's frame."""
    out = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        out[i] = residual_jet(points[i, 0], points[i, 1], points[i, 2], height, width, trend, table)[0]
    return out


@njit(cache=True)
def evidence(points, height, width, trend, table, scale, loss, tuning):
    """Twice the loss that a plane has more than the template; points (n, 3) in the template's frame."""
    ridge = 0.0
    for i in range(points.shape[0]):
        r = residual_jet(points[i, 0], points[i, 1], points[i, 2], height, width, trend, table)[0]
        ridge += loss_jet(r / scale, loss, tuning)[0]
    return 2.0 * (plane_loss(points, scale, loss, tuning, 5) - ridge)


@njit(cache=True)
def losses(x, loss, tuning):
    """Loss (n,) of residuals x (n,) in units of their scale."""
    out = np.empty(x.size)
    for i in range(x.size):
        out[i] = loss_jet(x[i], loss, tuning)[0]
    return out


@njit(cache=True)
def plane_loss(points, scale, loss, tuning, iterations):
    """Smallest robust loss of a plane z = a + b x + c y found by reweighting; points (n, 3)."""
    normal = np.zeros((3, 3))
    right = np.zeros(3)
    plane = np.zeros(3)
    best = np.inf
    for _ in range(iterations):
        normal[:] = 0.0
        right[:] = 0.0
        total = 0.0
        for i in range(points.shape[0]):
            x, y, z = points[i, 0], points[i, 1], points[i, 2]
            r = z - plane[0] - plane[1] * x - plane[2] * y
            rho, _, weight = loss_jet(r / scale, loss, tuning)
            total += rho
            normal[0, 0] += weight
            normal[1, 0] += weight * x
            normal[2, 0] += weight * y
            normal[1, 1] += weight * x * x
            normal[2, 1] += weight * x * y
            normal[2, 2] += weight * y * y
            right[0] += weight * r
            right[1] += weight * r * x
            right[2] += weight * r * y
        best = min(best, total)
        if not solve_in_place(normal, right):
            break
        plane += right
    return best
