"""What follows an end of a ridge, by the points there: the base, as it was before, or something else."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.continuation import FLAT
from ridgefeature.grid import Grid, points_in_box
from ridgefeature.medians import median
from ridgefeature.stations import Stations

Array = NDArray[np.float64]

ABOVE = "no ridge: what follows stands above the base"
BELOW = "no ridge: what follows lies below the base"
_KNOWN = (0.75, 3.0)
"""Distances from an end, in widths, between which the base is told: an end may have run up what follows."""
_AHEAD = (0.2, 1.0)
"""Those beyond it between which points are asked; aside they are asked as far as the feet."""
_REACH = (3.0, 0.5)
"""Heights and widths, in all, from the base up to which they are."""
_OFF, _MOST, _FEWEST = 0.5, 0.7, 8
"""Heights of the ridge from which on a point is off the base; share of such points, of so many at least, that
tells something else: scatter, strays and the far side of a sheet are less."""


def told_ends(grid: Grid, stations: Stations, stop: tuple[str, str]) -> tuple[str, str]:
    """Why each end stopped; what follows it in its place, where the points are not those of a base."""
    first, last = (
        (what_follows(grid, stations, k) or why) if why == FLAT else why for k, why in enumerate(stop)
    )
    return first, last


def what_follows(grid: Grid, stations: Stations, end: int) -> str:
    """ABOVE or BELOW, if points beyond the start (end = 0) or the end (1) are so; else empty."""
    height, width = median(np.abs(stations.height)), median(stations.width)
    last, outwards = (0, -1.0) if end == 0 else (-1, 1.0)
    near, bend = _base(stations, last, width)
    frame = _frame(stations, near)
    place, ahead = (stations.spine[last] - stations.spine[near]) @ frame, stations.tangent[last] @ frame
    ahead = outwards * ahead * [1.0, 1.0, 0.0] / max(float(np.hypot(*ahead[:2])), 1e-300)
    middle = place + 0.5 * sum(_AHEAD) * width * ahead
    middle[2] = middle[:2] ** 2 @ bend
    axes = np.stack([ahead, np.cross([0.0, 0.0, 1.0], ahead), [0.0, 0.0, 1.0]])
    half = [0.5 * (_AHEAD[1] - _AHEAD[0]) * width, 0.5 * width, _REACH[0] * height + _REACH[1] * width]
    centre = stations.spine[near] + frame @ middle
    found = points_in_box(grid, centre, axes @ frame.T, np.array(half), None, check=False)
    points = found @ axes + middle
    off = (points[:, 2] - points[:, :2] ** 2 @ bend) / height
    if len(off) < _FEWEST:
        return ""
    return ABOVE if (off > _OFF).mean() > _MOST else BELOW if (off < -_OFF).mean() > _MOST else ""


def _base(stations: Stations, last: int, width: float) -> tuple[int, Array]:
    """A station before the last one, and how the base is bent along and across from there, halved (2,)."""
    gone = np.abs(stations.arc_length - stations.arc_length[last])
    first = min(_KNOWN[0] * width, 0.5 * float(gone.max()))
    known = np.flatnonzero((gone >= first) & (gone <= _KNOWN[1] * width))
    near = int(known[np.argmin(gone[known])])
    x, y, z = ((stations.spine[known] - stations.spine[near]) @ _frame(stations, near)).T
    across = 0.5 * float(stations.curvature[near])
    along = float(x**2 @ (z - across * y**2)) / max(float((x**4).sum()), 1e-300)
    return near, np.array([along, across])


def _frame(stations: Stations, at: int) -> Array:
    """(3, 3) tangent, left and normal at a station, as columns."""
    tangent, normal = stations.tangent[at], stations.normal[at]
    return np.column_stack([tangent, np.cross(normal, tangent), normal])
