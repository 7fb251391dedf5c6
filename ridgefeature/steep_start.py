"""How the whole fit of a steep ridge begins: near its flanks, and as what the points say is likeliest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.joint_rounds import State, Task, chance, improved
from ridgefeature.kernels.strip import E, H, W
from ridgefeature.medians import median
from ridgefeature.noise import first_noise
from ridgefeature.section import Section, box
from ridgefeature.shaping import with_half_height_width

Array = NDArray[np.float64]

_ABOUT = 0.2
"""How far from the middle points are on the top, in widths at half height."""
_NEAR_ROUNDS, _ROUNDS = 5, 3
"""By the nearest places of a section, and as it is seen, of each of the states that a fit may begin with."""


def topped(points: Array, terms: Array, section: Section) -> Array:
    """The terms (n, 6) with the height at which most points about the middle lie.

    Of a ridge that is taken for too high the points of the top are nearest to flanks: they would stay there.
    """
    place = points[:, 0].astype(np.int64)
    eta = (points[:, 1] - terms[place, E]) / terms[place, W]
    on = (np.abs(eta) < _ABOUT * section.half_height_width) & (terms[place, H] != 0)
    if not on.any():
        return terms
    out = terms.copy()
    out[:, H] *= float(median(points[on, 2] / terms[place[on], H]) / median(section(eta[on])))
    return out if out[:, H] @ terms[:, H] > 0 else terms


def likeliest(task: Task, state: State) -> State | None:
    """The likeliest of what a steep ridge may be, after some rounds; None where nothing came of any.

    It has the section that it has or a box, and points that lie evenly over the base or over the surface.
    """
    task = task.thinned()
    points = task.some
    state = state.given(state.section, topped(points, state.terms, state.section))
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
