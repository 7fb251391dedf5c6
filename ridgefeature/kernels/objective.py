"""What NLopt minimises: the mean robust loss of one template, its problem packed in one array.

A packed problem is a single array, so that a C optimiser can hand it through as an address:

    size, number of points, rows of the table, loss, tuning, scale,
    start (8), prior (2, 8), trend (3), transform (8, 7),
    the table's four columns, and the points' x, y and z
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import carray, cfunc, njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import copy_into, rotation_of
from ridgefeature.kernels.residual import (
    CAUCHY,
    HUBER,
    INNER,
    OPTIONS,
    SQUARE,
    TUKEY,
    loss_jet,
    residual_jet,
)

Floats = NDArray[np.float64]
FREE = 7
_START, _PRIOR, _TREND, _TRANSFORM, _TABLE = 6, 14, 30, 33, 89


@njit(**INNER)
def pack(
    points: Floats,
    start: Floats,
    prior: Floats,
    trend: Floats,
    transform: Floats,
    table: Floats,
    scale: float,
    loss: int,
    tuning: float,
) -> Floats:
    """The packed problem.

    points (n, 3) in the start frame; start (8,); transform (8, 7); prior (2, 8): expected parameters and
    their reciprocal variances, which count once, whatever the number of points; table (rows, 4).
    """
    n, rows = points.shape[0], table.shape[0]
    out = np.empty(_TABLE + 4 * rows + 3 * n)
    out[0], out[1], out[2], out[3], out[4], out[5] = out.size, n, rows, loss, tuning, scale
    copy_into(out[_START:_PRIOR], start)
    copy_into(out[_PRIOR:_TREND], prior.ravel())
    copy_into(out[_TREND:_TRANSFORM], trend)
    copy_into(out[_TRANSFORM:_TABLE], transform.ravel())
    for j in range(4):
        copy_into(out[_TABLE + j * rows : _TABLE + (j + 1) * rows], table[:, j])
    at = _TABLE + 4 * rows
    for j in range(3):
        copy_into(out[at + j * n : at + (j + 1) * n], points[:, j])
    return out


@njit(**INNER)
def _sums(
    problem: Floats, p: Floats, rotation: Floats, loss: int
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Sums of the loss and of psi times the residual's gradient: by x, y, z, turns, height and width."""
    n, rows = int(problem[1]), int(problem[2])
    tuning, inverse_scale = problem[4], 1.0 / problem[5]
    p0, p1, p2, height, width = p[0], p[1], p[2], p[6], p[7]
    r00, r10, r20 = rotation[0, 0], rotation[1, 0], rotation[2, 0]
    r01, r11, r21 = rotation[0, 1], rotation[1, 1], rotation[2, 1]
    r02, r12, r22 = rotation[0, 2], rotation[1, 2], rotation[2, 2]
    total = g_x = g_y = g_z = c_x = c_y = c_z = g_h = g_w = 0.0
    bend, rise, widening = problem[_TREND], problem[_TREND + 1], problem[_TREND + 2]
    columns = problem[_TABLE : _TABLE + 4 * rows]
    constant, linear = columns[:rows], columns[rows : 2 * rows]
    quadratic, cubic = columns[2 * rows : 3 * rows], columns[3 * rows :]
    places = problem[_TABLE + 4 * rows : _TABLE + 4 * rows + 3 * n]
    column_x, column_y, column_z = places[:n], places[n : 2 * n], places[2 * n :]
    for i in range(n):
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


@njit(**INNER)
def _evaluate(q: Floats, gradient: Floats, problem: Floats) -> float:
    scale, points = problem[5], problem[1]
    start = problem[_START:_PRIOR]
    expected, weight = problem[_PRIOR : _PRIOR + 8], problem[_PRIOR + 8 : _TREND]
    transform = problem[_TRANSFORM:_TABLE]
    p = start.copy()
    for i in range(8):
        for j in range(FREE):
            p[i] += transform[i * FREE + j] * q[j]
    rotation, jacobian = rotation_of(p[3:6])
    # One loop for each loss: a loop that asks which loss it is does not run in SIMD.
    if problem[3] == TUKEY:
        sums = _sums(problem, p, rotation, TUKEY)
    elif problem[3] == HUBER:
        sums = _sums(problem, p, rotation, HUBER)
    elif problem[3] == CAUCHY:
        sums = _sums(problem, p, rotation, CAUCHY)
    else:
        sums = _sums(problem, p, rotation, SQUARE)
    total, g_x, g_y, g_z, c_x, c_y, c_z, g_h, g_w = sums
    if gradient.size > 0:
        full = np.empty(8)
        for i in range(3):
            full[i] = -(rotation[i, 0] * g_x + rotation[i, 1] * g_y + rotation[i, 2] * g_z)
            full[3 + i] = jacobian[0, i] * c_x + jacobian[1, i] * c_y + jacobian[2, i] * c_z
        full[6], full[7] = g_h, g_w
        for i in range(8):
            full[i] += scale * weight[i] * (p[i] - expected[i])
        norm = 1.0 / (scale * points)
        for j in range(FREE):
            s = 0.0
            for i in range(8):
                s += transform[i * FREE + j] * full[i]
            gradient[j] = s * norm
    for i in range(8):
        total += 0.5 * weight[i] * (p[i] - expected[i]) ** 2
    return total / points


@njit(**OPTIONS)
def objective(q: Floats, gradient: Floats, problem: Floats) -> float:
    """Mean robust loss at start + transform @ q, q (7,); its gradient (7,) is written where it has a size."""
    return _evaluate(q, gradient, problem)


@intrinsic
def _pointer(typing: Any, address: Any) -> Any:
    """An address as a pointer."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(types.voidptr))

    return types.voidptr(address), generate


@cache
def callback() -> Any:
    """`objective` as a C function for NLopt: (n, q, gradient or null, problem), addresses as integers."""

    @cfunc("float64(uint32, intp, intp, intp)", **OPTIONS)
    def evaluate(n: Any, q: Any, gradient: Any, problem: Any) -> float:
        size = int(carray(_pointer(problem), 1, np.float64)[0])
        wanted = FREE if gradient != 0 else 0
        # A null pointer is not read: the array over it is empty.
        return _evaluate(
            carray(_pointer(q), FREE, np.float64),
            carray(_pointer(gradient), wanted, np.float64),
            carray(_pointer(problem), size, np.float64),
        )

    return evaluate
