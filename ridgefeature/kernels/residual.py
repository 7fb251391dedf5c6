"""Kernels of one template against scan points, in the template's frame (x along, y across, z up).

The residual of a point is its height over the ridge section, divided by the length of its gradient: the
first-order distance to the surface (Sampson 1982). Parameters are ordered

    t_x t_y t_z   translation in the start frame
    o_x o_y o_z   rotation vector about the start frame's origin
    height, width

`table` holds the section as cubics, one row a span: coefficients of 1, x, x^2, x^3 with x in [0, 1); the
first and the last row are zeros and stand for what lies outside the feet. `trend` (3,) holds what the
neighbours tell and the fit takes as given: the curvature of the path (y is measured from the osculating
circle, to second order), and the slopes of height and width along x. A template alone has zeros.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import rotation_of

Floats = NDArray[np.float64]
HUBER, TUKEY, SQUARE, CAUCHY = 0, 1, 2, 3

# Sums may be reordered and divisions go unchecked: loops over points then run in SIMD, three times faster.
# Inlined by force: else which of several cached copies is linked, and so the last bit, would depend on the
# order in which kernels were loaded.
INNER: dict[str, Any] = {"fastmath": True, "error_model": "numpy", "forceinline": True}
OPTIONS: dict[str, Any] = {"cache": True, "fastmath": True, "error_model": "numpy"}


@njit(**INNER)
def residual_jet(
    x: float,
    y: float,
    z: float,
    height: float,
    width: float,
    bend: float,
    rise: float,
    widening: float,
    constant: Floats,
    linear: Floats,
    quadratic: Floats,
    cubic: Floats,
) -> tuple[float, float, float, float, float, float]:
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


@njit(**INNER)
def columns(array: Floats) -> tuple[Floats, Floats, Floats]:
    """The columns of an array (n, 3), each contiguous: loops over them run in SIMD, worth the copy."""
    return array[:, 0].copy(), array[:, 1].copy(), array[:, 2].copy()


@njit(**INNER)
def split(table: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """The four columns of a section's table, each contiguous."""
    return table[:, 0].copy(), table[:, 1].copy(), table[:, 2].copy(), table[:, 3].copy()


@njit(**INNER)
def loss_jet(x: float, loss: int, tuning: float) -> tuple[float, float]:
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


@njit(**INNER)
def weight_of(x: float, loss: int, tuning: float) -> float:
    """Weight psi(x) / x of a residual in units of its scale."""
    if loss == TUKEY:
        return max(1.0 - (x / tuning) * (x / tuning), 0.0) ** 2
    if loss == HUBER:
        return tuning / max(abs(x), tuning)
    if loss == CAUCHY:
        return 1.0 / (1.0 + (x / tuning) * (x / tuning))
    return 1.0


@njit(**INNER)
def _sums(
    points: Floats,
    p: Floats,
    rotation: Floats,
    trend: Floats,
    table: Floats,
    scale: float,
    loss: int,
    tuning: float,
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Sums of the loss and of psi times the residual's gradient: by x, y, z, turns, height and width."""
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


@njit(**OPTIONS)
def objective(
    q: Floats,
    gradient: Floats,
    transform: Floats,
    start: Floats,
    prior: Floats,
    trend: Floats,
    points: Floats,
    table: Floats,
    scale: float,
    loss: int,
    tuning: float,
) -> float:
    """Mean robust loss at parameters start + transform @ q; its gradient in q is written to `gradient`.

    points (n, 3) in the start frame; start (8,); transform (8, m); q (m,). prior (2, 8): expected parameters
    and their reciprocal variances; it counts once, whatever the number of points.
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
