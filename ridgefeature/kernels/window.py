"""The points of a box or of a ball, from a cell grid; the arrays are those of grid.py."""

import numpy as np
from numba import njit

from .algebra import copy_into
from .grid import LIMIT, Cells, Floats, Ints, before, cell_index
from .sorting import chosen_row, ordered, sort_rows


@njit(cache=True)
def _span(levels: Ints, frame: Floats, axis: int, low: float, high: float) -> tuple[int, int]:
    """First and last cell along an axis for coordinates from low to high."""
    first = cell_index(low, frame[axis], frame[6 + axis], levels[0, axis])
    return first, cell_index(high, frame[axis], frame[6 + axis], levels[0, axis])


@njit(cache=True)
def _slab(levels: Ints, frame: Floats, axis: int, index: int) -> tuple[float, float]:
    """Smallest and largest coordinate of the points in the cells with this index along an axis."""
    low = frame[axis] + index * frame[3 + axis] - frame[15 + axis]
    high = frame[axis] + (index + 1) * frame[3 + axis] + frame[15 + axis]
    if index == 0:
        low = min(low, frame[9 + axis])
    if index == levels[0, axis] - 1:
        high = max(high, frame[12 + axis])
    return low, high


@njit(cache=True)
def _box_reach(frame: Floats, origin: Floats, axes: Floats, half: Floats, reach: Floats) -> float:
    """Half sizes (3,) of the box's axis-aligned bounds, into reach; returns a length far above rounding."""
    scale = 0.0
    for a in range(3):
        scale += abs(origin[a]) + half[a] + max(abs(frame[9 + a]), abs(frame[12 + a]))
    pad = 1e-11 * scale
    for a in range(3):
        reach[a] = pad
        for j in range(3):
            reach[a] += abs(axes[j, a]) * half[j]
    return pad


@njit(cache=True)
def _clip_row(
    levels: Ints,
    frame: Floats,
    origin: Floats,
    axes: Floats,
    half: Floats,
    reach: Floats,
    pad: float,
    y: int,
    z: int,
) -> tuple[int, int]:
    """First and last cell of the row (y, z) that may meet the oriented box; last < first if none does."""
    y0, y1 = _slab(levels, frame, 1, y)
    z0, z1 = _slab(levels, frame, 2, z)
    y0, y1, z0, z1 = y0 - origin[1], y1 - origin[1], z0 - origin[2], z1 - origin[2]
    low, high = -reach[0], reach[0]
    for j in range(3):
        ax, ay, az = axes[j, 0], axes[j, 1], axes[j, 2]
        most = half[j] + pad - min(ay * y0, ay * y1) - min(az * z0, az * z1)
        least = -half[j] - pad - max(ay * y0, ay * y1) - max(az * z0, az * z1)
        if abs(ax) > 1e-12:
            low = max(low, min(least / ax, most / ax) - pad)
            high = min(high, max(least / ax, most / ax) + pad)
        elif least > 0.0 or most < 0.0:
            return 0, -1
    if low > high:
        return 0, -1
    return _span(levels, frame, 0, origin[0] + low, origin[0] + high)


@njit(cache=True, inline="always")
def _scalars(origin: Floats, axes: Floats, half: Floats) -> tuple[float, ...]:
    """The numbers of a box one by one: kept in registers, a loop over points takes half the time."""
    return (
        origin[0], origin[1], origin[2], half[0], half[1], half[2],
        axes[0, 0], axes[0, 1], axes[0, 2],
        axes[1, 0], axes[1, 1], axes[1, 2],
        axes[2, 0], axes[2, 1], axes[2, 2],
    )  # fmt: skip


@njit(cache=True)
def _rows(
    starts: Cells, levels: Ints, frame: Floats, origin: Floats, axes: Floats, half: Floats
) -> tuple[Ints, int]:
    """The cells that may meet a box, as runs (rows, 3) of cell numbers, the first and one past the last, with
    their number of points; and the number of runs, empty ones left out."""
    reach = np.empty(3)
    pad = _box_reach(frame, origin, axes, half, reach)
    first_y, last_y = _span(levels, frame, 1, origin[1] - reach[1], origin[1] + reach[1])
    first_z, last_z = _span(levels, frame, 2, origin[2] - reach[2], origin[2] + reach[2])
    out = np.empty(((last_y - first_y + 1) * (last_z - first_z + 1), 3), np.int64)
    i = 0
    for z in range(first_z, last_z + 1):
        for y in range(first_y, last_y + 1):
            x0, x1 = _clip_row(levels, frame, origin, axes, half, reach, pad, y, z)
            row = (z * levels[0, 1] + y) * levels[0, 0]
            held = starts[row + x1 + 1] - starts[row + x0] if x1 >= x0 else 0
            out[i, 0], out[i, 1], out[i, 2] = row + x0, row + x1 + 1, held
            i += held > 0
    return out, i


