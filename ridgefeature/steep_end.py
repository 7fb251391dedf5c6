"""How the whole fit of a steep ridge ends: terms and section by the likelihood of its points itself.

Mean heights, which all other rounds hold the points against, tell little of steep flanks: beside one a point
is high or low. The likelihood tells more, but only near its largest, so these rounds are the last.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.free_section import LEARNED
from ridgefeature.joint_rounds import State, Task, chance, improved
from ridgefeature.path_frame import PathFrame
from ridgefeature.shaping import between_feet, shaped

Array = NDArray[np.float64]

_SECTIONS = 3
"""How often the section is looked for again, at most."""
_ENOUGH = 2.0
"""Log likelihood ratio below which it is not looked for again."""
_CLEAR = 2.0
"""Deviations of the noise from an end within which points may lie beyond it."""


def likelier(task: Task, points: Array, state: State, shaping: bool) -> State | None:
    """The state as the likelihood of points (m, 3) makes it; None where nothing finite came of it.

    shaping: whether the section may change.
    """
    blur = state.noise.blur
    task = replace(task, some=_clear_of_ends(task.some, task.path, blur))
    found: State | None = state
    for _ in range(_SECTIONS if shaping else 1):
        for _ in range(2):
            found = _round(task, found)
        new = _reshaped(task, found) if shaping else None
        if found is None or new is None:
            break
        gain = chance(task.some, new) - chance(task.some, found)
        found = new if gain > 0 else found
        if gain < _ENOUGH:
            break
    return improved(task, _clear_of_ends(points, task.path, blur), found, 0, shared=True, exact=True)


def _round(task: Task, state: State | None) -> State | None:
    return improved(task, task.some, state, 0, exact=True)


def _reshaped(task: Task, state: State | None) -> State | None:
    """With another section, and the terms that it asks for; None where there is none."""
    if state is None:
        return None
    told = state.noise, state.inflation, True
    new = state.given(*shaped(task.some, state.terms, state.seen, *told))
    if new.section is state.section and new.section.name != LEARNED:
        return None
    return _round(task, new.given(*between_feet(task.some, new.terms, new.section, *told)))


def _clear_of_ends(points: Array, path: PathFrame, blur: float) -> Array:
    """Those of points (m, 3) that the noise has not carried over an end of an open ridge.

    Beyond a wall across the ridge the ground is low, and that would look like narrow flanks.
    """
    if path.overlap:
        return points
    clear = _CLEAR * blur
    low, high = np.interp([path.at[0] + clear, path.at[-1] - clear], path.at, np.arange(len(path.at)))
    return points[(points[:, 0] > low) & (points[:, 0] < high)]
