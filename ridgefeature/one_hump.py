"""Splines that rise to one apex and fall from it, symmetric or not: least squares with steps of one sign."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
        steps, loss = not_negative(root @ sums, root @ free)
        if loss < best:
            best, kept = loss, sums @ steps
    return kept, best


def symmetric_hump(free: Array, root: Array) -> tuple[Array, float, float]:
    """The same if they are symmetric about their middle, by how many knots they are moved, and their loss.

    The move, to the right, is to first order.
    """
    n = len(free)
    half = np.tri(n)[:, : (n + 1) // 2]
    sums = np.minimum(half, half[::-1])
    padded = np.concatenate([[0.0], 0.5 * (free + free[::-1]), [0.0]])
    moved = 0.5 * (padded[:-2] - padded[2:])[:, None]
    steps, loss = not_negative(root @ np.hstack([sums, moved, -moved]), root @ free)
    return sums @ steps[:-2], float(steps[-2] - steps[-1]), loss


def not_negative(columns: Array, goal: Array) -> tuple[Array, float]:
    """Non-negative factors (n,) of columns (m, n) whose sum is nearest to a goal (m,), and its loss.

    The active set method of Lawson and Hanson (1974) in normal equations (Bro and de Jong 1997). That of
    scipy.optimize takes longer to import than a ridge to register.
    """
    gram, pull = columns.T @ columns, columns.T @ goal
    gram[np.diag_indices(len(pull))] *= 1.0 + 1e-12
    x, free = np.zeros(len(pull)), np.linalg.lstsq(gram, pull, rcond=None)[0] > 0
    limit = 1e-10 * float(np.abs(pull).max(initial=0.0))
    for _ in range(3 * len(pull)):
        x = _of_free(gram, pull, x, free)
        gain = np.where(free, -np.inf, pull - gram @ x)
        if free.all() or gain.max() <= limit:
            break
        free[np.argmax(gain)] = True
    miss = goal - columns @ x
    return x, float(miss @ miss)


def _of_free(gram: Array, pull: Array, x: Array, free: NDArray[np.bool_]) -> Array:
    """The best factors of those that are free, from allowed ones x; those that come to 0 are free no more."""
    while free.any():
        at = np.flatnonzero(free)
        wanted = np.zeros(len(pull))
        wanted[at] = np.linalg.solve(gram[at[:, None], at], pull[at])
        if wanted[at].min() > 0:
            return wanted
        # As far as the first that would become negative.
        low = at[wanted[at] <= 0]
        part = x[low] / np.maximum(x[low] - wanted[low], 1e-300)
        x = x + part.min() * (wanted - x)
        free[low[part <= part.min()]] = False
        x[~free] = 0.0
    return np.zeros(len(pull))
