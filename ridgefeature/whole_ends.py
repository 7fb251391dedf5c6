"""Where a ridge ends, as all points along its path tell: further out than templates went, or earlier.

A ridge that fades is followed as long as the points of one width tell it from its base; where the data end,
or nothing but strays is left, it is cut.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.held_ends import same_ridge, windows
from ridgefeature.joint import Joint
from ridgefeature.kernels.strip import A, B, C, E, H, W
from ridgefeature.medians import median
from ridgefeature.path_frame import NODES_A_WIDTH

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

BEYOND = 3.0
"""How far beyond its ends a ridge is looked for, in widths."""
VISIBLE = 25.0
"""Evidence of a stretch of one width from which on a ridge is seen."""
_OUTER = 3.0
"""Evidence of its outer half: the inner one may lie on an end that is known a little too early."""
_DENSE = 0.5
"""Points a stretch, in parts of what is usual, below which the data end."""
_NEAR = 0.3
"""Length in widths of the stretch whose points are counted."""
_FALLS, _RISES = 0.08, 1.3
"""Heights further out, in parts of that at the end, below which it ended there, whatever the base's misfit
shows, and above which it is something else."""
_STEP = 0.7
"""Widths by which windows are followed further out at once: further on the path may bend."""
_SEEN = 0.6
"""Part of the last window in which a ridge is seen that still belongs to it."""
_BEFORE = (1.5, 0.4)
"""Stretch before an end, in widths, whose heights tell how high the ridge would be further on."""
_LIKELY = 6.0
"""Twice the log likelihood ratio up to which a place may be the end: of a change point, at 95 %."""
_NEARLY = 0.3
"""Widths by which a known end may lie too far out."""
_ANYTHING = 3.84
_FADED = 0.5
"""Height at an end, in usual heights, below which the ridge fades there."""
_FADING, _SLACK = 0.25, 0.2
"""Widths by which the end of a fading ridge may have come earlier; by which any end is uncertain."""
_BASE_AND_HEIGHT = [A, B, H]


def evidence(joint: Joint, stretches: int) -> tuple[Array, Array]:
    """Twice the log likelihood ratio of ridge against none, and the height, of so many stretches in a row.

    (n - stretches + 1,) each, of all such windows. Offset and tilt of the base and the height are free there,
    all else is as the whole ridge has it.
    """
    terms = 0.5 * (joint.terms[1:] + joint.terms[:-1])
    known = [C, E, W]
    goal = joint.goal - np.einsum("nij,nj->ni", joint.matrix[:, :, known], terms[:, known])
    m = joint.matrix[:, _BASE_AND_HEIGHT][:, :, _BASE_AND_HEIGHT]
    m, goal = windows(m, stretches), windows(goal[:, _BASE_AND_HEIGHT], stretches)
    sizes = np.sqrt(np.maximum(np.einsum("nii->ni", m[:, :2, :2]), 1e-300))
    scaled = m[:, :2, :2] / (sizes[:, :, None] * sizes[:, None]) + 1e-9 * np.eye(2)
    cross = m[:, :2, 2] / sizes
    solved = np.linalg.solve(scaled, np.stack([cross, goal[:, :2] / sizes], axis=2))
    left = m[:, 2, 2] - (cross * solved[:, :, 0]).sum(axis=1)
    pull = goal[:, 2] - (cross * solved[:, :, 1]).sum(axis=1)
    told = left > 1e-6 * m[:, 2, 2]
    height = np.where(told, pull / np.where(told, left, 1.0), 0.0)
    return np.where(told, height * pull, 0.0), height


def ends_of(
    joint: Joint,
    before: Joint,
    start: float,
    end: float,
    open_ends: tuple[bool, bool],
    ahead: float,
    kept: float | None = None,
) -> tuple[float, float]:
    """Arc lengths of the joint's path between which the ridge is, known so far from start to end.

    The joint was fitted further out, the one before not: where a ridge ends abruptly a spline that goes on
    overshoots, and what is inside fits by the other alone. open_ends: which of both may move. ahead: widths
    without data over which a ridge is followed. kept: a place that is on it, if one is known.
    """
    one = min(NODES_A_WIDTH, len(joint.path.at) - 2)
    shown = (*evidence(joint, one), *evidence(joint, one // 2))
    if open_ends[1]:
        end = _end_of(joint, before, shown, start, end, ahead, start if kept is None else kept)
    if open_ends[0]:
        backwards = tuple(values[::-1] for values in shown)
        told = joint.backwards, before.backwards, backwards
        start = -_end_of(*told, -end, -start, ahead, -(end if kept is None else kept))
    return start, end


def _end_of(
    joint: Joint,
    before: Joint,
    shown: tuple[Array, ...],
    start: float,
    end: float,
    ahead: float,
    kept: float,
) -> float:
    """Where a ridge ends whose last end is known to be near `end`; there if nothing is left of it by then.

    shown: evidence and height of windows of one width and of a half; kept: a place that is on the ridge.
    """
    path, known = joint.path, end
    one, near = min(NODES_A_WIDTH, len(path.at) - 2), max(round(_NEAR * NODES_A_WIDTH), 1)
    inside = (path.at >= start) & (path.at <= end)
    if not inside.any():
        return end
    low, high = (int(k) for k in np.flatnonzero(inside)[[0, -1]])
    count = windows(joint.counts, near)
    dense = count > _DENSE * median(count[inside[:-near]])
    found, height, half, above = shown
    half = np.where(above * median(path.height[inside]) > 0, half, 0.0)
    seen = (found > VISIBLE) & (half[one - one // 2 :][: len(found)] > _OUTER)
    last_width, last_part = joint.terms[max(high - one, 0) : high + 1, H], before.terms[-near:, H]
    usual = [median(heights) for heights in (last_width, last_part)]
    k = _end(seen, height, dense, usual, high, one, near, ahead * one + near)
    end = _likeliest(joint, end if k == high else float(path.at[k]), dense, near, k == high)
    high = int(np.searchsorted(path.at, end, "right")) - 1
    k = same_ridge(joint, low, high, int(np.argmin(np.abs(path.at - kept))))
    cut = end if k == high else float(path.at[k])
    if cut >= min(known, end):
        return cut
    inner, last = before.path.at, len(before.path.at) - 1
    whole = same_ridge(before, 0, last, int(np.argmin(np.abs(inner - kept)))) == last
    return min(known, end) if whole else cut


def _end(
    seen: Flags, height: Array, dense: Flags, usual: list[float], i: int, one: int, near: int, gap: float
) -> int:
    """The node at which a ridge ends that is known up to the i-th: further on while it is seen, or earlier.

    seen, height: of windows of `one` stretches from each node on; dense: whether there are data, of windows
    of `near` stretches; usual: heights before the end, over its last width and at the end itself, which is
    low where a ridge fades. gap: the most stretches without data beyond which it is looked for.
    """
    last, empty = i, 0
    sizes, heights = np.abs(usual), height * np.sign(usual[0])
    seen = seen & (heights > _FALLS * sizes.min()) & (heights < _RISES * sizes.max())
    for k in range(i + 1, len(seen)):
        empty = 0 if dense[k] else empty + 1
        whole = bool(dense[k : k + one].all())
        if whole and seen[k]:
            last = k
        if empty > gap or (whole and not seen[k]) or last - i >= _STEP * one:
            break
    if last > i:
        return last + round(_SEEN * one)
    while i > near and not dense[i - near]:
        i -= 1
    return i


def _likeliest(joint: Joint, place: float, dense: Flags, near: int, known: bool) -> float:
    """The arc length at which an end at about `place` is most likely, where there are data up to it.

    known: it was told before, and stays if it may be there, or nearly: a little of the ground beyond it shows
    how high a steep ridge stands.
    """
    at, gain = _told(joint, place)
    if not len(at):
        return place
    last = i = int(np.argmin(np.abs(joint.path.at - place)))
    while last + 1 < len(joint.path.at) and dense[last + 1 - near]:
        last += 1
    reached = at <= joint.path.at[last]
    at, gain = at[reached], gain[reached]
    best = float(at[np.argmax(gain)])
    if known and gain[np.argmin(np.abs(at - joint.path.at[i]))] > gain.max() - _LIKELY:
        return place
    if known and 0.0 < place - best < _NEARLY * float(joint.path.width[i]):
        return place
    return best


def _told(joint: Joint, place: float) -> tuple[Array, Array]:
    """Places (k,) about an end, and twice the log likelihood that it is at each of them.

    That is where the height as it is before it stops being more likely than none. Empty where that is not
    known.
    """
    at = joint.path.at
    local = float(joint.path.width[np.argmin(np.abs(at - place))])
    from_end = (0.5 * (at[1:] + at[:-1]) - place) / local
    known = (from_end > -_BEFORE[0]) & (from_end < -_BEFORE[1])
    if known.sum() < 3:
        return np.empty(0), np.empty(0)
    terms = 0.5 * (joint.terms[1:] + joint.terms[:-1])
    slope, level = np.polyfit(from_end[known], terms[known, H], 1)
    sign = np.sign(median(terms[known, H]))
    height = sign * np.maximum(sign * (level + slope * from_end), 0.0)
    near = np.flatnonzero((from_end > -_BEFORE[0]) & (from_end < BEYOND))
    gain = _gain(joint.matrix[near], joint.goal[near], terms[near], height[near])
    return at[near[0] : near[-1] + 2], np.concatenate([[0.0], np.cumsum(gain)])


def end_interval(joint: Joint, place: float, outwards: int) -> tuple[float, float]:
    """Arc lengths between which an end at `place` is, to about 95 %.

    outwards: 1 for the end at the path's end, -1 for that at its start. A ridge that has nearly faded may go
    on as long as the points of one width show anything.
    """
    if outwards < 0:
        low, high = end_interval(joint.backwards, -place, 1)
        return -high, -low
    at = joint.path.at
    i = int(np.argmin(np.abs(at - place)))
    local = float(joint.path.width[i])
    slack = _SLACK * local
    low, high = place - slack, place + slack
    places, gain = _told(joint, place)
    if len(places):
        likely = places[gain > gain.max() - _LIKELY]
        low, high = min(likely[0], place) - slack, max(likely[-1], place) + slack
        if abs(joint.terms[i, H]) < _FADED * median(np.abs(joint.terms[:, H])):
            low, high = low - _FADING * local, max(high, _last_shown(joint, place) + slack)
    return low, high


def _gain(matrix: Array, goal: Array, terms: Array, height: Array) -> Array:
    """Twice the log likelihood ratio (n,) of heights (n,) against none, all else as in terms (n, 6)."""
    rest = [A, B, C, E, W]
    pull = goal[:, H] - (matrix[:, H, rest] * terms[:, rest]).sum(axis=1)
    return np.asarray(height * (2.0 * pull - height * matrix[:, H, H]))


def _last_shown(joint: Joint, end: float) -> float:
    """The middle of the last of the windows from an end on whose points show any ridge."""
    at = joint.path.at
    one = min(NODES_A_WIDTH, len(at) - 2)
    shown = evidence(joint, one)[0]
    k = max(int(np.searchsorted(at, end)) - one // 2, 0)
    while k < len(shown) - 1 and shown[k] > _ANYTHING:
        k += 1
    return float(at[k + one // 2])
