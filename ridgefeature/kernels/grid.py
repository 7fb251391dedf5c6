"""A cell grid over unordered points: building it. The grid's other kernels are in window.py and nearest.py.

Arrays, everywhere in the kernels of the grid:
points (n, 3) float64, sorted by cell;
starts (cells + 1,) int32: cell c holds points[starts[c]:starts[c + 1]], its number is (z * ny + y) * nx + x;
levels (L, 4) int64: level l has nx, ny, nz nodes of 2^l cells each way, and its nodes begin at tree[offset];
tree (nodes,) uint8: 1 for an occupied node of level 1 and up;
frame (18,) float64: lower corner, cell sizes, 1 / cell sizes, least and greatest coordinates, slack, 3 each.

A point outside the cells belongs to the nearest border cell. `cell_index` never decreases with its
coordinate, in floating point too, so that a range of coordinates always lies in the range of their cells:
queries stay exact.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import copy_into

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Cells = NDArray[np.int32]
Bytes = NDArray[np.uint8]

LIMIT = 1e150  # the squares of larger coordinates would overflow
BLOCK = 512


@njit(cache=True)
def cell_index(value: float, low: float, inverse: float, count: int) -> np.int64:
    """Cell of a coordinate along an axis of `count` cells, the first of which begins at `low`."""
    return np.int64(min(max((value - low) * inverse, 0.0), count - 1.0))


@njit(cache=True)
def bounds(points: Floats) -> tuple[Floats, int]:
    """Smallest and largest coordinates (6,); the first row that is not finite or beyond LIMIT, else -1."""
    out = np.array([np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf])
    bad = False
    for i in range(points.shape[0]):
        for a in range(3):
            v = points[i, a]
            bad |= not abs(v) <= LIMIT
            out[a] = min(out[a], v)
            out[3 + a] = max(out[3 + a], v)
    if bad:
        for i in range(points.shape[0]):
            for a in range(3):
                if not abs(points[i, a]) <= LIMIT:
                    return out, i
    return out, -1


@njit(cache=True)
def _block_cells(points: Floats, first: int, m: int, levels: Ints, frame: Floats, cells: Cells) -> None:
    """Cell numbers of m points from `first` on; in blocks, as the random accesses after it then overlap."""
    x0, y0, z0, ix, iy, iz = frame[0], frame[1], frame[2], frame[6], frame[7], frame[8]
    nx, ny, nz = levels[0, 0], levels[0, 1], levels[0, 2]
    for k in range(m):
        x = cell_index(points[first + k, 0], x0, ix, nx)
        y = cell_index(points[first + k, 1], y0, iy, ny)
        z = cell_index(points[first + k, 2], z0, iz, nz)
        cells[k] = (z * ny + y) * nx + x


@njit(cache=True)
def count_cells(points: Floats, levels: Ints, frame: Floats, counts: Cells) -> None:
    """Add the number of points of every cell to counts."""
    n = points.shape[0]
    cells = np.empty(BLOCK, np.int32)
    for first in range(0, n, BLOCK):
        m = min(BLOCK, n - first)
        _block_cells(points, first, m, levels, frame, cells)
        for k in range(m):
            counts[cells[k]] += 1


@njit(cache=True)
def sort_into_cells(points: Floats, levels: Ints, frame: Floats, starts: Cells, out: Floats) -> None:
    """Counting sort. `starts` comes with counts, 0 at its end, and leaves with the first row of each cell."""
    total = 0
    for c in range(starts.shape[0]):
        total += starts[c]
        starts[c] = total
    n = points.shape[0]
    cells = np.empty(BLOCK, np.int32)
    for first in range(0, n, BLOCK):
        m = min(BLOCK, n - first)
        _block_cells(points, first, m, levels, frame, cells)
        for k in range(m):
            row = starts[cells[k]] - 1
            starts[cells[k]] = row
            cells[k] = row
        for k in range(m):
            row = cells[k]
            out[row, 0] = points[first + k, 0]
            out[row, 1] = points[first + k, 1]
            out[row, 2] = points[first + k, 2]


@njit(cache=True)
def fill_tree(starts: Cells, levels: Ints, tree: Bytes) -> None:
    """Mark the occupied nodes of every level above the cells."""
    for level in range(1, levels.shape[0]):
        nx, ny, nz, below = (
            levels[level - 1, 0],
            levels[level - 1, 1],
            levels[level - 1, 2],
            levels[level - 1, 3],
        )
        mx, my, offset = levels[level, 0], levels[level, 1], levels[level, 3]
        for z in range(nz):
            for y in range(ny):
                row = (z * ny + y) * nx
                up = offset + ((z >> 1) * my + (y >> 1)) * mx
                for x in range(nx):
                    if level == 1:
                        occupied = starts[row + x + 1] > starts[row + x]
                    else:
                        occupied = tree[below + row + x] != 0
                    if occupied:
                        tree[up + (x >> 1)] = 1


@njit(cache=True)
def before(a: Floats, i: int, b: Floats, j: int) -> bool:
    """Whether row i of a comes before row j of b in the order of x, then y, then z."""
    for axis in range(3):
        if a[i, axis] != b[j, axis]:
            return a[i, axis] < b[j, axis]
    return False


@njit(cache=True)
def probe_cells(points: Floats, starts: Cells, levels: Ints, frame: Floats, cells: Ints) -> Floats:
    """One point (m, 3) of every given cell, chosen by its coordinates as if at random, never by its row."""
    out = np.empty((cells.shape[0], 3))
    for i in range(cells.shape[0]):
        first = starts[cells[i]]
        chosen, least = first, np.inf
        for j in range(first, starts[cells[i] + 1]):
            key = 0.0
            for a in range(3):
                key += (points[j, a] - frame[a]) * frame[6 + a] * (739.0 + 262.0 * a)
            key -= np.floor(key)
            if key < least or (key == least and before(points, j, points, chosen)):
                chosen, least = j, key
        copy_into(out[i], points[chosen])
    return out
