"""Flanks that a path or a face would fold, narrowed; OCP only, no cadquery."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cad_export.strip import Samples, speed_of
from ridgefeature.merge import LEAST_BORDER
from ridgefeature.ridge import Ridge

Floats = NDArray[np.float64]

UNFOLDED = 0.3
"""What one goes along a flank's border for a step along the path must be this part of that, at least.

Nearer to a fold, surfaces of ridges with uneven bends cross themselves between stations.
"""
_AROUND = 3  # stations to either side that are narrowed alike
_SPARE = 1.05


def narrowed(strip: Samples, ridge: Ridge, w: float = 1.0) -> Ridge:
    """The ridge with narrower flanks where the strip of its borders folds, or nearly.

    strip: samples of the ridge's base. Flanks stay broad enough for the feet at the rate w. It is the very
    same ridge where nothing is to be done.
    """
    room = np.minimum(*(_unfolded(strip, side) for side in (-1, 1)))
    if not np.isfinite(room).any():
        return ridge
    s = ridge.arc_length
    reach = (_AROUND + 0.5) * s[1]
    gap = np.abs(s[:, None] - strip.s)
    gap = np.minimum(gap, ridge.length - gap) if strip.closed else gap
    near = np.where(gap <= reach, room, np.inf).min(axis=1)
    least = _SPARE * LEAST_BORDER * ridge.width * w
    return replace(ridge, border=np.minimum(ridge.border, np.maximum(near, least)))


def _unfolded(strip: Samples, side: int) -> Floats:
    """(n,) how far to one side the strip is unfolded, where that is less than its breadth; else inf."""
    middle = strip.y.shape[1] // 2
    speed = speed_of(strip)
    speed = (speed / speed[:, [middle]])[:, middle::side]
    y = np.abs(strip.y[:, middle::side])
    low = speed < UNFOLDED
    first = np.maximum(low.argmax(axis=1), 1)
    row = np.arange(len(y))
    a, b = speed[row, first - 1], speed[row, first]
    share = (a - UNFOLDED) / np.where(a > b, a - b, 1.0)
    found = y[row, first - 1] + share * (y[row, first] - y[row, first - 1])
    return np.where(low.any(axis=1), found, np.inf)
