"""Passes over scan points that need no memory beside them: finite check, bounds, spread, ball."""

import numba as nb
import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import copy_into

Array = NDArray[np.float64]

# Beyond this a squared distance may overflow, so such a coordinate counts as not finite.
LARGEST = 1e100


@nb.njit(cache=True)
def finite_bounds(points: Array) -> tuple[int, Array]:
    """Count the rows of (n, 3) points that are not finite; (2, 3) lowest and highest of the others."""
    bounds = np.empty((2, 3))
    x_low = y_low = z_low = np.inf
    x_high = y_high = z_high = -np.inf
    bad = 0
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        # NaN fails every comparison, so one test covers NaN, inf and too large.
        if not (abs(x) <= LARGEST and abs(y) <= LARGEST and abs(z) <= LARGEST):
            bad += 1
            continue
        x_low, x_high = min(x_low, x), max(x_high, x)
        y_low, y_high = min(y_low, y), max(y_high, y)
        z_low, z_high = min(z_low, z), max(z_high, z)
    bounds[0, 0], bounds[0, 1], bounds[0, 2] = x_low, y_low, z_low
    bounds[1, 0], bounds[1, 1], bounds[1, 2] = x_high, y_high, z_high
    return bad, bounds


@nb.njit(cache=True)
def finite_rows(points: Array) -> NDArray[np.bool_]:
    """Mark the rows of (n, 3) points that `finite_bounds` takes as finite."""
    keep = np.empty(points.shape[0], dtype=np.bool_)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        keep[i] = abs(x) <= LARGEST and abs(y) <= LARGEST and abs(z) <= LARGEST
    return keep


@nb.njit(cache=True)
def distinct_points(points: Array, enough: int) -> int:
    """Count distinct rows of (n, 3) points, stopping at `enough`."""
    seen = np.empty((enough, 3))
    count = 0
    for i in range(points.shape[0]):
        new = True
        for j in range(count):
            if points[i, 0] == seen[j, 0] and points[i, 1] == seen[j, 1] and points[i, 2] == seen[j, 2]:
                new = False
                break
        if new:
            copy_into(seen[count], points[i])
            count += 1
            if count == enough:
                break
    return count


@nb.njit(cache=True)
def off_line(points: Array, diagonal: float, tolerance: float) -> bool:
    """Whether some row of (n, 3) points is farther than `tolerance` from a line through two of them.

    `diagonal` is that of the bounding box: some point is always at 0.28 of it or more from the first.
    """
    n = points.shape[0]
    ax, ay, az = points[0, 0], points[0, 1], points[0, 2]
    dx = dy = dz = length = 0.0
    for i in range(n):
        dx, dy, dz = points[i, 0] - ax, points[i, 1] - ay, points[i, 2] - az
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        if length >= 0.25 * diagonal:
            break
    if length == 0.0:
        return False
    dx, dy, dz = dx / length, dy / length, dz / length
    for i in range(n):
        x, y, z = points[i, 0] - ax, points[i, 1] - ay, points[i, 2] - az
        cx, cy, cz = y * dz - z * dy, z * dx - x * dz, x * dy - y * dx
        if cx * cx + cy * cy + cz * cz > tolerance * tolerance:
            return True
    return False


@nb.njit(cache=True)
def ball_count(points: Array, centre: Array, radius: float) -> tuple[int, float]:
    """Number of rows of (n, 3) points within `radius` of `centre`, and the distance of the nearest."""
    count = 0
    nearest = np.inf
    limit = radius * radius
    for i in range(points.shape[0]):
        x, y, z = points[i, 0] - centre[0], points[i, 1] - centre[1], points[i, 2] - centre[2]
        square = x * x + y * y + z * z
        nearest = min(nearest, square)
        if square <= limit:
            count += 1
    return count, np.sqrt(nearest)


@nb.njit(cache=True)
def ball_points(points: Array, centre: Array, radius: float, count: int) -> Array:
    """The `count` rows that `ball_count` found, in their order: (count, 3)."""
    found = np.empty((count, 3))
    limit = radius * radius
    k = 0
    for i in range(points.shape[0]):
        x, y, z = points[i, 0] - centre[0], points[i, 1] - centre[1], points[i, 2] - centre[2]
        if x * x + y * y + z * z <= limit:
            copy_into(found[k], points[i])
            k += 1
    return found
