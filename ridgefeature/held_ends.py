"""Ends of a ridge that its own points hold: on its top, by its section, as high and wide as it was before.

A spline along a ridge goes on beyond its last points as it likes, and follows what the ridge runs into.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ridgefeature.astray import usual_ends
from ridgefeature.joint import Joint, least_noise
from ridgefeature.kernels.strip import H, W
from ridgefeature.medians import median
from ridgefeature.path_frame import NODES_A_WIDTH

Array = NDArray[np.float64]

_MISFIT = 2.5
"""Mean squared distance of points, in that usual, above which a stretch may be something else."""
_OTHER, _LEAST_PART = 3.5, 0.15
"""It is, where that times the growth of height or width, in those of the stretch before, is more; or where
the height, in those, is less."""
_STRETCH, _LATEST = 1, 4
"""Widths of the stretch before, and of the last part of a ridge that is looked at."""
_AGAIN = 1
"""Widths at an end that may seem to fit again, but as another ridge."""
_MARGIN = 2
"""Stretches at the very end where a height that is less may be none: they may lie beyond it."""
_WALL, _ON_WALL, _LEVEL = (0.4, 0.4), 1.1, 0.8
"""Rise over a width from which on it is a wall, in heights and in widths, both, if it was nowhere so high
before; height from which on a place is on it, in that just before; least height over the width before, in
that at its foot."""
_EXPECTED, _FEWEST = 3.0, 0.15
"""Points on the top of a stretch that are waited for, and the part of them that must be there."""


def held(joint: Joint, open_ends: tuple[bool, bool], kept: float | None = None) -> tuple[float, float]:
    """Arc lengths of the joint's path between which the points hold what was fitted.

    open_ends: which of both may move; kept: arc length of a place that is on the ridge, if one is known.
    """
    at, n = joint.path.at, len(joint.path.at) - 1
    misfit, terms = joint.misfit, joint.terms
    before, after = (0, n) if kept is None else 2 * (int(np.argmin(np.abs(at - kept))),)
    end = _on_top(misfit[:, 2], same_ridge(joint, 0, n, before)) if open_ends[1] else n
    turned = joint.backwards
    start = _on_top(misfit[::-1, 2], same_ridge(turned, 0, n, n - after)) if open_ends[0] else n
    low, high = usual_ends(at, terms[:, W], open_ends)
    end, start = min(end, max(high, before)), min(start, n - min(low, after))
    sizes = np.abs(terms[:, [H, W]])
    end = _below_a_wall(sizes, before, end) if open_ends[1] else end
    start = _below_a_wall(sizes[::-1], n - after, start) if open_ends[0] else start
    return float(at[n - start]), float(at[end])


def same_ridge(joint: Joint, start: int, end: int, kept: int = 0) -> int:
    """The node up to which a ridge from one node to another is the same one, looked at from its end.

    Where it runs into something else (a blob, a body, another ridge) its points no longer fit, and height or
    width leave what the stretch before showed, up to the end. What fits is the ridge, however it grows or
    fades. kept: a node that is on it, whatever fits there.
    """
    half = NODES_A_WIDTH // 2
    noise, sizes = _noise(joint, start, end), np.abs(joint.terms[:, [H, W]])
    cut = end
    k, first = end - half, max(start, end - _LATEST * NODES_A_WIDTH)
    while k > max(first, kept):
        beyond = k
        while k > first and noise[k] > _MISFIT:
            k -= 1
        if k < beyond and _leaves(noise, sizes[: end + 1], start, k + 1, beyond):
            cut = max(k + 1 + half // 2, kept)
        k -= 1
    return cut


def _leaves(noise: Array, sizes: Array, start: int, first: int, last: int) -> bool:
    """Whether height or width (n, 2) leave what they were before windows that do not fit, from first to last.

    noise: of the windows; start: node where the ridge begins.
    """
    half = NODES_A_WIDTH // 2
    begin = first + half // 2
    before = sizes[max(start, begin - _STRETCH * NODES_A_WIDTH) : begin]
    if len(before) < NODES_A_WIDTH:
        return False
    usual = np.median(before, axis=0)
    after = sizes[last + half :] / usual
    if half < len(after) <= half + _AGAIN * NODES_A_WIDTH:
        far = float(noise[first : last + 1].max())
        if far * (float(np.median(after, axis=0).max()) - 1.0) > _OTHER:
            return True
    # Of half a width: at an abrupt end a spline overshoots over less.
    inside = [np.median(sizes[k : k + half + 1] / usual, axis=0) for k in range(first, last + 1)]
    grown = max(float(noise[k] * (size.max() - 1.0)) for k, size in enumerate(inside, first))
    lower = [float(size[0]) for k, size in enumerate(inside, first) if k + half + _MARGIN < len(sizes)]
    return grown > _OTHER or min(lower, default=1.0) < _LEAST_PART


def _below_a_wall(sizes: Array, first: int, end: int) -> int:
    """The node up to which a crest that is followed outwards from a node to an end meets no wall.

    sizes (n, 2): height and width. Its points may fit, but a blob or a body is no higher part of the ridge.
    """
    height, width = sizes.T
    highest = np.maximum.accumulate(height)
    walls = (1.0 + _WALL[0]) * highest < highest[end]  # where there may be one further on
    for k in range(max(first, NODES_A_WIDTH), min(int(walls.sum()), end - 1)):
        usual = median(height[k - NODES_A_WIDTH : k + 1])
        if height[k - NODES_A_WIDTH : k + 1].min() < _LEVEL * height[k]:
            continue  # it rises evenly, as from an end that fades
        ahead = height[k : min(k + NODES_A_WIDTH, end) + 1]
        top = int(ahead.argmax())
        steep = ahead[top] - usual > max(_WALL[0] * usual, _WALL[1] * float(width[k]))
        if steep and ahead[top] > (1.0 + _WALL[0]) * highest[k]:
            return k + int(np.flatnonzero(ahead[: top + 1] <= _ON_WALL * usual).max(initial=0))
    return end


def _noise(joint: Joint, start: int, end: int) -> Array:
    """Mean squared distance of windows of half a width from each node on, in that usual between two nodes."""
    half = NODES_A_WIDTH // 2
    sums = windows(joint.misfit, half)
    noise = sums[:, 1] / np.maximum(sums[:, 0], 1.0)
    least = (least_noise(joint.terms) / max(least_noise(joint.terms), joint.noise.scale)) ** 2
    usual = median(noise[start : max(end - half, start) + 1])
    return np.asarray(noise / max(usual, least, 1e-300))


def windows(values: Array, count: int) -> Array:
    """Sums over all runs of `count` rows."""
    total = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    return np.asarray(total[count:] - total[:-count])


def _on_top(top: Array, end: int) -> int:
    """The node up to which points (n,) lie on the top of stretches, as densely as chance lets expect.

    Without them a spline goes on as flanks alone pull it.
    """
    usual = max(median(top), 1e-3)
    few = math.ceil(_EXPECTED / usual)
    least = len(top) // 2
    while end > least and top[max(end - few, 0) : end].sum() <= _FEWEST * few * usual:
        end -= 1
    return end
