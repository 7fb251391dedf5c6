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

Floats = NDArray[np.float64]
HUBER, TUKEY, SQUARE, CAUCHY = 0, 1, 2, 3

# Sums may be reordered and divisions go unchecked: loops over points then run in SIMD, three times faster.
# What other kernels call is inlined by force: else which of several cached copies is linked, and so the last
# bit, would depend on the order in which kernels were loaded.
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


@njit(**OPTIONS)
def sampled(
    height: float,
    width: float,
    trend: Floats,
    table: Floats,
    length: float,
    half_breadth: float,
    along: int,
    across: int,
) -> Floats:
    """Points (along * across, 3) at the middles of as many equal cells of a template, in its frame."""
    spans = table.shape[0] - 2.0
    out = np.empty((along * across, 3))
    for i in range(along):
        x = ((i + 0.5) / along - 0.5) * length
        for j in range(across):
            y = ((j + 0.5) / across * 2.0 - 1.0) * half_breadth
            eta = y / max(width + trend[2] * x, 0.1 * width)
            position = min(max((eta + 0.5) * spans + 1.0, 0.5), spans + 1.5)
            span = np.int64(position)
            t = position - span
            g = table[span, 0] + t * (table[span, 1] + t * (table[span, 2] + t * table[span, 3]))
            row = out[i * across + j]
            row[0], row[1], row[2] = x, y + 0.5 * trend[0] * x * x, (height + trend[1] * x) * g
    return out
