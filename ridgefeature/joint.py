"""The joint refit: path, base, height and width along the whole ridge together, against all of its points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.free_section import FREE, SectionStd, section_std
from ridgefeature.grid import Grid
from ridgefeature.kernels.strip import (
    TERMS,
    C,
    E,
    H,
    W,
    information,
    mixture,
    offsets,
)
from ridgefeature.noise import EXACT, Noise, blur_of, first_noise, inflation_of
from ridgefeature.path_frame import PathFrame, points_along, wanted_differences
from ridgefeature.section import SECTIONS, Section, box, plateau
from ridgefeature.settings import Settings
from ridgefeature.shaping import between_feet, shaped, with_half_height_width
from ridgefeature.smearing import Smeared, log_likelihood, smear
from ridgefeature.smoothing import Smooth, basis_at, smoothest

Array = NDArray[np.float64]

_WITHOUT_SHAPING = 1
"""Round, from 0, that is the last one where the section stays as it is."""
_NEXT_MIXTURE = 3
MOST_POINTS, SOME_POINTS = 300_000, 20_000
"""As many are looked at in the last round, and before it."""
_START = 0.02
"""Roughness to begin with, in sizes of the terms."""
_TRIAL_ROUNDS = 4
"""Of each of the sections that a fit may begin with."""
_TELLING = 5000
"""As many points tell which it is."""
_STEEP = 0.4
"""Height by width from which on it matters how a fit begins."""
_FAR_OFF = 25.0
"""Squared distance, in noise scales, beyond which a point may lie anywhere."""
_FEWEST = 60
"""Points of the smallest ridge that is refitted."""


@dataclass(frozen=True, eq=False)
class Joint:
    """A ridge fitted as a whole: terms (n, 6) at the nodes of its path, and how sure they are."""

    path: PathFrame
    smooth: Smooth
    terms: Array
    section: Section
    matrix: Array
    goal: Array
    """(n - 1, 6, 6), (n - 1, 6) normal equations of the terms in each stretch, as its points alone tell."""
    counts: Array
    """(n - 1,) points of each stretch, strays too."""
    misfit: Array
    """(n - 1, 2) points of each stretch between the feet, and the sum of their squared distances from the
    surface in noise scales, none more than 25."""
    noise: Noise
    inflation: float
    """Variance of sums over neighbouring points, by what it would be if their noise was independent."""
    section_std: SectionStd

    def without(self, term: int) -> Joint:
        """The same where one term is 0."""
        keep = np.eye(TERMS)
        keep[term, term] = 0.0
        return replace(self, terms=self.terms @ keep, smooth=self.smooth.changed(keep))

    @property
    def bent(self) -> float:
        """The largest change of the base's curvature, in its standard deviations."""
        std = self.deviations(C)
        return float((np.abs(self.terms[:, C]) / np.where(std > 0, std, np.inf)).max())

    def deviations(self, term: int) -> Array:
        """(n,) standard deviations of a term at the nodes."""
        first, basis = basis_at(self.path.coefficients, self.path.knots)
        return self.smooth.deviations(first, basis, term)


