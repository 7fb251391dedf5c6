"""Splines that rise to one apex and fall from it, symmetric or not: least squares with steps of one sign."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Array = NDArray[np.float64]

_NEAR_TOP = 0.6
"""Part of the largest coefficient from which on one may be the top."""


def one_hump(free: Array, root: Array) -> tuple[Array, float]:
    """The coefficients (n,) with one hump and none below 0 that are nearest to free ones, and their loss.

    root (n, n): the loss is the squared length of root (x - free).
    """
    change = np.sign(np.diff(free, prepend=0.0, append=0.0))
    if (np.diff(change[change != 0]) != 0).sum() <= 1:
        return free, 0.0
    n, up = len(free), np.tri(len(free))
    at = np.arange(n)
    best, kept = np.inf, free
    for top in np.flatnonzero(free > _NEAR_TOP * free.max()):
        # Sums from the left up to the top, and from the right beyond it, of steps that are all upwards.
        same_side = (at[:, None] <= top) == (at <= top)
        sums = np.where(at[:, None] <= top, up, up.T) * same_side
        steps, miss = nnls(root @ sums, root @ free)
        if miss < best:
            best, kept = float(miss), sums @ steps
    return kept, best**2


def symmetric_hump(free: Array, root: Array) -> tuple[Array, float, float]:
    """The same if they are symmetric about their middle, by how many knots they are moved, and their loss.

    The move, to the right, is to first order.
    """
    n = len(free)
    half = np.tri(n)[:, : (n + 1) // 2]
    sums = np.minimum(half, half[::-1])
    padded = np.concatenate([[0.0], 0.5 * (free + free[::-1]), [0.0]])
    moved = 0.5 * (padded[:-2] - padded[2:])[:, None]
    steps, miss = nnls(root @ np.hstack([sums, moved, -moved]), root @ free)
    return sums @ steps[:-2], float(steps[-2] - steps[-1]), float(miss) ** 2
