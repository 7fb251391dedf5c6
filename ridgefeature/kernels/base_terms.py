"""How curved the base is: what one template's points say of it, and what that makes along a chain.

Points are (n, 3) in the template's frame, flat as it sees its base (kernels.base); `trend` and `table` are as
in kernels.residual, the three terms as in kernels.base.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import cholesky_in_place, copy_into, solve_in_place
from ridgefeature.kernels.residual import INNER, OPTIONS, loss_jet, residual_jet, split

Floats = NDArray[np.float64]
_PLACED, _MODES = 5, 4
FREE = _PLACED + 3 + _MODES
"""Parameters of which the terms are three."""
_ROWS = FREE + 2
_SCORED = 8
_LEAST_FLANK = 0.05
"""Share of the points that must lie on either flank: without one, its tilt is not told from curvature."""
_SAME_SCALE = 0.03


@njit(**INNER)
def _all_rows(
    points: Floats, height: float, width: float, trend: Floats, table: Floats
) -> tuple[Floats, Floats]:
    """Residuals (n,), their derivatives (14, n): placement 5, terms 3, section's shape 4, height, width."""
    bend, rise, widening = trend[0], trend[1], trend[2]
    constant, linear, quadratic, cubic = split(table)
    n = points.shape[0]
    r, out = np.empty(n), np.empty((_ROWS, n))
    for i in range(n):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        r[i], r_x, r_y, r_z, r_h, r_w = residual_jet(
            x, y, z, height, width, bend, rise, widening, constant, linear, quadratic, cubic
        )
        out[0, i], out[1, i] = -r_y, -r_z
        out[2, i], out[3, i], out[4, i] = r_y * z - r_z * y, r_z * x - r_x * z, r_x * y - r_y * x
        out[FREE, i], out[FREE + 1, i] = r_h, r_w
        # Height over the base falls, and with the normal the foot of what stands on it moves. Its height is
        # that of the section: the point's own noise would pull the terms one way.
        stands = z - r[i] / r_z
        out[_PLACED, i] = -0.5 * x * x * r_z + stands * x * r_x
        out[_PLACED + 1, i] = -x * y * r_z + stands * (y * r_x + x * r_y)
        out[_PLACED + 2, i] = -0.5 * y * y * r_z + stands * y * r_y
        lean = bend * x / max(1.0 - bend * y, 0.2)
        eta = (y - 0.5 * lean * x) / max(width + widening * x, 0.1 * width)
        square = min(4.0 * eta * eta, 1.0)
        shape = r_z * (1.0 - square) ** 2
        for k in range(_MODES):
            out[_PLACED + 3 + k, i] = shape
            shape *= square
    return r, out


@njit(**INNER)
def _gram(rows: Floats, weights: Floats) -> Floats:
    """Weighted sums (14, 14) of the products of rows (14, n)."""
    out = np.empty((_ROWS, _ROWS))
    for j in range(_ROWS):
        weighted = rows[j] * weights
        for k in range(j + 1):
            row, total = rows[k], 0.0
            for i in range(weights.size):
                total += weighted[i] * row[i]
            out[j, k] = out[k, j] = total
    return out


@njit(cache=True)
def _flanked(points: Floats, width: float) -> bool:
    """Whether both flanks are seen."""
    left = right = 0
    for i in range(points.shape[0]):
        left += points[i, 1] > 0.5 * width
        right += points[i, 1] < -0.5 * width
    return min(left, right) > _LEAST_FLANK * points.shape[0]


