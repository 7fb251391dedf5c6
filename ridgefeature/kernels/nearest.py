"""Nearest points in a cell grid; the arrays are those of grid.py."""

import numpy as np
from numba import njit

from .grid import LIMIT, Bytes, Cells, Floats, Ints, before, cell_index

Point = tuple[float, float, float]
Block = tuple[int, int, int, int, int, int]

FEW_CELLS = 64  # up to so many cells are looked through one by one; beyond, the tree is descended


@njit(cache=True, inline="always")  # a third of the time of a query otherwise
def _visit(points: Floats, first: int, last: int, query: Point, best: Floats, rows: Ints, i: int) -> None:
    """Put points[first:last] among the k best of query i. Equal distances go by coordinates, never by row."""
    x, y, z = query
    k = best.shape[1]
    worst = best[i, k - 1]
    for j in range(first, last):
        dx, dy, dz = x - points[j, 0], y - points[j, 1], z - points[j, 2]
        d = dx * dx + dy * dy + dz * dz
        if d > worst or (d == worst and not before(points, j, points, rows[i, k - 1])):
            continue
        s = k - 1
        while s > 0 and (
            best[i, s - 1] > d or (best[i, s - 1] == d and before(points, j, points, rows[i, s - 1]))
        ):
            best[i, s] = best[i, s - 1]
            rows[i, s] = rows[i, s - 1]
            s -= 1
        best[i, s] = d
        rows[i, s] = j
        worst = best[i, k - 1]


@njit(cache=True)
def _visit_block(
    points: Floats,
    starts: Cells,
    levels: Ints,
    block: Block,
    done: Block,
    query: Point,
    best: Floats,
    rows: Ints,
    i: int,
) -> None:
    """Visit the cells of a block (x0, x1, y0, y1, z0, z1; both ends in) except those of the block `done`."""
    x0, x1, y0, y1, z0, z1 = block
    a0, a1, b0, b1, c0, c1 = done
    for z in range(z0, z1 + 1):
        for y in range(y0, y1 + 1):
            row = (z * levels[0, 1] + y) * levels[0, 0]
            if c0 <= z <= c1 and b0 <= y <= b1:
                if x0 < a0:
                    _visit(points, starts[row + x0], starts[row + a0], query, best, rows, i)
                if a1 < x1:
                    _visit(points, starts[row + a1 + 1], starts[row + x1 + 1], query, best, rows, i)
            else:
                _visit(points, starts[row + x0], starts[row + x1 + 1], query, best, rows, i)


@njit(cache=True)
def _gap(levels: Ints, frame: Floats, axis: int, level: int, index: int, value: float) -> float:
    """A lower bound of the distance along an axis to the points of a node."""
    first = index << level
    last = (index + 1) << level
    low, high = frame[axis] + first * frame[3 + axis], frame[axis] + last * frame[3 + axis]
    if first == 0:
        low = frame[9 + axis]
    if last >= levels[0, axis]:
        high = frame[12 + axis]
    return max(max(low - value, value - high) * (1.0 - 1e-14) - frame[15 + axis], 0.0)


