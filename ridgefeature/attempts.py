"""What is tried at a pick, one after the other, until there is the ridge that is meant or none."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Protocol

import numpy as np

from ridgefeature.asked import refusal
from ridgefeature.doubts import is_beside, place_of_pick
from ridgefeature.march import INTERRUPTED
from ridgefeature.medians import median
from ridgefeature.ridge import Ridge
from ridgefeature.starts import LADDER, Hints

_NARROWER = 6
"""Steps of the ladder of widths by which narrower ridges are looked for on what is too large for one."""
_OTHER_WIDTHS = -1, 1, -2, 2, -3, 3
"""Steps of it from the width of what was refused, at which a ridge is looked for at last."""
_BESIDE_IT = -1, 1, -0.5, 0.5, -2, 2
"""Steps of it from the width of a ridge that has the pick at its foot, at which the one that is meant is."""
_FOOT, _CREST = 0.45, 0.3
"""Distances from the spine in widths: at the foot; on the crest."""
_PAST = 0.5
"""Widths past an end up to which a pick is on the ridge: ends are known to that."""
_OFF = 0.3
"""Distance from the surface, in heights, up to which a pick is on a ridge."""
_ALIKE, _SURE = 0.1, 2
"""Relative difference below which two ridges are the same; how often the same one settles it."""
_AS_LONG = 0.5
"""Least length of the ridge that is meant, in that of its neighbour: what is shorter may be nothing."""


class NoRidgeError(ValueError):
    """There is no ridge at the picked point."""


class RefusedError(NoRidgeError):
    """What was found there is none, perhaps for its size; it began with a template of this width."""

    def __init__(self, message: str, width: float, too_large: bool = False) -> None:
        super().__init__(message)
        self.width, self.too_large = width, too_large


class Attempt(Protocol):
    """A registration. reach: as far as ridges are looked for about the pick; aimed, high: as for `guess`.

    Raises NoRidgeError.
    """

    def __call__(self, hints: Hints, reach: float, aimed: bool = True, high: bool = False) -> Ridge: ...


def ridge_meant(attempt: Attempt, extent: float, hints: Hints) -> Ridge:
    """The ridge that is found, or the one whose crest was picked where the pick is at the foot of that.

    Between two ridges lies a groove, and the other way round: the broader one explains more about the pick.
    Raises NoRidgeError where there is none.
    """
    found = _first_found(attempt, extent, hints)
    if hints.width is not None or INTERRUPTED in found.stop or _has_pick(found, _FOOT):
        return found
    again = 0
    for step in _BESIDE_IT:
        own = replace(hints, width=median(found.width) * LADDER**step)
        with suppress(NoRidgeError):
            other = attempt(own, extent)
            if INTERRUPTED in other.stop:
                break
            if _has_pick(other, _CREST) and other.length > _AS_LONG * found.length:
                return other
            again += _same(found, other)
            if again == _SURE:
                break
    return found


def _first_found(attempt: Attempt, extent: float, hints: Hints) -> Ridge:
    """The ridge that lies nearest to the pick; else what explains most about it; else what rises on steep
    flanks, which look like ridges themselves; else what is narrower than what was found, if that is no ridge
    for its size: a body that bears ridges explains far more; else what begins with some other width.
    """
    with suppress(NoRidgeError):
        return attempt(hints, extent)
    try:
        return attempt(hints, extent, aimed=False)
    except NoRidgeError as found:
        refused = found
    with suppress(NoRidgeError):
        return attempt(hints, extent, high=True)
    if not isinstance(refused, RefusedError) or hints.width is not None:
        raise NoRidgeError(refusal(str(refused), hints)) from None
    if refused.too_large:
        for n in range(_NARROWER):
            with suppress(NoRidgeError):
                return attempt(hints, refused.width / LADDER ** (n + 1))
    for step in _OTHER_WIDTHS:
        hints = replace(hints, width=refused.width * LADDER**step)
        with suppress(NoRidgeError):
            return attempt(hints, extent)
    raise NoRidgeError(refusal(str(refused), hints)) from None


def _same(one: Ridge, other: Ridge) -> bool:
    """Whether one ridge was found twice: as long, and as far from the pick."""
    a, b = (float(np.linalg.norm(r.spine - r.pick, axis=1).min()) for r in (one, other))
    return abs(a - b) < _ALIKE * median(one.width) and abs(one.length / other.length - 1.0) < _ALIKE


def _has_pick(ridge: Ridge, aside: float) -> bool:
    """Whether the pick lies on the surface and between the ends, and no more widths aside of the spine."""
    s, y, z = place = place_of_pick(ridge)
    if not is_beside(ridge, place, aside, _PAST):
        return False
    width = float(np.interp(s, ridge.arc_length, ridge.width))
    off = _OFF * median(np.abs(ridge.height))
    under = float(np.interp(s, ridge.arc_length, ridge.height) * ridge.section(np.array(y / width)))
    # Straight up is no nearer than the surface, whose distance takes long. There is none past an end.
    return abs(z - under) <= off or not abs(float(ridge.distance(ridge.pick[None])[0])) > off
