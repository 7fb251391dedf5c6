"""A cell grid over unordered points: the points of a box or a ball, and nearest distances, in microseconds.

The grid holds a copy of the points, sorted by cell, and no other array of their size. Results never depend,
in any bit, on the order in which the points came: the cells follow from extremes and integer counts, and
what a query returns is sorted within each cell. That is done at the query, for the returned points only:
sorting all cells while building would cost more than the counting sort itself. So a grid is never changed,
and threads may share it.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from ridgefeature.medians import median

from .kernels import grid as kernels
from .kernels import nearest as nearest_kernels
from .kernels import window

Floats = npt.NDArray[np.float64]
Levels = npt.NDArray[np.int64]
A = TypeVar("A", bound=npt.NDArray[np.generic])

CROWD = 12.0  # points in a cell, where there are any
ELONGATION = 8.0  # of the cells along the thinnest extent: a scan needs few layers there
STRAYS = 200  # one point in so many, at either end of an axis, may lie outside the cells


@dataclass(frozen=True, eq=False)
class Grid:
    """Points sorted by cell (see kernels/grid.py for the arrays). Made by `build_grid`; never changed."""

    points: Floats
    starts: npt.NDArray[np.int32]
    tree: npt.NDArray[np.uint8]
    levels: Levels
    frame: Floats


def build_grid(points: npt.ArrayLike, bounds: Floats | None = None) -> Grid:
    """Index points (n, 3), n >= 1. Raises ValueError unless they are finite and of that shape.

    bounds (2, 3): their least and greatest coordinates, where these are known and finite.
    """
    rows = as_points(points)
    box, bad = kernels.bounds(rows) if bounds is None else (bounds.ravel(), -1)
    if bad >= 0:
        raise ValueError(
            f"expected finite coordinates (below {kernels.LIMIT:g}), got {rows[bad].tolist()} in row {bad}; "
            "remove such points first"
        )
    levels, frame = _choose_cells(rows, box)
    nx, ny, nz = (int(count) for count in levels[0, :3])
    starts = np.zeros(nx * ny * nz + 1, np.int32)
    kernels.count_cells(rows, levels, frame, starts)
    ordered = np.empty((len(rows), 3))
    kernels.sort_into_cells(rows, levels, frame, starts, ordered)
    tree = np.zeros(int(levels[-1, 3]) + 1, np.uint8)
    kernels.fill_tree(starts, levels, tree)
    return Grid(_fixed(ordered), _fixed(starts), _fixed(tree), _fixed(levels), _fixed(frame))


def points_in_box(
    grid: Grid,
    origin: npt.ArrayLike,
    axes: npt.ArrayLike,
    half_sizes: npt.ArrayLike,
    cells: tuple[int, int] | None = None,
    check: bool = True,
) -> Floats:
    """The points of an oriented box, in the box's frame: (p - origin) @ axes.T, (m, 3).

    origin (3,), the middle of the box; axes (3, 3), its unit vectors as rows; half_sizes (3,), finite,
    above 0. A point belongs to it if |coordinate| <= half size for all three. The order is canonical. cells
    (nx, ny): keep, in each bin of an nx x ny grid over the box's x and y, only the point nearest to the
    bin's centre in x and y; in the order of the bins, x fastest. It depends on nothing but box coordinates.
    Raises ValueError for a box that is not one, unless check is False.
    """
    centre, frame, half = _vector(origin, (3,)), _vector(axes, (3, 3)), _vector(half_sizes, (3,))
    fault = window.box_fault(centre, frame, half) if check else 0
    if fault:
        raise ValueError(_BOX_FAULTS[fault] + f", got origin {centre}, axes {frame}, half sizes {half}")
    if cells is None:
        found, m = window.box_points(
            grid.points, grid.starts, grid.levels, grid.frame, centre, frame, half, 1
        )
        return found[:m]
    nx, ny = cells
    if nx < 1 or ny < 1:
        raise ValueError(f"expected at least one bin each way, got cells={cells}; pass (nx, ny) or None")
    return window.box_bins(grid.points, grid.starts, grid.levels, grid.frame, centre, frame, half, nx, ny)


_BOX_FAULTS = {
    1: "expected a finite origin of the box",
    2: "expected three orthonormal axes as rows",
    3: "expected finite half sizes above 0",
}


def points_in_ball(grid: Grid, centre: npt.ArrayLike, radius: float) -> Floats:
    """The points within `radius` (finite, >= 0) of `centre` (3,): (m, 3), in canonical order."""
    middle = _vector(centre, (3,))
    if not (0.0 <= radius <= kernels.LIMIT and np.isfinite(middle).all()):
        raise ValueError(f"expected a finite centre and a finite radius >= 0, got {middle} and {radius}")
    found, m = window.ball_points(grid.points, grid.starts, grid.levels, grid.frame, middle, float(radius))
    return found[:m]


def nearest(grid: Grid, queries: npt.ArrayLike, k: int = 1) -> tuple[Floats, Floats]:
    """The k nearest points to each of the queries (m, 3): distances (m, k), ascending, and points (m, k, 3).

    Exact, also far away from all points. Points at the same distance come in the order of x, y, z.
    Raises ValueError unless 1 <= k <= n and the queries are finite.
    """
    distances, rows = _search(grid, queries, k)
    return distances, grid.points[rows]


def nearest_distances(grid: Grid, queries: npt.ArrayLike, k: int = 1) -> Floats:
    """As `nearest`, the distances (m, k) alone."""
    return _search(grid, queries, k)[0]


def nearest_distance(grid: Grid, point: npt.ArrayLike) -> float:
    """The distance from one point (3,) to the nearest point of the grid."""
    return float(_search(grid, np.reshape(_vector(point, (3,)), (1, 3)), 1)[0][0, 0])


def typical_spacing(grid: Grid, probes: int = 256) -> float:
    """Median distance to the nearest other point, duplicates aside, at 256 places spread over the points.

    About 0.47 / sqrt(density) for random points on a surface, the grid step for regular ones. 0 if all
    points coincide.
    """
    n = len(grid.points)
    m = min(probes, n)
    places = (2 * np.arange(m, dtype=np.int64) + 1) * n // (2 * m)
    cells = np.searchsorted(grid.starts, places.astype(np.int32), side="right") - 1
    chosen = kernels.probe_cells(grid.points, grid.starts, grid.levels, grid.frame, cells)
    for k in (min(4, n), min(32, n)):
        distances = nearest_distances(grid, chosen, k)
        apart = np.where(distances > 0.0, distances, np.inf).min(axis=1)
        apart = apart[apart < np.inf]
        if 2 * len(apart) >= m:
            break
    return median(apart) if len(apart) else 0.0


def as_points(points: npt.ArrayLike) -> Floats:
    """A read-only (n, 3) float64 view, or copy where needed. Raises ValueError unless (n, 3) real, n >= 1."""
    try:
        rows = _plain(points)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"expected points as an (n, 3) array of numbers, got {type(points).__name__}"
        ) from error
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise ValueError(
            f"expected points as an (n, 3) array, got shape {rows.shape}; pass one row x, y, z a point"
        )
    if not 1 <= len(rows) < 2**31:
        raise ValueError(f"expected between 1 and 2^31 - 1 points, got {len(rows)}")
    return rows


def _search(grid: Grid, queries: npt.ArrayLike, k: int) -> tuple[Floats, npt.NDArray[np.int64]]:
    if not 1 <= k <= len(grid.points):
        raise ValueError(f"expected 1 <= k <= {len(grid.points)}, the number of points, got k = {k}")
    asked = _plain(queries)
    if asked.ndim != 2 or asked.shape[1] != 3:
        raise ValueError(f"expected queries as an (m, 3) array, got shape {asked.shape}")
    best = np.empty((len(asked), k))
    rows = np.empty((len(asked), k), np.int64)
    if not nearest_kernels.search(
        grid.points, grid.starts, grid.tree, grid.levels, grid.frame, asked, best, rows
    ):
        raise ValueError("expected finite queries, got NaN or infinite coordinates; remove such rows first")
    return best, rows


def _vector(values: npt.ArrayLike, shape: tuple[int, ...]) -> Floats:
    array = _plain(values)
    if array.shape != shape:
        raise ValueError(f"expected an array of shape {shape}, got shape {array.shape}")
    return array


def _plain(values: npt.ArrayLike) -> Floats:
    array = np.ascontiguousarray(values, np.float64)
    return _fixed(array if array.flags.aligned else array.copy())


def _fixed(array: A) -> A:
    """A read-only view: the kernels are compiled once, for read-only input, whatever the caller has."""
    view = array.view()
    view.setflags(write=False)
    return view


def _choose_cells(points: Floats, box: Floats) -> tuple[Levels, Floats]:
    """Cells of about CROWD points where there are points, and at most n cells in all.

    A coarse count finds the range of nearly all points, narrowed until strays no longer stretch it, and how
    crowded they are: the mean number of others in a point's cell, which strays hardly change.
    """
    n = len(points)
    low, high = box[:3].copy(), box[3:].copy()
    bins = 32 if n < 300_000 else 64
    narrowed = True
    while narrowed:  # by a third or less each time, so that this ends
        size = max(float((high - low).max()) / bins, 1e-140)
        levels, frame = _layout(low, high, np.full(3, size), box)
        counts = np.zeros(int(levels[0, :3].prod()), np.int32)
        kernels.count_cells(points, levels, frame, counts)
        block = counts.reshape(levels[0, 2::-1])
        profiles = [block.sum(axis=axes, dtype=np.int64) for axes in ((0, 1), (0, 2), (1, 2))]
        narrowed = _narrow(profiles, n // STRAYS, size, low, high, 1 / 3)
    _narrow(profiles, n // STRAYS, size, low, high, 1.0)
    crowd = float(np.dot(counts, counts.astype(np.int64)) - n) / n
    sizes = np.full(3, size * (CROWD / crowd) ** 0.5 if crowd > 0.0 else size)
    limit = max(n, 64)
    thin = int(np.argmax([np.dot(profile, profile) for profile in profiles]))
    sizes[thin] *= min(max(_cells(low, high, sizes) / limit, 1.0), ELONGATION)
    while (cells := _cells(low, high, sizes)) > limit:
        sizes *= max((cells / limit) ** (1.0 / 3.0), 1.01)
    return _layout(low, high, sizes, box)


def _narrow(profiles: list[Levels], spare: int, size: float, low: Floats, high: Floats, share: float) -> bool:
    """Narrow low and high, in place, to all but `spare` points a side, where that leaves `share` or less."""
    narrowed = False
    for axis, profile in enumerate(profiles):
        below = profile.cumsum()
        first = max(int(np.searchsorted(below, spare, side="right")) - 1, 0)
        last = min(int(np.searchsorted(below, below[-1] - spare, side="left")) + 1, len(below) - 1)
        if last + 1 - first <= share * len(below):
            low[axis], high[axis] = low[axis] + first * size, min(high[axis], low[axis] + (last + 1) * size)
            narrowed = True
    return narrowed


def _cells(low: Floats, high: Floats, sizes: Floats) -> float:
    return float(np.maximum(np.ceil((high - low) / sizes), 1.0).prod())


def _layout(low: Floats, high: Floats, sizes: Floats, box: Floats) -> tuple[Levels, Floats]:
    """The arrays `levels` and `frame` for cells of these sizes from low to high; box bounds all points."""
    shape = np.maximum(np.ceil((high - low) / sizes), 1.0).astype(np.int64)
    levels, offset = [[*shape, 0]], 0
    while shape.max() > 1:
        shape = (shape + 1) // 2
        levels.append([*shape, offset])
        offset += int(shape.prod())
    slack = 1e-14 * np.maximum(np.abs(low), np.abs(high))
    return np.array(levels, np.int64), np.concatenate((low, sizes, 1.0 / sizes, box, slack))
