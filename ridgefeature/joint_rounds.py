"""The rounds of a joint refit: all terms fitted again to the points, from what is known so far."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ridgefeature.foot_points import distances
from ridgefeature.foot_points import information as foot_information
from ridgefeature.kernels.information import information
from ridgefeature.kernels.strip import A, C, E, H, W, mixture, offsets
from ridgefeature.medians import median
from ridgefeature.noise import EXACT, Noise, blur_of, inflation_along, inflation_of
from ridgefeature.path_frame import PathFrame
from ridgefeature.scan_lines import scan_lines
from ridgefeature.section import Section
from ridgefeature.smearing import Smeared, likelihood_scores, log_likelihood, smear
from ridgefeature.smoothing import Smooth, smoothest
from ridgefeature.template import STEEP

Array = NDArray[np.float64]

_NEXT_MIXTURE = 3
_ROUNDS, _LAST_ROUNDS = 2, 4
"""In which weights of penalties become likelier: few of them as long as the terms are not known well."""
_TELLING = 5000
"""As many points tell how likely a state is."""
_MOVED = 0.02
"""Largest change of terms by a round, in heights and widths, up to which it may be the last but one."""
_IN_STRIPS = 0.6
"""Share of what a fit follows of its points' errors that sums over narrow strips show. Measured on fits to
independent errors: 0.45 to 0.9."""


@dataclass(frozen=True, eq=False)
class Fit:
    """What a round of the fit found, and the normal equations that it solved."""

    smooth: Smooth
    matrix: Array
    goal: Array
    exact: bool = False
    """Whether by the likelihood itself, not by mean heights."""


@dataclass(frozen=True, eq=False)
class State:
    """What is known of a ridge between two rounds of its fit."""

    terms: Array
    section: Section
    noise: Noise
    weights: Array
    inflation: float = 1.0
    freedom: float = 0.0
    """How many coefficients the fit before told."""
    fit: Fit | None = None
    """None before the first round."""

    @cached_property
    def seen(self) -> Smeared:
        """The section as points so noisy show it."""
        return smear(self.section, self.terms, self.noise.blur, self.noise.even)

    def lying(self, even: float) -> State:
        """With points that lie evenly over the base, 0, or over the surface, 1."""
        return replace(self, noise=replace(self.noise, even=even))

    def given(self, section: Section, terms: Array) -> State:
        return replace(self, section=section, terms=terms)


@dataclass(frozen=True, eq=False)
class Task:
    """What stays the same through all rounds: some of the points, the path, what its smoothness asks for."""

    some: Array
    path: PathFrame
    flat: bool
    wanted: Array
    height: float
    width: float
    steep: bool

    def thinned(self) -> Task:
        """With as many points as tell which of several states is the likeliest."""
        return replace(self, some=np.ascontiguousarray(self.some[:: 1 + len(self.some) // _TELLING]))


def task_of(some: Array, path: PathFrame, flat: bool) -> Task:
    """The task of fitting a ridge along a path to points that lie along it."""
    height, width = path.sizes
    return Task(some, path, flat, path.wanted, height, width, is_steep(path))


def is_steep(path: PathFrame) -> bool:
    """Whether flanks rise so much that a fit must begin near them."""
    height, width = path.sizes
    return height >= STEEP * width


def improved(
    task: Task,
    points: Array,
    state: State | None,
    left: int,
    near: bool = False,
    shared: bool = False,
    exact: bool = False,
) -> State | None:
    """All terms fitted again to points; None where nothing finite came of it.

    left: rounds still to come: until then what the terms miss is no stray yet. near: by the distances of the
    points from the nearest places of the section (ridgefeature.foot_points), all of them of `task`. shared:
    errors that points beside each other along the ridge have in common are looked for. exact: by the
    likelihood itself, from terms near its largest, not by mean heights.
    """
    if state is None:
        return None
    path = task.path
    scales = EXACT * task.height, 2.0**left
    found = (
        _by_foot_points(points, state, *scales) if near else _linearised(points, task.some, state, *scales)
    )
    matrix, goal, noise, gain = found
    if exact:
        matrix, goal, gain = *_by_likelihood(points, replace(state, noise=noise)), 1.0
    if not np.isfinite(matrix).all() or not np.isfinite(gain):
        return None
    # What the fit before did not look at is no misfit of it.
    seen_before = state.fit is not None and not shared
    inflation = inflation_of(gain * matrix, gain * goal) if seen_before else state.inflation
    goal += np.einsum("nij,nj->ni", matrix, 0.5 * (state.terms[1:] + state.terms[:-1]))
    if shared:
        local = _common_errors(points, path, state, noise, len(task.some))
        known, inflation = gain / np.maximum(inflation, local), max(inflation, median(local))
        matrix, goal = known[:, None, None] * matrix, known[:, None] * goal
    else:
        matrix, goal = gain / inflation * matrix, gain / inflation * goal
    if task.flat:
        _fix(matrix, goal, C)
    early = left > 0 or near
    told = state.weights, _ROUNDS if early else _LAST_ROUNDS, not early
    smooth = smoothest(matrix, goal, path.at_middles, path.coefficients, task.wanted, *told)
    first, basis = path.at_nodes
    terms = (basis[:, :, None] * smooth.coefficients[first[:, None] + np.arange(4)]).sum(axis=1)
    if not np.isfinite(terms).all():
        return None
    terms[:, W] = np.clip(terms[:, W], 0.4 * path.width, 2.5 * path.width)
    fit = Fit(smooth, matrix, goal, exact)
    return State(terms, state.section, noise, smooth.weights, inflation, smooth.freedom, fit)


def hardly_moved(task: Task, before: State | None, after: State) -> bool:
    """Whether a round changed the terms by so little that one more would change nothing."""
    if before is None or task.steep:
        return False
    moved = np.abs(after.terms - before.terms).max(axis=0)
    return bool(
        max(moved[A], moved[H]) < _MOVED * task.height and max(moved[E], moved[W]) < _MOVED * task.width
    )


def chance(points: Array, state: State) -> float:
    """Log likelihood of the heights of points."""
    noise = state.noise
    points = np.ascontiguousarray(points[:: 1 + len(points) // _TELLING])
    told = noise.blur, noise.even, noise.strays, noise.span
    return log_likelihood(points, state.terms, state.section, *told)


def _linearised(
    points: Array, some: Array, state: State, least: float, more: float
) -> tuple[Array, Array, Noise, float]:
    """Normal equations of all stretches for changes of the terms, noise, what makes them a likelihood.

    least: of the noise; more: by how much the least scale is more, from which on a distance tells a stray.
    """
    terms, noise = state.terms, state.noise
    seen = state.seen.told
    off, far = offsets(some, terms, seen, noise.scale)
    told = noise.scale, noise.strays, noise.span, more * least
    scale, strays, density = mixture(off, far, *told, _NEXT_MIXTURE)
    blur = blur_of(some, terms, off, scale, noise.span, least)
    matrix, right, sums = information(points, terms, seen, scale, density)
    gain = float(sums[3] ** 2 / (sums[2] * sums[1]))
    noise = replace(noise, scale=scale, strays=strays, density=density, blur=blur)
    return matrix, right, noise, gain


def _by_likelihood(points: Array, state: State) -> tuple[Array, Array]:
    """Normal equations of all stretches for changes of the terms, by the likelihood itself."""
    noise = state.noise
    told = noise.blur, noise.even, noise.strays, noise.span
    return likelihood_scores(points, state.terms, state.section, *told)


def _common_errors(points: Array, path: PathFrame, state: State, noise: Noise, fitted: int) -> Array:
    """Variance of sums over the points of each stretch, by that of independent noise: as narrow strips along
    the ridge tell it, or the scanner's lines, where these have more in common.

    fitted: to how many of the points the state was. It follows their errors, which makes sums smaller, and
    is off by them where the others are, which makes sums larger: both by as many coefficients as are free.
    """
    terms, scale = state.terms, noise.scale
    off, far = offsets(points, terms, state.seen.told, scale)
    shares = 1.0 / (1.0 + noise.density * np.exp(np.minimum(0.5 * (far / scale) ** 2, 50.0)))
    followed = _IN_STRIPS * (2.0 - len(points) / fitted) * state.freedom
    found = inflation_along(points, terms, off, shares, scale, followed)
    lines = scan_lines(points, path, shares * np.copysign(far, off))
    return found if lines is None else np.maximum(found, lines.inflation)


def _by_foot_points(
    points: Array, state: State, least: float, more: float
) -> tuple[Array, Array, Noise, float]:
    """The same by distances from the nearest places of the section."""
    terms, noise = state.terms, state.noise
    off, rows = distances(points, terms, state.section)
    told = noise.scale, noise.strays, noise.span, more * least
    scale, strays, density = mixture(off, np.abs(off), *told, _NEXT_MIXTURE)
    blur = blur_of(points, terms, off, scale, noise.span, least)
    matrix, right, sums = foot_information(points, len(terms) - 1, off, rows, scale, density)
    gain = float(sums[3] ** 2 / (sums[2] * sums[1]))
    noise = replace(noise, scale=scale, strays=strays, density=density, blur=blur)
    return matrix, right, noise, gain


def _fix(matrix: Array, goal: Array, term: int) -> None:
    """Let normal equations ask for 0 of one term, whatever the others are."""
    goal[:, term] = matrix[:, term] = matrix[:, :, term] = 0.0
    matrix[:, term, term] = 1.0