@njit(**OPTIONS)
def found_terms(
    points: Floats,
    height: float,
    width: float,
    trend: Floats,
    table: Floats,
    floor: float,
    loss: int,
    tuning: float,
) -> tuple[Floats, Floats, Floats]:
    """Change of the terms that the points ask for (3,), its information (3, 3), and what terms would change.

    Robust least squares by scoring (Huber 1981, 7.6 and 7.8) in placement, terms and an even shape of the
    section, about the template as it stands, so that a wrong section is not taken for a curved base: what
    counts are the flanks. The noise scale is that of what remains, not below floor. The information is zero
    where the points do not tell. The last (2, 3): derivatives of fitted height and width by given terms.
    """
    step, information, effect = np.zeros(3), np.zeros((3, 3)), np.zeros((2, 3))
    n = points.shape[0]
    if n < 2 * _ROWS or not _flanked(points, width):
        return step, information, effect
    r, rows = _all_rows(points, height, width, trend, table)
    left, inside, psi, change = r.copy(), np.empty(n), np.empty(n), np.zeros(FREE)
    gram, factor = np.empty((_ROWS, _ROWS)), 0.0
    scale = max(1.4826 * np.median(np.abs(r)), floor)
    for _ in range(_SCORED):
        inliers, square, slope = _inside(left, scale, loss, tuning, inside, psi)
        if inliers <= _ROWS or not slope > 0.0:
            return step, information, effect
        gram = _gram(rows, inside)
        factor = square * inliers * inliers / (slope * slope * (inliers - FREE))
        right = np.empty(FREE)
        for j in range(FREE):
            right[j] = -(rows[j] * psi).sum() * scale * inliers / slope
        if not solve_in_place(gram[:FREE, :FREE].copy(), right):
            return step, information, effect
        change += right
        for j in range(FREE):
            left += right[j] * rows[j]
        before = scale
        scale = max(1.4826 * np.median(np.abs(left)) / math.sqrt(1.0 - FREE / n), floor)
        if abs(scale - before) < _SAME_SCALE * before:
            break
    copy_into(step, change[_PLACED : _PLACED + 3])
    information = _inverse(_block_of_inverse(gram[:FREE, :FREE]) * (scale * scale * factor))
    return step, information, _effect(gram)


@njit(**INNER)
def _inside(
    r: Floats, scale: float, loss: int, tuning: float, inside: Floats, psi: Floats
) -> tuple[float, float, float]:
    """Which residuals (n,) lie within `tuning` scales and their psi; the number, sums of psi^2 and slopes."""
    inliers = square = slope = 0.0
    for i in range(r.size):
        s = r[i] / scale
        inside[i] = 1.0 if abs(s) < tuning else 0.0
        psi[i] = inside[i] * loss_jet(s, loss, tuning)[1]
        inliers += inside[i]
        square += psi[i] * psi[i]
        above, below = loss_jet(s + 1e-4, loss, tuning)[1], loss_jet(s - 1e-4, loss, tuning)[1]
        slope += inside[i] * (above - below) / 2e-4
    return inliers, square, slope


@njit(cache=True)
def _block_of_inverse(gram: Floats) -> Floats:
    """Block (3, 3) for the terms of the inverse of normal equations (12, 12); zeros where there is none."""
    out = np.zeros((3, 3))
    for j in range(3):
        column = np.zeros(gram.shape[0])
        column[_PLACED + j] = 1.0
        if not solve_in_place(gram.copy(), column):
            return np.zeros((3, 3))
        copy_into(out[:, j], column[_PLACED : _PLACED + 3])
    return out


@njit(cache=True)
def _effect(gram: Floats) -> Floats:
    """Derivatives (2, 3) of height and width by the terms, where placement and both are fitted."""
    fitted = np.array([0, 1, 2, 3, 4, FREE, FREE + 1])
    normal, out = np.empty((7, 7)), np.zeros((2, 3))
    for j in range(7):
        for k in range(7):
            normal[j, k] = gram[fitted[j], fitted[k]]
    for k in range(3):
        column = np.empty(7)
        for j in range(7):
            column[j] = -gram[fitted[j], _PLACED + k]
        if solve_in_place(normal.copy(), column):
            out[0, k], out[1, k] = column[5], column[6]
    return out


@njit(cache=True)
def _inverse(a: Floats) -> Floats:
    """Inverse (3, 3) of a symmetric positive definite matrix; zeros where it is none."""
    out = np.zeros((3, 3))
    for j in range(3):
        column = np.zeros(3)
        column[j] = 1.0
        if not solve_in_place(a.copy(), column):
            return np.zeros((3, 3))
        copy_into(out[:, j], column)
    return 0.5 * (out + out.T)


