"""Kernel of GUESS: which straight ridge of one width explains the heights of a few points best?"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import copy_into, cross, solve_in_place

Floats = NDArray[np.float64]
_SWEEPS = 12


@njit(cache=True, inline="always")
def _dot(a: Floats, b: Floats) -> float:
    """Scalar product of a (3,) and b (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _product(matrix: Floats, vector: Floats) -> Floats:
    """Product of a matrix (3, 3) and a vector (3,)."""
    out = np.empty(3)
    for i in range(3):
        out[i] = _dot(matrix[i], vector)
    return out


@njit(cache=True)
def _plane_moments(points: Floats) -> tuple[Floats, Floats, float]:
    """Sums of 1, x, y times 1, x, y (3, 3), of z times 1, x, y (3,), and of z times z."""
    moments = np.zeros((3, 3))
    z_moments = np.zeros(3)
    zz = 0.0
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        moments[0, 0] += 1.0
        moments[0, 1] += x
        moments[0, 2] += y
        moments[1, 1] += x * x
        moments[1, 2] += x * y
        moments[2, 2] += y * y
        z_moments[0] += z
        z_moments[1] += z * x
        z_moments[2] += z * y
        zz += z * z
    moments[1, 0], moments[2, 0], moments[2, 1] = moments[0, 1], moments[0, 2], moments[1, 2]
    return moments, z_moments, zz


@njit(cache=True, error_model="numpy")
def _section_moments(
    points: Floats, width: float, angle: float, offset: float, table: Floats, out: Floats
) -> tuple[float, float]:
    """Sums of the section times 1, x, y into out (3,); returns those of its square and of it times z."""
    spans = table.shape[0] - 2
    cosine, sine = math.cos(angle), math.sin(angle)
    out[:] = 0.0
    gg = gz = 0.0
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        position = ((cosine * y - sine * x) / width - offset + 0.5) * spans
        if 0.0 <= position < spans:
            span = int(position) + 1
            t = position + 1 - span
            g = table[span, 0] + t * (table[span, 1] + t * (table[span, 2] + t * table[span, 3]))
            out[0] += g
            out[1] += g * x
            out[2] += g * y
            gg += g * g
            gz += g * points[i, 2]
    return gg, gz


@njit(cache=True, error_model="numpy")
def best_straight_ridge(
    points: Floats, width: float, angles: Floats, offsets: Floats, table: Floats
) -> Floats:
    """Least squares of z on plane + one ridge section, for every direction and offset; the best is returned.

    points (n, 3) in a frame whose z is about normal to the surface, near the origin; `angles` (radians) of
    the ridge to the x axis; `offsets` of its spine from the origin in parts of the width, to its left.
    Returns (7,): share of the variance that the plane leaves which the ridge explains, angle, offset, height,
    a, b, c with the base plane z = a + b x + c y; zeros where there is nothing to explain.
    """
    moments, z_moments, zz = _plane_moments(points)
    best = np.zeros(7)
    inverse = np.eye(3)
    for k in range(3):
        if not solve_in_place(moments.copy(), inverse[k]):
            return best
    plane = _product(inverse, z_moments)
    left = zz - _dot(z_moments, plane)
    if not left > 0.0:
        return best
    g_moments = np.empty(3)
    for angle in angles:
        for offset in offsets:
            gg, gz = _section_moments(points, width, angle, offset, table, g_moments)
            follows = _product(inverse, g_moments)
            spread = gg - _dot(g_moments, follows)
            if not spread > 1e-3 * gg:
                continue
            height = (gz - _dot(g_moments, plane)) / spread
            explained = height * height * spread / left
            if explained > best[0]:
                best[0], best[1], best[2], best[3] = explained, angle, offset, height
                copy_into(best[4:], plane - height * follows)
    return best


@njit(cache=True)
def principal_axes(points: Floats) -> Floats:
    """Columns (3, 3): principal axes of points (n, 3) by falling extent, right-handed (Jacobi's method)."""
    n = points.shape[0]
    mean = np.zeros(3)
    for i in range(n):
        for j in range(3):
            mean[j] += points[i, j] / n
    a, axes = np.zeros((3, 3)), np.eye(3)
    for i in range(n):
        for j in range(3):
            for k in range(3):
                a[j, k] += (points[i, j] - mean[j]) * (points[i, k] - mean[k])
    for _ in range(_SWEEPS):
        for p, q in ((0, 1), (0, 2), (1, 2)):
            if abs(a[p, q]) <= 1e-300 + 1e-18 * (abs(a[p, p]) + abs(a[q, q])):
                continue
            theta = 0.5 * (a[q, q] - a[p, p]) / a[p, q]
            t = math.copysign(1.0, theta) / (abs(theta) + math.hypot(theta, 1.0))
            c = 1.0 / math.hypot(t, 1.0)
            s = t * c
            for k in range(3):
                a[k, p], a[k, q] = c * a[k, p] - s * a[k, q], s * a[k, p] + c * a[k, q]
            for k in range(3):
                a[p, k], a[q, k] = c * a[p, k] - s * a[q, k], s * a[p, k] + c * a[q, k]
            for k in range(3):
                axes[k, p], axes[k, q] = c * axes[k, p] - s * axes[k, q], s * axes[k, p] + c * axes[k, q]
    order = np.argsort(np.array([-a[0, 0], -a[1, 1], -a[2, 2]]))
    out = np.empty((3, 3))
    for j in range(2):
        copy_into(out[:, j], axes[:, order[j]])
    copy_into(out[:, 2], cross(out[:, 0], out[:, 1]))
    return out
