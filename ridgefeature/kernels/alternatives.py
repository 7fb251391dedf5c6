"""What a smooth surface, a step or a crease explains of the points that a ridge is fitted to.

Points are (n, 3) in the template's frame; `trend` and `table` are as in kernels.residual.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import copy_into, solve_in_place
from ridgefeature.kernels.appraise import residuals_of
from ridgefeature.kernels.residual import INNER, OPTIONS

Floats = NDArray[np.float64]

_HUBER = 1.345
ROUNDS = 7
_FEW_ROUNDS = 4
_SPLITS = 15
_FEWEST = 6


@njit(**INNER)
def robust_loss(design: Floats, z: Floats, scale: float, tuning: float, rounds: int = ROUNDS) -> float:
    """Smallest loss (Tukey's) of a linear model design (n, p) of z (n,) that reweighting finds.

    Least squares, two rounds with Huber's weights, then Tukey's (Holland and Welsch 1977).
    """
    n, p = design.shape
    normal, right = np.zeros((p, p)), np.zeros(p)
    r = z.copy()
    best = n * tuning * tuning / 6.0
    for turn in range(rounds):
        normal[:] = 0.0
        right[:] = 0.0
        for i in range(n):
            x = abs(r[i]) / scale
            if turn == 0:
                weight = 1.0
            elif turn < 3:
                weight = _HUBER / max(x, _HUBER)
            else:
                weight = max(1.0 - (x / tuning) ** 2, 0.0) ** 2
            for a in range(p):
                w = weight * design[i, a]
                right[a] += w * z[i]
                for b in range(a + 1):
                    normal[a, b] += w * design[i, b]
        for a in range(p):
            normal[a, a] *= 1.0 + 1e-10
        if not solve_in_place(normal, right):
            break
        loss = 0.0
        for i in range(n):
            value = z[i]
            for a in range(p):
                value -= design[i, a] * right[a]
            r[i] = value
            q = max(1.0 - (value / scale / tuning) ** 2, 0.0)
            loss += tuning * tuning / 6.0 * (1.0 - q * q * q)
        best = min(best, loss)
    return best


@njit(**INNER)
def powers(x: Floats, y: Floats, degree: int, spare: int) -> Floats:
    """All x^i y^j with i + j <= degree, and `spare` columns of zeros after them."""
    count = (degree + 1) * (degree + 2) // 2
    out = np.zeros((x.size, count + spare))
    for k in range(x.size):
        column, along = 0, 1.0
        for i in range(degree + 1):
            term = along
            for _ in range(degree + 1 - i):
                out[k, column] = term
                term *= y[k]
                column += 1
            along *= x[k]
    return out


@njit(**OPTIONS)
def advantage(
    points: Floats,
    seen: Floats,
    height: float,
    width: float,
    trend: Floats,
    table: Floats,
    half_length: float,
    half_breadth: float,
    scale: float,
    tuning: float,
) -> tuple[float, float]:
    """Twice the loss that a smooth surface, and a step or crease, have more than the ridge.

    The ridge stands on any base of second degree. The smooth surface is a cubic polynomial; the step or
    crease is two planes that meet, or do not, along the best of 15 lines parallel to the spine. Residuals are
    across the template's base, in units of `scale`. seen (n, 3): the points as the smooth surface and the
    edge are to explain them, flattened or not.
    """
    n = len(points)
    x, y, z = points[:, 0] / half_length, points[:, 1] / half_breadth, points[:, 2].copy()
    ridge = powers(x, y, 2, 1)
    copy_into(ridge[:, 6], (z - residuals_of(points, height, width, trend, table)) / height)
    on_ridge = robust_loss(ridge, z, scale, tuning)
    x, y, z = seen[:, 0] / half_length, seen[:, 1] / half_breadth, seen[:, 2].copy()
    smooth = robust_loss(powers(x, y, 3, 0), z, scale, tuning)
    planes = powers(x, y, 1, 3)
    edge, best = n * tuning * tuning / 6.0, -1
    for k in range(_SPLITS + 1):  # all in a few rounds, then the best once more
        at, beyond = -0.7 + 1.4 * (k if k < _SPLITS else best) / (_SPLITS - 1), 0
        for i in range(n):
            side = 1.0 if y[i] > at else 0.0
            beyond += y[i] > at
            for a in range(3):
                planes[i, 3 + a] = side * planes[i, a]
        if _FEWEST <= beyond <= n - _FEWEST:
            loss = robust_loss(planes, z, scale, tuning, _FEW_ROUNDS if k < _SPLITS else ROUNDS)
            if loss < edge:
                edge, best = loss, k
    return 2.0 * (smooth - on_ridge), 2.0 * (edge - on_ridge)