def fit_whole(
    grid: Grid,
    path: PathFrame,
    section: Section,
    settings: Settings,
    before: Joint | None = None,
    rounds: int = 3,
    flat: bool = False,
    most: int = MOST_POINTS,
) -> Joint | None:
    """The ridge along a path fitted as a whole; None where there are too few points.

    before: an earlier fit, whose noise and smoothness are taken to begin with; None: there was none, and the
    section may be far off. rounds: at most, of which the last does not change the section any more. flat: the
    base stays as curved across as the path has it. most: about as many points are looked at.
    """
    points = points_along(grid, path, (0.5 + settings.flank) * path.width, most)
    if len(points) < _FEWEST:
        return None
    some = points[:: 1 + len(points) // SOME_POINTS]
    shaping = settings.section in ("auto", "learned")
    task = _task(some, path, flat)
    begun = _begun(task, section, before)
    state = _likeliest(task, begun) if before is None and shaping else begun
    for n in range(rounds):
        last = n == rounds - 1 or (n >= _WITHOUT_SHAPING and not shaping)
        left = rounds - 1 - n if before is None and not last else 0
        state = _improved(task, points if last else some, state, left)
        if last or state is None:
            break
        if shaping:
            new = _reshaped(task, state)
            shaping, state = new.section is not state.section or new.section is box(), new
        if state.section.name == FREE and (n == rounds - 2 or not shaping):
            state = state.given(*between_feet(some, state.terms, state.section, state.noise, state.inflation))
    return None if state is None else _joint(points, some, path, state)


@dataclass(frozen=True, eq=False)
class _State:
    """What is known of a ridge between two rounds of its fit."""

    terms: Array
    section: Section
    noise: Noise
    weights: Array
    inflation: float = 1.0
    smooth: Smooth | None = None
    matrix: Array | None = None
    goal: Array | None = None

    def given(self, section: Section, terms: Array) -> _State:
        return replace(self, section=section, terms=terms)


@dataclass(frozen=True, eq=False)
class _Task:
    """What stays the same through all rounds: some of the points, the path, what its smoothness asks for."""

    some: Array
    path: PathFrame
    flat: bool
    wanted: Array
    height: float
    width: float


def _task(some: Array, path: PathFrame, flat: bool) -> _Task:
    known = np.abs(path.height[path.height != 0])
    width = float(np.median(path.width))
    height = float(np.median(known)) if len(known) else width
    return _Task(some, path, flat, wanted_differences(path), height, width)


def _begun(task: _Task, section: Section, before: Joint | None) -> _State:
    path, h, w = task.path, task.height, task.width
    terms = np.zeros((len(path.at), TERMS))
    terms[:, H], terms[:, W] = path.height, path.width
    if before is None:
        weights = (_START * np.array([h, h / w, h / w**2, w, h, w])) ** -2.0
        return _State(terms, section, first_noise(task.some, terms, section, h, w), weights)
    return _State(terms, section, before.noise, before.smooth.weights)


def _likeliest(task: _Task, state: _State) -> _State | None:
    """The likeliest of what a steep ridge may be, after some rounds: with the section that it has or with a
    box, and with points that lie evenly over the base or over the surface.

    In place of a learned section a plateau: one that was learned on steep flanks misses as templates do.
    """
    h, w = task.height, task.width
    if h < _STEEP * w:
        return state
    points = task.some[:: 1 + len(task.some) // _TELLING]
    task = replace(task, some=points)
    best, kept = -np.inf, None
    for section in (state.section if state.section.name in SECTIONS else plateau(), box()):
        terms = with_half_height_width(state.terms, state.section, section)
        for even in (0.0, 1.0):
            noise = first_noise(points, terms, section, h, w, even)
            found: _State | None = _State(terms, section, noise, state.weights)
            for n in range(_TRIAL_ROUNDS):
                found = _improved(task, points, found, _TRIAL_ROUNDS - n)
            if found is not None and (chance := _chance(points, found)) > best:
                best, kept = chance, found
    return kept


def _reshaped(task: _Task, state: _State) -> _State:
    """With a free section if it is better; on steep flanks only if the exact likelihood says so too."""
    new = state.given(*shaped(task.some, state.terms, state.section, state.noise, state.inflation))
    if new.section is state.section or task.height < _STEEP * task.width:
        return new
    return new if _chance(task.some, new) > _chance(task.some, state) else state


def _chance(points: Array, state: _State) -> float:
    """Log likelihood of the heights of points."""
    noise = state.noise
    points = points[:: 1 + len(points) // _TELLING]
    told = noise.blur, noise.even, noise.strays, noise.span
    return log_likelihood(points, state.terms, state.section, *told)


def _improved(task: _Task, points: Array, state: _State | None, left: int) -> _State | None:
    """All terms fitted again to points; None where nothing finite came of it.

    left: rounds still to come: until then what the terms miss is no stray yet.
    """
    if state is None:
        return None
    path = task.path
    matrix, goal, noise, gain = _linearised(points, task.some, state, EXACT * 2.0**left * task.height)
    if not np.isfinite(matrix).all() or not np.isfinite(gain):
        return None
    inflation = inflation_of(gain * matrix, gain * goal) if state.smooth is not None else state.inflation
    goal += np.einsum("nij,nj->ni", matrix, 0.5 * (state.terms[1:] + state.terms[:-1]))
    matrix, goal = gain / inflation * matrix, gain / inflation * goal
    if task.flat:
        _fix(matrix, goal, C)
    middle = 0.5 * (path.knots[1:] + path.knots[:-1])
    smooth = smoothest(matrix, goal, middle, path.coefficients, task.wanted, state.weights)
    first, basis = basis_at(path.coefficients, path.knots)
    terms = (basis[:, :, None] * smooth.coefficients[first[:, None] + np.arange(4)]).sum(axis=1)
    if not np.isfinite(terms).all():
        return None
    terms[:, W] = np.clip(terms[:, W], 0.4 * path.width, 2.5 * path.width)
    return _State(terms, state.section, noise, smooth.weights, inflation, smooth, matrix, goal)


def _joint(points: Array, some: Array, path: PathFrame, state: _State) -> Joint:
    stretches = len(path.at) - 1
    counts = np.bincount(points[:, 0].astype(np.int64), minlength=stretches)[:stretches].astype(float)
    terms, noise, inflation = state.terms, state.noise, state.inflation
    seen = smear(state.section, terms, noise.blur, noise.even)
    shape = section_std(some, terms, seen, noise.told, inflation)
    misfit = _misfit(some, terms, seen, noise.scale)
    smooth, matrix, goal = state.smooth, state.matrix, state.goal
    assert smooth is not None and matrix is not None and goal is not None
    return Joint(path, smooth, terms, state.section, matrix, goal, counts, misfit, noise, inflation, shape)


def _misfit(points: Array, terms: Array, seen: Smeared, scale: float) -> Array:
    """(n - 1, 2) as Joint.misfit has it."""
    place = points[:, 0].astype(np.int64)
    on = np.abs(points[:, 1] - terms[place, E]) < 0.5 * terms[place, W]
    far = np.minimum((offsets(points[on], terms, seen.told, scale)[0] / scale) ** 2, _FAR_OFF)
    both = [np.bincount(place[on], weights, len(terms) - 1) for weights in (None, far)]
    return np.column_stack(both).astype(np.float64)


def _linearised(points: Array, some: Array, state: _State, least: float) -> tuple[Array, Array, Noise, float]:
    """Normal equations of all stretches for changes of the terms, noise, what makes them a likelihood."""
    terms, noise = state.terms, state.noise
    seen = smear(state.section, terms, noise.blur, noise.even).told
    distances = offsets(some, terms, seen, noise.scale)
    scale, strays, density = mixture(*distances, noise.scale, noise.strays, noise.span, least, _NEXT_MIXTURE)
    blur = blur_of(some, terms, distances[0], scale, noise.span, least)
    matrix, right, sums = information(points, terms, seen, scale, density)
    gain = float(sums[3] ** 2 / (sums[2] * sums[1]))
    return matrix, right, replace(noise, scale=scale, strays=strays, density=density, blur=blur), gain


def _fix(matrix: Array, goal: Array, term: int) -> None:
    """Let normal equations ask for 0 of one term, whatever the others are."""
    goal[:, term] = matrix[:, term] = matrix[:, :, term] = 0.0
    matrix[:, term, term] = 1.0