@njit(forceinline=True)
def _cell_points(points: Floats, first: int, last: int, place: tuple[float, ...], cell: Floats) -> int:
    """Box coordinates of the points `first` to `last` - 1 that a box holds, into cell (3, k); how many."""
    ox, oy, oz, hx, hy, hz, xx, xy, xz, yx, yy, yz, zx, zy, zz = place
    k = 0
    for j in range(first, last):
        dx, dy, dz = points[j, 0] - ox, points[j, 1] - oy, points[j, 2] - oz
        px = dx * xx + dy * xy + dz * xz
        py = dx * yx + dy * yy + dz * yz
        pz = dx * zx + dy * zy + dz * zz
        cell[0, k], cell[1, k], cell[2, k] = px, py, pz
        k += abs(px) <= hx and abs(py) <= hy and abs(pz) <= hz
    return k


@njit(forceinline=True)
def _put(row: Floats, cell: Floats, j: int) -> None:
    row[0], row[1], row[2] = cell[0, j], cell[1, j], cell[2, j]


@njit(cache=True)
def box_points(
    points: Floats,
    starts: Cells,
    levels: Ints,
    frame: Floats,
    origin: Floats,
    axes: Floats,
    half: Floats,
    every: int,
) -> tuple[Floats, int]:
    """Box coordinates of the points of a box, in a buffer, and their number: by cell, sorted in each.

    every: about one of so many is taken, spread evenly; of the others whole cells are not even looked at.
    """
    rows, n = _rows(starts, levels, frame, origin, axes, half)
    total, largest = 0, 0
    for i in range(n):
        total += rows[i, 2]
        for c in range(rows[i, 0], rows[i, 1]):
            largest = max(largest, starts[c + 1] - starts[c])
    place = _scalars(origin, axes, half)
    out = np.empty((total, 3))
    cell, order = np.empty((3, largest)), np.empty(largest, np.int64)
    m = 0
    for i in range(n):
        block, chosen = np.int64(-1), np.int64(-1)
        for c in range(rows[i, 0], rows[i, 1]):
            first, last = np.int64(starts[c]), np.int64(starts[c + 1])
            if first == last:
                continue
            if every > 1:
                if block < 0:
                    block = first // every - 1
                while chosen < first:
                    block += 1
                    chosen = chosen_row(block, every)
                if chosen >= last:
                    continue
            k = _cell_points(points, first, last, place, cell)
            ordered(cell, k, order)
            if every == 1:
                for j in range(k):
                    _put(out[m + j], cell, order[j])
                m += k
                continue
            while chosen < first + k:
                _put(out[m], cell, order[chosen - first])
                m += 1
                block += 1
                chosen = chosen_row(block, every)
    return out, m


