"""Which scan point is meant by a place on the screen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
REACH = 8.0
"""Pixels from the cursor up to which a point is meant."""
_BLOCK = 500_000
_BEHIND = 0.01
"""Depth behind the nearest point, of 2 in all, up to which others are on the same surface."""


def picked(
    points: Array, matrix: Array, size: tuple[int, int], cursor: tuple[float, float], reach: float = REACH
) -> int | None:
    """The number of the point that the cursor is on: the nearest to it on the screen of those in front.

    points (n, 3); matrix (4, 4): from homogeneous coordinates of the scan to the camera's, in which all that
    is seen lies from -1 to 1 (vtkCamera.GetCompositeProjectionTransformMatrix); size: width and height of the
    picture in pixels; cursor: x from the left, y from the bottom, in pixels. None: there is no point.
    """
    best: list[tuple[float, float, int]] = []
    scale = 0.5 * np.array(size, dtype=float)
    for first in range(0, len(points), _BLOCK):
        block = points[first : first + _BLOCK]
        seen = block @ matrix[:, :3].T + matrix[:, 3]
        with np.errstate(divide="ignore", invalid="ignore"):
            places = seen[:, :3] / seen[:, 3:]
            apart = np.hypot(*((places[:, :2] + 1.0) * scale - cursor).T)
        near = np.flatnonzero((apart <= reach) & (np.abs(places[:, 2]) <= 1.0) & (seen[:, 3] > 0))
        best += [(float(places[i, 2]), float(apart[i]), first + int(i)) for i in near]
    if not best:
        return None
    front = min(best)[0]
    # Depths are not even under perspective; near one place they are.
    return min((b for b in best if b[0] <= front + _BEHIND), key=lambda b: b[1])[2]


def thinned(count: int, most: int) -> NDArray[np.int64]:
    """Numbers of at most `most` of so many points, the same each time, spread evenly over their order."""
    if count <= most:
        return np.arange(count)
    return (np.arange(most) * (count / most)).astype(np.int64)
