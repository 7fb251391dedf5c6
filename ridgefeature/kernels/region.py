"""Points that were looked up once, in a box of their own frame, brought to the windows inside it."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.grid import before

Floats = NDArray[np.float64]


@njit(cache=True, inline="always")
def _relative(box: Floats, position: Floats, rotation: Floats) -> tuple[Floats, Floats]:
    """Origin (3,) and axes (3, 3), as columns, of a frame as seen from the box."""
    shift, turn = np.zeros(3), np.zeros((3, 3))
    for i in range(3):
        for k in range(3):
            shift[i] += box[3 + 3 * k + i] * (position[k] - box[k])
            for j in range(3):
                turn[i, j] += box[3 + 3 * k + i] * rotation[k, j]
    return shift, turn


@njit(cache=True)
def covering(
    boxes: Floats,
    count: int,
    position: Floats,
    rotation: Floats,
    low: float,
    high: float,
    half_y: float,
    half_z: float,
    largest: float,
) -> int:
    """Number of the last of the first `count` boxes that covers a window, -1 if none does.

    boxes (m, 15): origin (3,), axes as columns (3, 3) by rows, half sizes (3,). The window runs from low to
    high in x of its own frame and lies within half_y and half_z in y and z. A box over more than `largest`
    times the area does not serve: its points may be thinned too far.
    """
    middle, half_x = 0.5 * (low + high), 0.5 * (high - low)
    for n in range(count - 1, -1, -1):
        box = boxes[n]
        reach = box[12] + box[13] + box[14]
        apart = abs(position[0] - box[0]) + abs(position[1] - box[1]) + abs(position[2] - box[2])
        if apart > 2.0 * reach or box[12] * box[13] > largest * half_x * half_y:
            continue
        shift, turn = _relative(box, position, rotation)
        covered = True
        for i in range(3):
            need = abs(shift[i] + turn[i, 0] * middle)
            need += abs(turn[i, 0]) * half_x + abs(turn[i, 1]) * half_y + abs(turn[i, 2]) * half_z
            covered &= need <= box[12 + i]
        if covered:
            return n
    return -1


@njit(cache=True)
def select(
    points: Floats,
    box: Floats,
    position: Floats,
    rotation: Floats,
    low: float,
    high: float,
    half_y: float,
    half_z: float,
) -> Floats:
    """Points (n, 3) of a box, in its frame, brought to the frame of a window: those inside it."""
    shift, turn = _relative(box, position, rotation)
    out = np.empty_like(points)
    m = 0
    for i in range(points.shape[0]):
        dx, dy, dz = points[i, 0] - shift[0], points[i, 1] - shift[1], points[i, 2] - shift[2]
        x = turn[0, 0] * dx + turn[1, 0] * dy + turn[2, 0] * dz
        y = turn[0, 1] * dx + turn[1, 1] * dy + turn[2, 1] * dz
        z = turn[0, 2] * dx + turn[1, 2] * dy + turn[2, 2] * dz
        out[m, 0], out[m, 1], out[m, 2] = x, y, z
        m += low <= x <= high and abs(y) <= half_y and abs(z) <= half_z
    return out[:m]


@njit(cache=True)
def thin(points: Floats, half_x: float, half_y: float, nx: int, ny: int) -> Floats:
    """Of points (n, 3) within half_x and half_y, the one nearest to the centre of every occupied bin."""
    best = np.full(nx * ny, np.inf)
    kept = np.zeros(nx * ny, np.int64)
    per_x, per_y = 0.5 * nx / half_x, 0.5 * ny / half_y
    wide_x, wide_y = 2.0 * half_x / nx, 2.0 * half_y / ny
    for i in range(points.shape[0]):
        x, y = (points[i, 0] + half_x) * per_x, (points[i, 1] + half_y) * per_y
        u, v = min(max(int(x), 0), nx - 1), min(max(int(y), 0), ny - 1)
        du, dv = (x - u - 0.5) * wide_x, (y - v - 0.5) * wide_y
        d, b = du * du + dv * dv, v * nx + u
        if d < best[b] or (d == best[b] and before(points, i, points, kept[b])):
            best[b], kept[b] = d, i
    return points[kept[best < np.inf]]
