"""How the whole fit of a steep ridge begins: near its flanks, and as what the points say is likeliest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.joint_rounds import State, Task, chance, improved
from ridgefeature.noise import first_noise
from ridgefeature.section import box
from ridgefeature.shaping import with_half_height_width

Array = NDArray[np.float64]

_NEAR_ROUNDS, _ROUNDS = 5, 3
"""By the nearest places of a section, and as it is seen, of each of the states that a fit may begin with."""


def likeliest(task: Task, state: State) -> State | None:
    """The likeliest of what a steep ridge may be, after some rounds; None where nothing came of any.

    It has the section that it has or a box, and points that lie evenly over the base or over the surface.
    """
    task = task.thinned()
    points = task.some
    best, kept = -np.inf, None
    for section in dict.fromkeys((state.section, box())):
        terms = with_half_height_width(state.terms, state.section, section)
        noise = first_noise(points, terms, section, task.height, task.width, 0.0)
        near: State | None = State(terms, section, noise, state.weights)
        for n in range(_NEAR_ROUNDS):
            near = improved(task, points, near, max(_ROUNDS + 1 - n, 1), near=True)
        if near is None:
            continue
        for even in (0.0, 1.0):
            found: State | None = near.lying(even)
            for n in range(_ROUNDS):
                found = improved(task, points, found, _ROUNDS - n)
            if found is not None and (now := chance(points, found)) > best:
                best, kept = now, found
    return kept