@njit(cache=True)
def summed(terms: Floats, information: Floats, known: Floats) -> tuple[Floats, float, float, int]:
    """Mean (3,) of terms (n, 3) by their information (n, 3, 3), zeros where that is not enough; twice the log
    likelihood ratios of the mean and of all terms against zero; how many are told from it at all.

    By Student's distribution: known (n,) are the degrees of freedom of each one's noise.
    """
    whole, pull = np.zeros((3, 3)), np.zeros(3)
    told, degrees, of_all = 0, 0.0, 0.0
    for n in range(terms.shape[0]):
        own = _times(information[n], terms[n])
        square = 0.0
        for i in range(3):
            pull[i] += own[i]
            square += own[i] * terms[n, i]
            for k in range(3):
                whole[i, k] += information[n, i, k]
        degrees += known[n]
        of_all += known[n] * math.log1p(square / known[n])
        told += square > 0.0
    mean = _times(_inverse(whole), pull)
    own = _times(whole, mean)
    square = mean[0] * own[0] + mean[1] * own[1] + mean[2] * own[2]
    return mean, degrees * math.log1p(square / degrees), of_all, told


@njit(cache=True)
def softened(information: Floats, variance: float) -> Floats:
    """The information (3, 3) of terms to whose covariance so much is added."""
    covariance = _inverse(information)
    if covariance.any():
        covariance += variance * np.eye(3)
    return _inverse(covariance)


@njit(cache=True)
def _log_determinant(a: Floats) -> float:
    """Of a symmetric positive definite matrix (3, 3)."""
    factor = a.copy()
    if not cholesky_in_place(factor):
        return -np.inf
    return 2.0 * (math.log(factor[0, 0]) + math.log(factor[1, 1]) + math.log(factor[2, 2]))


@njit(cache=True)
def _times(a: Floats, b: Floats) -> Floats:
    """Product of (3, 3) and (3,)."""
    out = np.zeros(3)
    for i in range(3):
        for k in range(3):
            out[i] += a[i, k] * b[k]
    return out


@njit(cache=True)
def _copy_matrix(target: Floats, values: Floats) -> None:
    for i in range(target.shape[0]):
        copy_into(target[i], values[i])


@njit(cache=True)
def smoothed(at: Floats, found: Floats, information: Floats, drift: float) -> tuple[Floats, Floats, float]:
    """Terms along a chain (n, 3) that wander by `drift` a length, their variances, the log likelihood of it.

    at (n,): arc lengths; found (n, 3) with its information (n, 3, 3). Random walk with nothing known of its
    start, by elimination of the block tridiagonal normal equations from both ends (Rauch, Tung and Striebel
    1965). The likelihood is known but for a constant.
    """
    n = at.size
    tie = np.zeros(n + 1)
    for i in range(1, n):
        tie[i] = 1.0 / (drift * max(at[i] - at[i - 1], 1e-12 * at[n - 1]))
    ahead, back = np.zeros((n, 3, 3)), np.zeros((n, 3, 3))
    right = np.zeros((n, 3))
    one = np.eye(3)
    likelihood = 0.0
    for i in range(n):
        own = information[i] + (tie[i] + tie[i + 1]) * one
        pull = _times(information[i], found[i])
        if i > 0:
            link = _inverse(ahead[i - 1])
            own -= tie[i] * tie[i] * link
            pull += tie[i] * _times(link, right[i - 1])
            likelihood += 1.5 * math.log(tie[i])
        likelihood -= 0.5 * _log_determinant(own)
        _copy_matrix(ahead[i], own)
        copy_into(right[i], pull)
    terms, variance = np.zeros((n, 3)), np.zeros((n, 3))
    for i in range(n - 1, -1, -1):
        own = information[i] + (tie[i] + tie[i + 1]) * one
        rest = right[i].copy()
        whole = ahead[i] - own
        if i < n - 1:
            own -= tie[i + 1] * tie[i + 1] * _inverse(back[i + 1])
            rest += tie[i + 1] * terms[i + 1]
        whole = _inverse(whole + own)
        copy_into(terms[i], _times(_inverse(ahead[i]), rest))
        _copy_matrix(back[i], own)
        for k in range(3):
            variance[i, k] = whole[k, k]
    for i in range(n):
        gap = found[i] - terms[i]
        likelihood -= 0.5 * (gap * _times(information[i], gap)).sum()
        if i > 0:
            likelihood -= 0.5 * tie[i] * ((terms[i] - terms[i - 1]) ** 2).sum()
    return terms, variance, likelihood
