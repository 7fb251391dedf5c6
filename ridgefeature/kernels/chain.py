"""Kernels of a chain of templates: how it goes on, what its members tell of each other, where it ends."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import copy_into, cross, turned, walk
from ridgefeature.kernels.appraise import residuals_of
from ridgefeature.kernels.evidence import plane_loss
from ridgefeature.kernels.residual import INNER, OPTIONS, loss_jet

Floats = NDArray[np.float64]
_OTHER_GROUND = 0.5
"""Rise of a base from foot to foot, in heights, that is no error of its tilt any more."""
_FEWEST_OUTSIDE = 12
_BEYOND_DOUBT = 10.0
"""Log likelihood ratio that a ridge never loses by chance."""


@njit(cache=True)
def starts(positions: Floats, frames: Floats, last_length: float, length: float) -> tuple[Floats, Floats]:
    """Positions (m, 3) and frames (m, 3, 3) of the patches of a length that may follow a chain.

    positions (k, 3) and frames (k, 3, 3) of its last patches, 1 <= k <= 3, axes as columns. Each start begins
    at the end of the last patch, on the mean base of the k. It goes on turning as the last three centres do,
    or straight on, along the chord of the last two centres or along the last patch's own direction.
    """
    k = positions.shape[0]
    normal = np.zeros(3)
    for i in range(k):
        normal += frames[i, :, 2]
    normal /= math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    own = frames[k - 1, :, 0].copy()
    joint = positions[k - 1] + 0.5 * last_length * own
    ways, bends = np.empty((k, 3)), np.zeros(k)
    for i in range(k):
        copy_into(ways[i], own)
    if k == 2:
        copy_into(ways[1], positions[1] - positions[0])
    if k == 3:
        chord, earlier = positions[2] - positions[1], positions[1] - positions[0]
        step, step_before = math.sqrt((chord * chord).sum()), math.sqrt((earlier * earlier).sum())
        turn = math.atan2((normal * cross(earlier, chord)).sum(), (earlier * chord).sum())
        bends[0] = bends[1] = 2.0 * turn / (step + step_before)
        copy_into(ways[0], turned(chord, normal, 0.5 * step * bends[0]))
    places, axes = np.empty((k, 3)), np.empty((k, 3, 3))
    for i in range(k):
        place, frame = walk(joint, normal, ways[i], bends[i], 0.5 * last_length, 0.5 * length)
        copy_into(places[i], place)
        for j in range(3):
            copy_into(axes[i, j], frame[j])
    return places, axes


@njit(cache=True)
def trends(positions: Floats, frames: Floats, sizes: Floats, half_breadths: Floats) -> Floats:
    """Curvature of the path, slopes of height and width (n, 3) at each patch, from its neighbours.

    Those of the ends are what the last three patches tell: two alone tell little.
    positions (n, 3), frames (n, 3, 3) axes as columns, sizes (n, 2) height and width. The curvature stays
    below that at which the flank, half_breadths (n,) from the spine, would fold.
    """
    n = positions.shape[0]
    out = np.zeros((n, 3))
    if n < 2:
        return out
    at = np.zeros(n)
    for i in range(1, n):
        step = positions[i] - positions[i - 1]
        at[i] = at[i - 1] + math.sqrt((step * step).sum())
    for i in range(n):
        a, b = max(min(i - 1, n - 3), 0), min(max(i + 1, 2), n - 1)
        gap = at[b] - at[a]
        before, after = frames[a, :, 0].copy(), frames[b, :, 0].copy()
        turn = math.atan2((frames[i, :, 2] * cross(before, after)).sum(), (before * after).sum())
        limit = 0.9 / half_breadths[i]
        out[i, 0] = min(max(turn / gap, -limit), limit)
        out[i, 1] = (sizes[b, 0] - sizes[a, 0]) / gap
        out[i, 2] = (sizes[b, 1] - sizes[a, 1]) / gap
    return out


@njit(**INNER)
def _levelled(
    points: Floats, height: float, width: float, trend: Floats, scale: float, loss: int, tuning: float
) -> Floats:
    """The points (n, 3) with the robust plane through those outside the feet taken off.

    None is where it rises from foot to foot by more than a part of the height: slopes beside a valley do so.
    """
    n, m = points.shape[0], 0
    outside = np.empty((n, 3))
    for i in range(n):
        x, y = points[i, 0], points[i, 1]
        if abs(y - 0.5 * trend[0] * x * x) > 0.5 * max(width + trend[2] * x, 0.1 * width):
            copy_into(outside[m], points[i])
            m += 1
    out = points.copy()
    if m >= _FEWEST_OUTSIDE:
        _, plane = plane_loss(outside[:m], scale, loss, tuning, 5)
        if abs(plane[2]) * width > _OTHER_GROUND * abs(height):
            return out
        for i in range(n):
            out[i, 2] -= plane[0] + plane[1] * points[i, 0] + plane[2] * points[i, 1]
    return out


@njit(**OPTIONS)
def change_point(
    points: Floats,
    height: float,
    width: float,
    trend: Floats,
    table: Floats,
    scale: float,
    loss: int,
    tuning: float,
) -> float:
    """Where along x a ridge that begins before the points (n, 3) stops explaining more than its base.

    The largest partial sum of the log likelihood ratio of ridge against base, point by point in the order of
    x: the maximum-likelihood change point. Once the sum has fallen far below it nothing further on counts: it
    is another ridge (Page 1954, CUSUM). -inf where the ridge explains nothing. The base is levelled by the
    points outside the feet first: far ahead a small error of its tilt would look like a ridge.
    """
    points = _levelled(points, height, width, trend, scale, loss, tuning)
    ridge = residuals_of(points, height, width, trend, table)
    base = residuals_of(points, 0.0, width, trend, table)
    order = np.argsort(points[:, 0].copy(), kind="mergesort")
    total = best = 0.0
    last = -1
    for k in range(order.size):
        i = order[k]
        total += loss_jet(base[i] / scale, loss, tuning)[0] - loss_jet(ridge[i] / scale, loss, tuning)[0]
        if total > best:
            best, last = total, k
        elif total < best - _BEYOND_DOUBT:
            break
    if last < 0:
        return -np.inf
    x = points[order[last], 0]
    return 0.5 * (x + points[order[last + 1], 0]) if last + 1 < order.size else x