@njit(cache=True)
def box_count(starts: Cells, levels: Ints, frame: Floats, origin: Floats, axes: Floats, half: Floats) -> int:
    """About how many points a box holds: those of the cells whose middles it holds, or may hold in height."""
    rows, n = _rows(starts, levels, frame, origin, axes, half)
    high = half[2]
    for a in range(3):
        high += 0.5 * abs(axes[2, a]) * frame[3 + a]
    total = 0
    for i in range(n):
        for c in range(rows[i, 0], rows[i, 1]):
            if starts[c] == starts[c + 1]:
                continue
            row = c // levels[0, 0]
            dx = frame[0] + (c - row * levels[0, 0] + 0.5) * frame[3] - origin[0]
            dy = frame[1] + (row % levels[0, 1] + 0.5) * frame[4] - origin[1]
            dz = frame[2] + (row // levels[0, 1] + 0.5) * frame[5] - origin[2]
            px = dx * axes[0, 0] + dy * axes[0, 1] + dz * axes[0, 2]
            py = dx * axes[1, 0] + dy * axes[1, 1] + dz * axes[1, 2]
            pz = dx * axes[2, 0] + dy * axes[2, 1] + dz * axes[2, 2]
            if abs(px) <= half[0] and abs(py) <= half[1] and abs(pz) <= high:
                total += starts[c + 1] - starts[c]
    return total


@njit(cache=True)
def box_bins(
    points: Floats,
    starts: Cells,
    levels: Ints,
    frame: Floats,
    origin: Floats,
    axes: Floats,
    half: Floats,
    nx: int,
    ny: int,
) -> Floats:
    """Box coordinates (m, 3) of the point nearest to the centre of every occupied bin, bin by bin."""
    reach = np.empty(3)
    pad = _box_reach(frame, origin, axes, half, reach)
    first_y, last_y = _span(levels, frame, 1, origin[1] - reach[1], origin[1] + reach[1])
    first_z, last_z = _span(levels, frame, 2, origin[2] - reach[2], origin[2] + reach[2])
    best = np.full(nx * ny, np.inf)
    kept = np.empty((nx * ny, 3))
    one = np.empty((1, 3))
    wide_x, wide_y = 2.0 * half[0] / nx, 2.0 * half[1] / ny
    per_x, per_y = 1.0 / wide_x, 1.0 / wide_y
    ox, oy, oz, hx, hy, hz, xx, xy, xz, yx, yy, yz, zx, zy, zz = _scalars(origin, axes, half)
    for z in range(first_z, last_z + 1):
        for y in range(first_y, last_y + 1):
            x0, x1 = _clip_row(levels, frame, origin, axes, half, reach, pad, y, z)
            row = (z * levels[0, 1] + y) * levels[0, 0]
            if x1 < x0:
                continue
            for j in range(starts[row + x0], starts[row + x1 + 1]):
                dx, dy, dz = points[j, 0] - ox, points[j, 1] - oy, points[j, 2] - oz
                px = dx * xx + dy * xy + dz * xz
                py = dx * yx + dy * yy + dz * yz
                pz = dx * zx + dy * zy + dz * zz
                if not (abs(px) <= hx and abs(py) <= hy and abs(pz) <= hz):
                    continue
                u, v = min(int((px + hx) * per_x), nx - 1), min(int((py + hy) * per_y), ny - 1)
                du, dv = px + hx - (u + 0.5) * wide_x, py + hy - (v + 0.5) * wide_y
                d, b = du * du + dv * dv, v * nx + u
                if d > best[b]:
                    continue
                one[0, 0], one[0, 1], one[0, 2] = px, py, pz
                if d < best[b] or before(one, 0, kept, b):
                    best[b] = d
                    kept[b, 0], kept[b, 1], kept[b, 2] = px, py, pz
    return kept[best < np.inf]


@njit(cache=True)
def box_fault(origin: Floats, axes: Floats, half: Floats) -> int:
    """0 for a box; 1 for an origin that is not finite, 2 axes that are not orthonormal, 3 half sizes."""
    for a in range(3):
        if not abs(origin[a]) <= LIMIT:
            return 1
        for b in range(3):
            dot = axes[a, 0] * axes[b, 0] + axes[a, 1] * axes[b, 1] + axes[a, 2] * axes[b, 2]
            if not abs(dot - (a == b)) <= 1e-6:
                return 2
        if not 0.0 < half[a] <= LIMIT:
            return 3
    return 0


@njit(cache=True)
def ball_points(
    points: Floats, starts: Cells, levels: Ints, frame: Floats, centre: Floats, radius: float
) -> tuple[Floats, int]:
    """The points within a radius, in a buffer, and their number: by cell, sorted in each."""
    spans = np.empty((3, 2), np.int64)
    for a in range(3):
        reach = radius * (1.0 + 1e-14) + 1e-15 * abs(centre[a])
        spans[a, 0], spans[a, 1] = _span(levels, frame, a, centre[a] - reach, centre[a] + reach)
    total, m = 0, 0
    out = np.empty((0, 3))
    for fill in range(2):
        for z in range(spans[2, 0], spans[2, 1] + 1):
            for y in range(spans[1, 0], spans[1, 1] + 1):
                row = (z * levels[0, 1] + y) * levels[0, 0]
                if fill == 0:
                    total += starts[row + spans[0, 1] + 1] - starts[row + spans[0, 0]]
                    continue
                for c in range(row + spans[0, 0], row + spans[0, 1] + 1):
                    run = m
                    for j in range(starts[c], starts[c + 1]):
                        dx, dy, dz = (
                            points[j, 0] - centre[0],
                            points[j, 1] - centre[1],
                            points[j, 2] - centre[2],
                        )
                        copy_into(out[m], points[j])
                        m += dx * dx + dy * dy + dz * dz <= radius * radius
                    sort_rows(out, run, m)
        if fill == 0:
            out = np.empty((total, 3))
    return out, m
