"""Sums over the points of a ridge: what they say of its section, by how much they miss it, and in common."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.residual import OPTIONS
from ridgefeature.kernels.strip import Seen, seen_at, share_of_surface, terms_at

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
BASE = 3


@njit(**OPTIONS)
def cell_sums(
    points: Floats, terms: Floats, seen: Seen, scale: float, stray: float
) -> tuple[Floats, Floats, Floats]:
    """Sums of what the points in each cell of the smeared section say, in units of the noise.

    points, terms, seen and noise as in kernels.strip. With height x in local apex heights at a cell, and
    changes b of the base in powers of y: of each cell (m, cells, 5) the factors of x^2, of x, and of x b in
    the normal equations, and the base's own (3, 3) and (3,).
    """
    values, reach, stride = seen
    cells = values.shape[1] - 1
    out = np.zeros((values.shape[0], cells, 2 + BASE))
    # Sums of powers of y, from 0: in registers, the loop takes half the time.
    p0 = p1 = p2 = p3 = p4 = q0 = q1 = q2 = 0.0
    for i in range(points.shape[0]):
        y = points[i, 1]
        _, there = terms_at(terms, points[i, 0])
        m = np.int64(points[i, 0] / stride + 0.5)
        r, far, _, growth, _, _, eta, per_scale = seen_at(y, points[i, 2], there, values[m], reach, scale)
        raised = there[4] * per_scale
        goal = r + growth * raised
        weight = share_of_surface(far, per_scale * scale, stray)
        square, share = y * y, weight * per_scale
        known, wanted = share * per_scale, share * goal
        p0 += known
        p1 += known * y
        p2 += known * square
        p3 += known * square * y
        p4 += known * square * square
        q0 += wanted
        q1 += wanted * y
        q2 += wanted * square
        place = (eta / reach + 1.0) * 0.5 * cells
        if not 0.0 <= place < cells:
            continue
        own = out[m, np.int64(place)]
        lifted = weight * raised
        own[0] += lifted * raised
        own[1] += lifted * goal
        lifted *= per_scale
        own[2] += lifted
        own[3] += lifted * y
        own[4] += lifted * square
    return out, np.array([[p0, p1, p2], [p1, p2, p3], [p2, p3, p4]]), np.array([q0, q1, q2])


@njit(**OPTIONS)
def spline_sums(
    sums: Floats, basis: Floats, base_matrix: Floats, base_right: Floats
) -> tuple[Floats, Floats]:
    """Normal equations (n + 3, n + 3), (n + 3,) of a spline with n coefficients and the base's changes.

    sums (m, cells, 5) as `cell_sums` has them; basis (m, cells, n): values of the spline's functions there.
    """
    n = basis.shape[2]
    matrix, right = np.zeros((n + BASE, n + BASE)), np.zeros(n + BASE)
    # In loops: an assignment of a part of a matrix takes seconds to compile.
    for k in range(BASE):
        right[n + k] = base_right[k]
        for p in range(BASE):
            matrix[n + k, n + p] = base_matrix[k, p]
    for m in range(basis.shape[0]):
        for i in range(basis.shape[1]):
            if sums[m, i, 0] == 0.0:
                continue
            row, low, high = basis[m, i], 0, n
            while low < n and row[low] == 0.0:
                low += 1
            while high > low and row[high - 1] == 0.0:
                high -= 1
            for k in range(low, high):
                right[k] += sums[m, i, 1] * row[k]
                for p in range(low, k + 1):
                    matrix[k, p] += sums[m, i, 0] * row[k] * row[p]
                for p in range(BASE):
                    matrix[n + p, k] += sums[m, i, 2 + p] * row[k]
    for k in range(n + BASE):
        for p in range(k):
            matrix[p, k] = matrix[k, p]
    return matrix, right


@njit(**OPTIONS)
def misfit_sums(
    points: Floats,
    terms: Floats,
    seen: Seen,
    scale: float,
    least: float,
    most: float,
    top: tuple[float, float],
) -> Floats:
    """Points between the feet of each stretch (nodes - 1, 3): how many, the sum of their squared distances in
    noises, and how many lie near the top and are no strays.

    points, terms, seen and scale as in kernels.strip; least: noise that distances are measured by, at least;
    most: of a squared distance, from which on a point is a stray; top: places in widths between which it is.
    """
    values, reach, stride = seen
    out = np.zeros((terms.shape[0] - 1, 3))
    for i in range(points.shape[0]):
        j, there = terms_at(terms, points[i, 0])
        eta = (points[i, 1] - there[3]) / there[5]
        if not abs(eta) < 0.5:
            continue
        own = values[np.int64(points[i, 0] / stride + 0.5)]
        off = seen_at(points[i, 1], points[i, 2], there, own, reach, scale)[0] * scale / max(scale, least)
        square = min(off * off, most)
        out[j, 0] += 1.0
        out[j, 1] += square
        if top[0] < eta < top[1] and square < most:
            out[j, 2] += 1.0
    return out


@njit(**OPTIONS)
def strip_sums(windows: Indices, strips: Indices, values: Floats) -> tuple[Floats, Floats, Floats]:
    """Sums (windows, strips) of values (m,), of their squares and of 1, by window and strip.

    windows, strips (m,), m >= 1: those that each value is in, both from 0 on.
    """
    out = np.zeros((3, windows.max() + 1, strips.max() + 1))
    for i in range(values.size):
        m, k, v = windows[i], strips[i], values[i]
        out[0, m, k] += v
        out[1, m, k] += v * v
        out[2, m, k] += 1.0
    return out[0], out[1], out[2]
