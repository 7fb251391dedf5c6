"""Stretches where a ridge is not to be trusted, and why."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.curvilinear import local_coordinates
from ridgefeature.ridge import Ridge

Array = NDArray[np.float64]

_SEEN, _OFF, _STRAYS, _KNOWN = 0.5, 2.5, 0.4, 0.2
"""A stretch is in doubt with less of it seen, points further off in noise levels, a larger share of strays,
or a standard deviation of height or of width at half height that is larger, in these."""
_UNEVEN = ((0.0, 0.5, 0.2), (0.5, 1.0, 0.5))
"""From and to how many widths from the spine left and right are compared: the flanks, and what is beside the
feet; and by how much their shares of strays may differ."""
_TOGETHER, _FEW, _SURE = 5, 16, 3.0
"""Stretches whose strays are counted together; points on a side below which nothing is said of it; standard
deviations that a difference of shares must have to spare."""
_ASIDE, _BEYOND = 0.5, 0.3
"""Widths beyond the feet, and beyond an end, from which on a pick is not on the ridge."""


def doubts(
    ridge: Ridge, edges: Array, off: Array, strays: Array, covered: Array, uneven: NDArray[np.bool_]
) -> tuple[tuple[float, float, str], ...]:
    """Stretches in doubt, neighbours with the same reason joined; first the whole one if it misses the pick.

    By stretch between the edges: how far points lie off in noise levels, the share of strays, what part of
    the surface was seen, and whether strays lie to one side.
    """
    reasons = []
    for seen, far, stray, aside, std in zip(covered, off, strays, uneven, _loose(ridge, edges), strict=True):
        if seen < _SEEN:
            reasons.append(f"less than {100 * _SEEN:.0f} % of the surface seen")
        elif stray > _STRAYS or far > _OFF:
            reasons.append("points lie off the surface")
        elif aside:
            reasons.append("strays lie to one side")
        elif std > _KNOWN:
            reasons.append(f"height or width not known to {100 * _KNOWN:.0f} %")
        else:
            reasons.append("")
    runs: list[tuple[float, float, str]] = []
    for low, high, why in zip(edges[:-1], edges[1:], reasons, strict=True):
        if runs and runs[-1][2] == why:
            runs[-1] = (runs[-1][0], float(high), why)
        else:
            runs.append((float(low), float(high), why))
    missed = pick_missed(ridge)
    whole = [(0.0, ridge.length, f"the pick lies {missed[1]:.2g} widths from it")] if missed else []
    return (*whole, *(run for run in runs if run[2]))


def to_one_side(ridge: Ridge, edges: Array, s: Array, across: Array, side: Array) -> NDArray[np.bool_]:
    """By stretch, whether strays lie to one side of the ridge: as where another one is too near.

    s, across: places of the points. side: 1 for strays above the surface, -1 for those below, 0 for others.
    Strays above and below are told apart. Such as are strewn over all of the scan are as many left and right.
    """
    v = across / np.interp(s, ridge.arc_length, ridge.width)
    count = len(edges) - 1
    at = np.clip(np.searchsorted(edges, s, side="right") - 1, 0, count - 1)
    found = np.zeros(count, bool)
    for low, high, most in _UNEVEN:
        zones = [(low <= sign * v) & (sign * v <= high) for sign in (1, -1)]
        points = [_about(at[zone], count) for zone in zones]
        excess, variance = np.zeros(count), np.zeros(count)
        for kind in (1, -1):
            shares = []
            for zone, n in zip(zones, points, strict=True):
                n = np.maximum(n, 1)
                share = _about(at[zone & (side == kind)], count) / n
                variance += (share * (1 - share) + 1 / n) / n
                shares.append(share)
            excess += np.abs(shares[0] - shares[1])
        found |= (np.minimum(*points) >= _FEW) & (excess - _SURE * np.sqrt(variance) > most)
    return found


def pick_missed(ridge: Ridge) -> tuple[float, float] | None:
    """How far the pick lies from the spine, in the unit and in widths; None where it is on the ridge."""
    s, _, _ = place = place_of_pick(ridge)
    if is_beside(ridge, place, 0.5 + _ASIDE, _BEYOND):
        return None
    far = float(np.linalg.norm(ridge.spine - ridge.pick, axis=1).min())
    return far, far / float(np.interp(s, ridge.arc_length, ridge.width))


def place_of_pick(ridge: Ridge) -> tuple[float, float, float]:
    """Arc length of the pick, distance to the left of the spine and height, in the station's frame."""
    s, y, z = (float(x[0]) for x in local_coordinates(ridge, ridge.pick[None]))
    return s, y, z


def is_beside(ridge: Ridge, place: tuple[float, float, float], aside: float, beyond: float) -> bool:
    """Whether a place is at most so many widths aside of the spine, and past an end."""
    s, y, _ = place
    width = float(np.interp(s, ridge.arc_length, ridge.width))
    past = 0.0 if ridge.closed else max(-s, s - ridge.length)
    return abs(y) <= aside * width and past <= beyond * width


def _about(at: NDArray[np.intp], count: int) -> Array:
    """How many there are in each stretch and those about it."""
    total = np.concatenate([[0], np.cumsum(np.bincount(at, minlength=count))])
    i, half = np.arange(count), _TOGETHER // 2
    return np.asarray(total[np.minimum(i + half + 1, count)] - total[np.maximum(i - half, 0)], np.float64)


def _loose(ridge: Ridge, edges: Array) -> Array:
    """The larger standard deviation of height and of width at half height, in these, by stretch."""
    with np.errstate(divide="ignore", invalid="ignore"):
        loose = np.maximum(
            ridge.height_std / np.abs(ridge.height), ridge.half_height_width_std / ridge.half_height_width
        )
    middles = 0.5 * (edges[1:] + edges[:-1])
    return np.interp(middles, ridge.arc_length, np.where(np.isfinite(loose), loose, np.inf))
