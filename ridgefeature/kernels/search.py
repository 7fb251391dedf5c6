"""Kernel of GUESS: which straight ridge of one width explains the heights of a few points best?"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ridgefeature.kernels.algebra import solve_in_place


@njit(cache=True, inline="always")
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _product(matrix, vector):
    out = np.empty(3)
    for i in range(3):
        out[i] = _dot(matrix[i], vector)
    return out


@njit(cache=True, error_model="numpy")
def best_straight_ridge(points, width, angles, offsets, table, sign):
    """Least squares of z on plane + one ridge section, for every direction and offset; the best is returned.

    points (n, 3) in a frame whose z is about normal to the surface, near the origin; `angles` (radians) of the
    ridge to the x axis; `offsets` of its spine from the origin in parts of the width, to its left; `sign` of the
    height: 1, -1 or 0 for any. Returns (share of the variance that the plane leaves which the ridge explains,
    angle, offset, height, a, b, c) with the base plane z = a + b x + c y.
    """
    n = points.shape[0]
    spans = table.shape[0] - 2
    moments = np.zeros((3, 3))
    z_moments = np.zeros(3)
    zz = 0.0
    for i in range(n):
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
    best = np.zeros(7)
    inverse = np.eye(3)
    for k in range(3):
        factor = moments.copy()
        if not solve_in_place(factor, inverse[k]):
            return best
    plane = _product(inverse, z_moments)
    left = zz - _dot(z_moments, plane)
    if not left > 0.0:
        return best
    g_moments = np.empty(3)
    for angle in angles:
        cosine, sine = math.cos(angle), math.sin(angle)
        for offset in offsets:
            g_moments[:] = 0.0
            gg = gz = 0.0
            for i in range(n):
                x, y = points[i, 0], points[i, 1]
                position = ((cosine * y - sine * x) / width - offset + 0.5) * spans
                if 0.0 <= position < spans:
                    span = int(position) + 1
                    t = position + 1 - span
                    g = table[span, 0] + t * (table[span, 1] + t * (table[span, 2] + t * table[span, 3]))
                    g_moments[0] += g
                    g_moments[1] += g * x
                    g_moments[2] += g * y
                    gg += g * g
                    gz += g * points[i, 2]
            follows = _product(inverse, g_moments)
            spread = gg - _dot(g_moments, follows)
            if not spread > 1e-3 * gg:
                continue
            height = (gz - _dot(g_moments, plane)) / spread
            if height * sign < 0.0:
                continue
            explained = height * height * spread / left
            if explained > best[0]:
                best[0], best[1], best[2], best[3] = explained, angle, offset, height
                best[4:] = plane - height * follows
    return best
