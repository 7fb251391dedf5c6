"""Ridges fitted to another path: of another length, mirrored, or joined to a ring; widths that fit."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ridgefeature.merge import LEAST_BORDER, along
from ridgefeature.section import Section
from ridgefeature.stations import unit

if TYPE_CHECKING:
    from ridgefeature.ridge import Ridge

Array = NDArray[np.float64]

FITS = ("length", "scale", "trim")
_FEWEST = 13
_STDS = ("height_std", "width_std", "half_height_width_std", "spine_std")


def stretched(ridge: Ridge, length: float, fit: str = "length") -> Ridge:
    """A ridge of another arc length; see Ridge.stretched."""
    try:
        goal = float(length)
    except (TypeError, ValueError):
        goal = np.nan
    if not (np.isfinite(goal) and goal > 0):
        raise ValueError(f"length: expected a finite number above 0, got {length!r}")
    if fit not in FITS:
        raise ValueError(f"fit: expected one of {', '.join(FITS)}, got {fit!r}; choose one")
    if fit == "trim":
        return _trimmed(ridge, goal)
    rate = goal / ridge.length
    sized = ("height", "width", "border", *_STDS) if fit == "scale" else ()
    changes: dict[str, Any] = {name: rate * getattr(ridge, name) for name in sized}
    return replace(
        ridge,
        arc_length=np.linspace(0.0, goal, len(ridge.arc_length)),
        spine=ridge.spine[0] + rate * (ridge.spine - ridge.spine[0]),
        curvature=ridge.curvature / rate,
        end_interval=None if ridge.end_interval is None else rate * ridge.end_interval,
        **changes,
    )


def _trimmed(ridge: Ridge, length: float) -> Ridge:
    if length > ridge.length * (1 + 1e-9):
        raise ValueError(
            f"length: expected at most {ridge.length:g}, the ridge's own, to trim it, got {length:g}; "
            'use fit="length" or "scale"'
        )
    step = float(ridge.arc_length[1])
    s = np.linspace(0.0, length, max(_FEWEST, int(np.ceil(length / step - 1e-9)) + 1))
    names = ("spine", "tangent", "normal", "height", "width", "border", "curvature")
    at: dict[str, Any] = {name: along(ridge.arc_length, getattr(ridge, name), s) for name in names}
    at["tangent"] = unit(at["tangent"])
    square = (at["normal"] * at["tangent"]).sum(axis=1, keepdims=True)
    at["normal"] = unit(at["normal"] - at["tangent"] * square)
    # a spline through deviations may overshoot below zero; straight lines do not
    for name in _STDS:
        std = np.interp(s, ridge.arc_length, getattr(ridge, name))
        at[name] = np.nan_to_num(std, nan=np.inf, posinf=np.inf)  # unknown ones are infinite
    return replace(ridge, arc_length=s, closed=False, end_interval=None, **at)


def mirrored(ridge: Ridge) -> Ridge:
    """The ridge reflected at the plane through the middle of its path, along tangent and normal there.

    What lay to the left of the path lies to its right; arc lengths, heights and widths stay.
    """
    i = len(ridge.arc_length) // 2
    across = ridge.across[i] / np.linalg.norm(ridge.across[i])
    turn = np.eye(3) - 2 * np.outer(across, across)
    return replace(
        ridge,
        spine=ridge.spine[i] + (ridge.spine - ridge.spine[i]) @ turn,
        tangent=ridge.tangent @ turn,
        normal=ridge.normal @ turn,
        section=Section(ridge.section.coefficients[::-1], ridge.section.name),
    )


def joined(ridge: Ridge) -> Ridge:
    """The ridge with height, width and border blended at both ends to their mean there, for a closed base.

    The blend takes one width at each end, or a third of the ridge where that is less. A ring's values meet
    as they are.
    """
    names = ("height", "width", "border")
    if ridge.closed and all(getattr(ridge, name)[0] == getattr(ridge, name)[-1] for name in names):
        return ridge
    reach = min(float(max(ridge.width[0], ridge.width[-1])), ridge.length / 3)
    reach = max(reach, 1.5 * float(ridge.arc_length[1]))
    near = 1 - np.minimum(ridge.arc_length, ridge.length - ridge.arc_length) / reach
    x = np.clip(near, 0.0, 1.0)
    share = x**3 * (10 - 15 * x + 6 * x * x)
    changes: dict[str, Any] = {}
    for name in names:
        old = getattr(ridge, name)
        new = old + share * (0.5 * (old[0] + old[-1]) - old)
        new[-1] = new[0]
        changes[name] = new
    return replace(ridge, closed=True, **changes)


def room_for_width(ridge: Ridge) -> Array:
    """(k,) the largest rate of the width at each station that leaves the feet on the flanks."""
    return np.asarray(ridge.border / LEAST_BORDER / ridge.width)


def check_widths(ridge: Ridge, width: Array, rate: float | None, blend: Array) -> None:
    """Raise ValueError unless these widths (k,) are above 0 and within the flanks.

    rate: that was asked for, None of absolute widths; blend (k,): its share at each station. What is allowed
    is told in what was asked for.
    """
    name = "width" if rate is None else "w"
    if not (width > 0).all():
        got, which = (width.min(), "values above 0 everywhere") if rate is None else (rate, "a rate above 0")
        raise ValueError(f"{name}: expected {which}, got {got:g}; use a larger {name}")
    room = ridge.border / LEAST_BORDER
    i = int(np.argmax(width / room))
    if width[i] <= room[i]:
        return
    most, got = room[i], width[i]
    if rate is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            rates = 1 + np.where(blend > 0, (room_for_width(ridge) - 1) / blend, np.inf)
        most, got = float(rates.min()), rate
    # Rounded down, so that what is told is allowed.
    digits = 10.0 ** (3 - math.floor(math.log10(most)))
    raise ValueError(
        f"{name}: expected at most {math.floor(most * digits) / digits:g} at arc length "
        f"{ridge.arc_length[i]:.4g}, so that the feet stay on the flanks, got {got:g}; use a smaller {name}, "
        "or register with a larger border"
    )
