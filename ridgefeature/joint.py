"""The joint refit: path, base, height and width along the whole ridge together, against all of its points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.beyond import continued
from ridgefeature.free_section import FREE, SectionStd, section_std
from ridgefeature.grid import Grid
from ridgefeature.joint_rounds import Fit, State, Task, chance, improved, is_steep, task_of
from ridgefeature.kernels.strip import TERMS, C, E, H, W, offsets
from ridgefeature.noise import Noise, first_noise
from ridgefeature.path_frame import PathFrame, points_along
from ridgefeature.section import Section, box
from ridgefeature.settings import Settings
from ridgefeature.shaping import between_feet, shaped
from ridgefeature.smearing import Smeared, smear
from ridgefeature.smoothing import Smooth, basis_at
from ridgefeature.steep_start import likeliest

Array = NDArray[np.float64]

_WITHOUT_SHAPING = 1
"""Round, from 0, that is the last one where the section stays as it is."""
FOUND = ("auto", "learned")
"""Settings of the section that let it be found."""
MOST_POINTS, SOME_POINTS = 300_000, 20_000
"""As many are looked at in the last round, and before it."""
_START = 0.02
"""Roughness to begin with, in sizes of the terms."""
_FAR_OFF = 25.0
"""Squared distance, in noise scales, beyond which a point may lie anywhere."""
_BESIDE = 3.0
"""Flats beside a steep ridge, in those of templates: height and lean hang on how the base is bent."""
_ON_TOP = 0.8
"""Height from which on a section is the top."""
_LEAST_NOISE = 0.02
"""Distance of points, in heights, that a section may always miss by."""
_GIRTH = 41
"""Places of a section that tell its length."""
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
    """(n - 1,) points of each stretch, strays too, by the area on which they lie, in squared widths."""
    misfit: Array
    """(n - 1, 3) points of each stretch between the feet, the sum of their squared distances from the surface
    in noise scales or, if that is more, least noises, none more than 25, and how many lie near its top."""
    noise: Noise
    inflation: float
    """Variance of sums over neighbouring points, by what it would be if their noise was independent."""
    section_std: SectionStd

    def without(self, term: int) -> Joint:
        """The same where one term is 0."""
        keep = np.eye(TERMS)
        keep[term, term] = 0.0
        return replace(self, terms=self.terms @ keep, smooth=self.smooth.changed(keep))

    def less_sure(self, inflation: float) -> Joint:
        """The same where neighbouring points have so much in common, if that is more than was thought."""
        growth = max(inflation / self.inflation, 1.0)
        smooth = replace(self.smooth, covariance=growth * self.smooth.covariance)
        return replace(self, smooth=smooth, inflation=growth * self.inflation)

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
    shared: bool = False,
) -> Joint | None:
    """The ridge along a path fitted as a whole; None where there are too few points.

    before: an earlier fit, whose noise and smoothness are taken to begin with; None: there was none, and the
    section may be far off. rounds: at most, of which the last does not change the section any
    more; 0: only how a steep one begins. flat: the
    base stays as curved across as the path has it. most: about as many points are looked at. shared: in the
    last round errors that points have in common are looked for.
    """
    beside = settings.flank * (_BESIDE if is_steep(path) else 1.0)
    points = points_along(grid, path, (0.5 + beside) * path.width, most)
    if len(points) < _FEWEST:
        return None
    some = points[:: 1 + len(points) // SOME_POINTS]
    shaping = settings.section in FOUND
    task = task_of(some, path, flat)
    state: State | None = _begun(task, section, before)
    if state is not None and task.steep and before is None and shaping:
        state = likeliest(task, state)
    for n in range(rounds):
        last = n == rounds - 1 or (n >= _WITHOUT_SHAPING and not shaping)
        left = rounds - 1 - n if before is None and not last else 0
        state = improved(task, points if last else some, state, left, shared=shared and last)
        if last or state is None:
            break
        if shaping:
            new = _reshaped(task, state)
            shaping, state = new.section is not state.section or new.section is box(), new
        if state.section.name == FREE and (n == rounds - 2 or not shaping):
            state = state.given(*between_feet(some, state.terms, state.section, state.noise, state.inflation))
    if state is None or state.fit is None:
        return None
    return _joint(points, some, path, state, state.fit, 2.0 * beside)


def _begun(task: Task, section: Section, before: Joint | None) -> State:
    path, h, w = task.path, task.height, task.width
    terms = np.zeros((len(path.at), TERMS))
    terms[:, H], terms[:, W] = path.height, path.width
    if before is None:
        weights = (_START * np.array([h, h / w, h / w**2, w, h, w])) ** -2.0
        return State(terms, section, first_noise(task.some, terms, section, h, w), weights)
    if before.path is not path:
        if task.steep:
            terms = continued(task.some, path, terms, section, before.noise)
        return State(terms, section, before.noise, before.smooth.weights)
    known = before.smooth.weights, before.inflation, before.smooth.freedom
    return State(before.terms, section, before.noise, *known)


def _reshaped(task: Task, state: State) -> State:
    """With a free section if it is better; on steep flanks only if the exact likelihood says so too."""
    new = state.given(*shaped(task.some, state.terms, state.section, state.noise, state.inflation))
    if new.section is state.section or not task.steep:
        return new
    return new if chance(task.some, new) > chance(task.some, state) else state


def _joint(points: Array, some: Array, path: PathFrame, state: State, fit: Fit, flats: float) -> Joint:
    """flats: breadth of the base beside the ridge that was looked at, in widths."""
    terms, noise, inflation = state.terms, state.noise, state.inflation
    stretches = len(path.at) - 1
    count = np.bincount(points[:, 0].astype(np.int64), minlength=stretches)[:stretches]
    girth = flats + 1.0 + noise.even * (_girths(state.section, terms) - 1.0)
    counts = count / (girth * path.width[1:] ** 2)
    seen = smear(state.section, terms, noise.blur, noise.even)
    shape = section_std(some, terms, seen, noise.told, inflation)
    misfit = _misfit(some, terms, seen, noise.scale)
    told = fit.smooth, terms, state.section, fit.matrix, fit.goal
    return Joint(path, *told, counts, misfit, noise, inflation, shape)


def _girths(section: Section, terms: Array) -> Array:
    """(n - 1,) length of the surface from foot to foot, in widths, of each stretch."""
    steep = np.abs(terms[:, H] / terms[:, W])
    slope = section(np.linspace(-0.5, 0.5, _GIRTH), 1)
    return np.asarray(np.hypot(1.0, 0.5 * (steep[1:] + steep[:-1])[:, None] * slope).mean(axis=1))


def _misfit(points: Array, terms: Array, seen: Smeared, scale: float) -> Array:
    """(n - 1, 3) as Joint.misfit has it."""
    place = points[:, 0].astype(np.int64)
    eta = (points[:, 1] - terms[place, E]) / terms[place, W]
    on = np.abs(eta) < 0.5
    place, eta = place[on], eta[on]
    off = offsets(points[on], terms, seen.told, scale)[0]
    far = np.minimum((off / max(scale, least_noise(terms))) ** 2, _FAR_OFF)
    top = (seen.section(eta) > _ON_TOP) & (far < _FAR_OFF)
    told = [np.bincount(place, weights, len(terms) - 1) for weights in (None, far, top)]
    return np.column_stack(told).astype(np.float64)


def least_noise(terms: Array) -> float:
    """Distance of points that the section of a ridge with these terms (n, 6) may always miss by."""
    return _LEAST_NOISE * float(np.median(np.abs(terms[:, H])))
