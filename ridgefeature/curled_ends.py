"""Ends that fall to the base within a width: there nothing tells where the path leads: it goes on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.medians import median
from ridgefeature.stations import unit

Array = NDArray[np.float64]

_LOW, _DOWN = 0.95, 0.6
"""Height below which an end has begun to fall, and to which it must, in that further in."""
_LEVEL = 0.8
"""Least height there, in the largest: else the ridge fades."""
_CAP, _IN = 1.0, 2.5
"""How far from the end, in widths, it may begin to fall; and up to where the path tells how it goes on."""
_FEWEST = 4
_CURL = 0.1
"""Distance sideways, in widths, from the path as it went on, above which an end has curled."""


def uncurled(spine: Array, normal: Array, height: Array, width: Array) -> Array:
    """The spine (k, 3) of an open ridge, without a curl to one side where an end falls to the base.

    normal (k, 3), height and width (k,) at the same places. A rounded end that is seen from one side alone,
    or cut at a slant, is highest off the path's line. The path goes on there with the curvature that it had.
    """
    first = _straight_start(spine, normal, np.abs(height), width)
    last = _straight_start(first[::-1], normal[::-1], np.abs(height[::-1]), width[::-1])
    return last[::-1]


def _straight_start(spine: Array, normal: Array, height: Array, width: Array) -> Array:
    usual = median(width)
    if not usual > 0:
        return spine
    steps = np.linalg.norm(np.diff(spine, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)]) / usual
    inner = (along > _CAP) & (along < _IN)
    if inner.sum() < _FEWEST:
        return spine
    high = median(height[inner])
    if height[0] > _DOWN * high or height[inner].min() < _LEVEL * height[inner].max():
        return spine
    count = int(np.argmin((height < _LOW * high) & (along < _CAP)))
    last = int(np.flatnonzero(inner)[-1])
    tangent = unit(spine[last] - spine[count])
    left = unit(np.cross(normal[count], tangent))
    across = np.stack([tangent, left]).T
    x, y = np.diff(spine[: last + 1] @ across, axis=0).T
    turn = np.unwrap(np.arctan2(y, x))
    middle = 0.5 * (along[: last + 1][1:] + along[: last + 1][:-1])
    goes_on = np.polyval(np.polyfit(middle[count:], turn[count:], 1), middle[:count])
    ahead = np.column_stack([np.cos(goes_on), np.sin(goes_on)])
    step = (np.column_stack([x, y])[:count] * ahead).sum(axis=1, keepdims=True) * ahead
    path = spine[count] @ across - np.cumsum(step[::-1], axis=0)[::-1]
    moved = path - spine[:count] @ across
    if np.linalg.norm(moved, axis=1).max() < _CURL * usual:
        return spine
    new = spine.copy()
    new[:count] += moved @ across.T
    return new