@njit(cache=True)
def _descend(
    points: Floats,
    starts: Cells,
    tree: Bytes,
    levels: Ints,
    frame: Floats,
    done: Block,
    query: Point,
    best: Floats,
    rows: Ints,
    i: int,
    stack: Ints,
    gaps: Floats,
) -> None:
    """Depth first, near nodes first, through nodes nearer than the k-th best; skips the cells of `done`."""
    k = best.shape[1]
    x, y, z = query
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = levels.shape[0] - 1, 0, 0, 0
    gaps[0] = 0.0
    top = 1
    while top > 0:
        top -= 1
        if gaps[top] > best[i, k - 1]:
            continue
        level, nodex, nodey, nodez = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
        if level == 0:
            if done[0] <= nodex <= done[1] and done[2] <= nodey <= done[3] and done[4] <= nodez <= done[5]:
                continue
            c = (nodez * levels[0, 1] + nodey) * levels[0, 0] + nodex
            _visit(points, starts[c], starts[c + 1], query, best, rows, i)
            continue
        level -= 1
        nx, ny, nz, offset = levels[level, 0], levels[level, 1], levels[level, 2], levels[level, 3]
        side = 1 << level
        near = 1 if x > frame[0] + (2 * nodex + 1) * side * frame[3] else 0
        near += 2 if y > frame[1] + (2 * nodey + 1) * side * frame[4] else 0
        near += 4 if z > frame[2] + (2 * nodez + 1) * side * frame[5] else 0
        for t in range(7, -1, -1):
            child = t ^ near
            cx, cy, cz = 2 * nodex + (child & 1), 2 * nodey + ((child >> 1) & 1), 2 * nodez + (child >> 2)
            if cx >= nx or cy >= ny or cz >= nz:
                continue
            c = (cz * ny + cy) * nx + cx
            if (starts[c + 1] == starts[c]) if level == 0 else (tree[offset + c] == 0):
                continue
            gx, gy = _gap(levels, frame, 0, level, cx, x), _gap(levels, frame, 1, level, cy, y)
            gz = _gap(levels, frame, 2, level, cz, z)
            gap = gx * gx + gy * gy + gz * gz
            if gap <= best[i, k - 1]:
                stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = level, cx, cy, cz
                gaps[top] = gap
                top += 1


@njit(cache=True)
def _reach(levels: Ints, frame: Floats, axis: int, value: float, radius: float) -> tuple[int, int]:
    """First and last cell along an axis that hold the points within a radius of a coordinate."""
    r = radius * (1.0 + 1e-14) + 1e-15 * abs(value)
    first = cell_index(value - r, frame[axis], frame[6 + axis], levels[0, axis])
    return first, cell_index(value + r, frame[axis], frame[6 + axis], levels[0, axis])


@njit(cache=True)
def search(
    points: Floats,
    starts: Cells,
    tree: Bytes,
    levels: Ints,
    frame: Floats,
    queries: Floats,
    best: Floats,
    rows: Ints,
) -> bool:
    """Distances (m, k), ascending, and rows (m, k) of the k nearest points, into best and rows.

    False, and nothing to rely on, if a query is not finite.
    """
    k = best.shape[1]
    nx, ny, nz = levels[0, 0], levels[0, 1], levels[0, 2]
    stack = np.empty((8 * levels.shape[0] + 8, 4), np.int64)
    gaps = np.empty(stack.shape[0])
    nothing = (1, 0, 1, 0, 1, 0)
    for i in range(queries.shape[0]):
        qx, qy, qz = queries[i, 0], queries[i, 1], queries[i, 2]
        query = (qx, qy, qz)
        if not (abs(qx) <= LIMIT and abs(qy) <= LIMIT and abs(qz) <= LIMIT):
            return False
        for s in range(k):
            best[i, s] = np.inf
            rows[i, s] = -1
        x = cell_index(qx, frame[0], frame[6], nx)
        y = cell_index(qy, frame[1], frame[7], ny)
        z = cell_index(qz, frame[2], frame[8], nz)
        done = (x, x, y, y, z, z)
        _visit_block(points, starts, levels, done, nothing, query, best, rows, i)
        if best[i, k - 1] == np.inf:
            x0, x1, y0, y1 = max(x - 1, 0), min(x + 1, nx - 1), max(y - 1, 0), min(y + 1, ny - 1)
            block = (x0, x1, y0, y1, max(z - 1, 0), min(z + 1, nz - 1))
            _visit_block(points, starts, levels, block, done, query, best, rows, i)
            done = block
        cells = FEW_CELLS + 1
        block = done
        if best[i, k - 1] < np.inf:
            r = np.sqrt(best[i, k - 1])
            x0, x1 = _reach(levels, frame, 0, qx, r)
            y0, y1 = _reach(levels, frame, 1, qy, r)
            z0, z1 = _reach(levels, frame, 2, qz, r)
            block = (x0, x1, y0, y1, z0, z1)
            cells = (x1 - x0 + 1) * (y1 - y0 + 1) * (z1 - z0 + 1)
        if cells <= FEW_CELLS:
            _visit_block(points, starts, levels, block, done, query, best, rows, i)
        else:
            _descend(points, starts, tree, levels, frame, done, query, best, rows, i, stack, gaps)
        for s in range(k):
            best[i, s] = np.sqrt(best[i, s])
    return True
