"""The points along a path, from a cell grid (arrays as in grid.py), box after box of a few nodes."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.grid import Cells, Ints
from ridgefeature.kernels.strip import rectified
from ridgefeature.kernels.window import box_count, box_points

Floats = NDArray[np.float64]

_PROBES = 6


@njit(cache=True)
def boxes_around(
    corners: Floats, origin: Floats, tangent: Floats, left: Floats, normal: Floats, together: int
) -> tuple[Floats, Floats, Floats]:
    """Boxes around runs of so many stretches between nodes: centres (m, 3), axes (m, 3, 3), half sizes
    (m, 3).

    corners (nodes, k, 3): what the points near each node lie between. The axes are those of the node in the
    middle of the run.
    """
    last = origin.shape[0] - 1
    m = (last + together - 1) // together
    centres, axes, half = np.zeros((m, 3)), np.empty((m, 3, 3)), np.empty((m, 3))
    for i in range(m):
        first, end = i * together, min((i + 1) * together, last)
        middle = (first + end) // 2
        for a in range(3):
            axes[i, 0, a], axes[i, 1, a], axes[i, 2, a] = (
                tangent[middle, a],
                left[middle, a],
                normal[middle, a],
            )
            centres[i, a] = origin[middle, a]
        longest = 0.0
        for b in range(3):
            low, high = np.inf, -np.inf
            for j in range(first, end + 1):
                for k in range(corners.shape[1]):
                    x = 0.0
                    for a in range(3):
                        x += (corners[j, k, a] - origin[middle, a]) * axes[i, b, a]
                    low, high = min(low, x), max(high, x)
            half[i, b] = 0.505 * (high - low)
            longest = max(longest, high - low)
            for a in range(3):
                centres[i, a] += 0.5 * (low + high) * axes[i, b, a]
        for b in range(3):
            half[i, b] += 1e-9 * longest
    return centres, axes, half


@njit(cache=True)
def count_along(
    starts: Cells, levels: Ints, frame: Floats, centres: Floats, axes: Floats, half: Floats
) -> int:
    """About how many points boxes hold in all: a few of them tell."""
    m = centres.shape[0]
    step = 1 + m // _PROBES
    total, probes = 0, 0
    for i in range((m - 1) % step // 2, m, step):
        total += box_count(starts, levels, frame, centres[i], axes[i], half[i])
        probes += 1
    return total * m // probes


@njit(cache=True)
def rectified_along(
    points: Floats,
    starts: Cells,
    levels: Ints,
    frame: Floats,
    centres: Floats,
    axes: Floats,
    half: Floats,
    origin: Floats,
    tangent: Floats,
    left: Floats,
    normal: Floats,
    curvature: Floats,
    reach: Floats,
    tall: Floats,
    together: int,
    every: int,
    expected: int,
) -> Floats:
    """Coordinates (m, 3) as `rectified` has them of the points along a path, about one of `every`.

    Boxes as `boxes_around` has them; only one box's points are held at a time besides what is returned.
    """
    out = np.empty((1024 + expected, 3))
    m = 0
    for i in range(centres.shape[0]):
        run = slice(i * together, min((i + 1) * together, origin.shape[0] - 1) + 1)
        found, n = box_points(points, starts, levels, frame, centres[i], axes[i], half[i], every)
        nodes = _turned(origin[run] - centres[i], axes[i])
        frames = [_turned(x[run], axes[i]) for x in (tangent, left, normal)]
        here = rectified(
            found[:n],
            nodes,
            frames[0],
            frames[1],
            frames[2],
            curvature[run],
            reach[run],
            tall[run],
            run.start,
        )
        if m + here.shape[0] > out.shape[0]:
            wider = np.empty((2 * (m + here.shape[0]), 3))
            _copy_rows(wider, 0, out[:m])
            out = wider
        _copy_rows(out, m, here)
        m += here.shape[0]
    return out[:m]


@njit(cache=True)
def _copy_rows(target: Floats, first: int, rows: Floats) -> None:
    for i in range(rows.shape[0]):
        target[first + i, 0], target[first + i, 1], target[first + i, 2] = rows[i, 0], rows[i, 1], rows[i, 2]


@njit(cache=True)
def _turned(vectors: Floats, axes: Floats) -> Floats:
    """Vectors (n, 3) in a frame whose axes (3, 3) are rows."""
    out = np.zeros((vectors.shape[0], 3))
    for i in range(vectors.shape[0]):
        for b in range(3):
            for a in range(3):
                out[i, b] += vectors[i, a] * axes[b, a]
    return out
