"""The joint refit: path, base, height and width along the whole ridge together, against all of its points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ridgefeature.beyond import continued
from ridgefeature.free_section import FREE
from ridgefeature.grid import Grid
from ridgefeature.joint_rounds import Fit, State, Task, chance, hardly_moved, improved, is_steep, task_of
from ridgefeature.kernels.section_sums import misfit_sums
from ridgefeature.kernels.strip import TERMS, C, E, H, W
from ridgefeature.medians import median
from ridgefeature.missed_points import with_missed_points
from ridgefeature.noise import Noise, evenness, first_noise
from ridgefeature.path_frame import PathFrame, points_along
from ridgefeature.section import Section, box
from ridgefeature.section_std import SectionStd, section_std
from ridgefeature.settings import Settings
from ridgefeature.shaping import between_feet, shaped, told_of
from ridgefeature.smearing import Smeared, log_likelihood, smear
from ridgefeature.smoothing import Smooth
from ridgefeature.steep_end import likelier
from ridgefeature.steep_start import likeliest
from ridgefeature.unseen import unseen_std

Array = NDArray[np.float64]

_WITHOUT_SHAPING = 1
"""Round, from 0, that is the last one where the section stays as it is."""
FOUND = ("auto", "learned")
"""Settings of the section that let it be found."""
MOST_POINTS, SOME_POINTS = 300_000, 20_000
"""As many are looked at in the last round of all, and before it."""
_START = 0.02
"""Roughness to begin with, in sizes of the terms."""
_MANY_STRAYS = 0.03
"""Share of strays from which on they may hide how evenly the others lie."""
_OVER_SURFACE = 0.5
"""From which on points about steep flanks lie evenly over the surface."""
_BENT, _BENT_IN_THE_MEAN = 4.5, 2.5
"""Change of the base's curvature, in standard deviations, up to which it may be chance."""
_FAR_OFF = 25.0
"""Squared distance, in noise scales, beyond which a point may lie anywhere."""
_BESIDE = 3.0
"""Flats beside a steep ridge, in those of templates: height and lean hang on how the base is bent."""
_LEAST_NOISE = 0.02
"""Distance of points, in heights, that a section may always miss by."""
_GIRTH = 41
"""Places of a section that tell its length."""
_COARSE = 2.0
"""Distances of points from a steep ridge, by the noise beside it, from which on its flanks are steeper than
any section: the likeliest one would have horns."""
_FEWEST = 60
"""Points of the smallest ridge that is refitted."""


@dataclass(frozen=True, eq=False)
class Joint:
    """A ridge fitted as a whole: terms (n, 6) at the nodes of its path, and how sure they are."""

    path: PathFrame
    points: Array
    """(m, 3) that it was fitted to, in path coordinates."""
    smooth: Smooth
    terms: Array
    section: Section
    matrix: Array
    goal: Array
    """(n - 1, 6, 6), (n - 1, 6) normal equations of the terms in each stretch, as its points alone tell."""
    noise: Noise
    inflation: float
    """Variance of sums over neighbouring points, by what it would be if their noise was independent."""
    flats: float
    """Breadth of the base beside the ridge that was looked at, in widths."""
    exact: bool = False
    """Whether by the likelihood of the points itself, not by mean heights."""

    @cached_property
    def seen(self) -> Smeared:
        """The section as points so noisy show it."""
        return smear(self.section, self.terms, self.noise.blur, self.noise.even)

    @cached_property
    def counts(self) -> Array:
        """(n - 1,) points of each stretch, strays too, by the area on which they lie, in squared widths."""
        stretches = len(self.path.at) - 1
        count = np.bincount(self.points[:, 0].astype(np.int64), minlength=stretches)[:stretches]
        girth = self.flats + 1.0 + self.noise.even * (_girths(self.section, self.terms) - 1.0)
        return np.asarray(count / (girth * self.path.width[1:] ** 2))

    @cached_property
    def misfit(self) -> Array:
        """(n - 1, 3) points of each stretch between the feet, the sum of their squared distances from the
        surface in noise scales or, if that is more, least noises, none more than 25, and how many lie near
        its top."""
        some, noise = _some(self.points), (self.noise.scale, least_noise(self.terms), _FAR_OFF)
        return misfit_sums(some, self.terms, self.seen.told, *noise, self.section.top)

    @cached_property
    def section_std(self) -> SectionStd:
        """What the section, the same along the whole ridge, adds to standard deviations."""
        some, noise = _some(self.points), self.noise
        told = told_of(some, self.terms, self.seen, noise, self.exact)
        gap = unseen_std(some, self.terms, self.seen, noise.scale)
        return section_std(told, self.seen, gap, self.inflation, self.exact, self._common)

    @property
    def _common(self) -> tuple[float, float, float]:
        """Variances of height, width and place, in heights and widths, by which all of it may be off."""
        h, w = (0.5 * (self.terms[1:, k] + self.terms[:-1, k]) for k in (H, W))
        sizes = np.column_stack([h, h / w, h / w**2, w, h, w])
        known = np.einsum("nij,ni,nj->ij", self.matrix, sizes, sizes)
        variances = np.diagonal(np.linalg.pinv(known, hermitian=True))
        return float(variances[H]), float(variances[W]), float(variances[E])

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

    @cached_property
    def backwards(self) -> Joint:
        """The same stretches in the other order, for what is told of the last end of a ridge."""
        path = self.path
        path = replace(path, at=-path.at[::-1], height=path.height[::-1], width=path.width[::-1])
        turned = {name: getattr(self, name)[::-1] for name in ("terms", "matrix", "goal")}
        back = replace(self, path=path, **turned)
        # The points' own coordinates still run as they did: these tell nothing of the other order.
        vars(back).update({name: getattr(self, name)[::-1] for name in ("counts", "misfit")})
        return back

    @property
    def chance(self) -> float:
        """Log likelihood of a point, in the mean."""
        some = _some(self.points)
        return log_likelihood(some, self.terms, self.section, *self.noise.all) / len(some)

    @property
    def bent(self) -> bool:
        """Whether the base's curvature changes beyond chance: somewhere, or in the mean."""
        std = self.deviations(C)
        each = self.terms[:, C] / np.where(std > 0, std, np.inf)
        return bool(np.abs(each).max() > _BENT or abs(each.mean()) > _BENT_IN_THE_MEAN)

    def deviations(self, term: int) -> Array:
        """(n,) standard deviations of a term at the nodes."""
        first, basis = self.path.at_nodes
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
    gentle: bool = False,
    brief: bool = False,
) -> Joint | None:
    """The ridge along a path fitted as a whole; None where there are too few points.

    before: an earlier fit, whose noise and smoothness are taken to begin with; None: there was none, and the
    section may be far off. rounds: at most, of which the last does not change the section any
    more; 0: only how a steep one begins. flat: the base stays as curved across as the path has it. most:
    about as many points are looked at. gentle: begins as if it was not steep.
    brief: where section and terms stay as they are no other round follows: `with_common_errors` is one.
    """
    beside = _beside(path, settings)
    points = points_along(grid, path, (0.5 + beside) * path.width, most)
    if len(points) < _FEWEST:
        return None
    some = _some(points)
    shaping = settings.section in FOUND
    task = task_of(some, path, flat)
    if gentle:
        task = replace(task, steep=False)
    state: State | None = _begun(task, section, before)
    if state is not None and task.steep and before is None and shaping:
        state = likeliest(task, state)
    for n in range(rounds):
        known = state
        last = n == rounds - 1 or (n >= _WITHOUT_SHAPING and not shaping)
        left = rounds - 1 - n if before is None and not last else 0
        state = improved(task, some, state, left)
        if last or state is None:
            break
        if shaping:
            new = _reshaped(task, state)
            shaping, state = new.section is not state.section or new.section is box(), new
            free = state.section.name == FREE  # its feet are still to be found
            if brief and not shaping and not free and hardly_moved(task, known, state):
                break
        if state.section.name == FREE and (n == rounds - 2 or not shaping):
            state = state.given(*between_feet(some, state.terms, state.section, state.noise, state.inflation))
    if state is None or state.fit is None:
        return None
    return _joint(path, points, state, state.fit, beside)


def with_common_errors(joint: Joint, settings: Settings, flat: bool) -> Joint | None:
    """The same fit to the same points where errors that those beside each other along the ridge have in
    common are looked for; a steep ridge is fitted by its likelihood itself, unless its flanks are steeper
    than a section can be. flat: as for `fit_whole`."""
    task = task_of(_some(joint.points), joint.path, flat)
    state: State | None = _lying_as_told(task, _begun(task, joint.section, joint))
    if state is not None and task.steep and state.noise.scale < _COARSE * state.noise.blur:
        state = likelier(task, joint.points, state, settings.section in FOUND)
    else:
        state = improved(task, joint.points, state, 0, shared=True)
    if state is None or state.fit is None:
        return None
    return _joint(joint.path, joint.points, state, state.fit, _beside(joint.path, settings))


def _beside(path: PathFrame, settings: Settings) -> float:
    """Breadth of the base that is looked at on either side of a ridge, in widths."""
    return settings.flank * (_BESIDE if is_steep(path) else 1.0)


def _some(points: Array) -> Array:
    return np.ascontiguousarray(points[:: 1 + len(points) // SOME_POINTS])


def _begun(task: Task, section: Section, before: Joint | None) -> State:
    path, h, w = task.path, task.height, task.width
    terms = np.zeros((len(path.at), TERMS))
    terms[:, H], terms[:, W] = path.height, path.width
    if before is None:
        weights = (_START * np.array([h, h / w, h / w**2, w, h, w])) ** -2.0
        noise = first_noise(task.some, terms, section, h, w)
        return State(with_missed_points(task.some, terms, section, noise), section, noise, weights)
    if before.path is not path:
        if task.steep:
            terms = continued(task.some, path, terms, section, before.noise)
        terms = with_missed_points(task.some, terms, section, before.noise)
        return State(terms, section, before.noise, before.smooth.weights)
    known = before.smooth.weights, before.inflation, before.smooth.freedom
    state = State(before.terms, section, before.noise, *known)
    vars(state)["seen"] = before.seen  # which would else be worked out again
    return state


def _lying_as_told(task: Task, state: State) -> State:
    """With points that lie as evenly as is told now, where strays or a start far off told it wrong before."""
    noise = state.noise
    if not task.steep and noise.strays < _MANY_STRAYS:
        return state
    even = evenness(task.some, state.terms, state.section, noise)
    # Strays about steep flanks pass for points of theirs: only which of both it is can be told.
    return state.lying(float(even > _OVER_SURFACE) if task.steep else even)


def _reshaped(task: Task, state: State) -> State:
    """With a free section if it is better; on steep flanks only if the exact likelihood says so too."""
    section, terms = shaped(task.some, state.terms, state.seen, state.noise, state.inflation)
    if section is state.section:
        return state
    new = state.given(section, terms)
    if not task.steep:
        return new
    return new if chance(task.some, new) > chance(task.some, state) else state


def _joint(path: PathFrame, points: Array, state: State, fit: Fit, beside: float) -> Joint:
    told = fit.smooth, state.terms, state.section, fit.matrix, fit.goal, state.noise, state.inflation
    joint = Joint(path, points, *told, 2.0 * beside, fit.exact)
    if "seen" in vars(state):
        vars(joint)["seen"] = state.seen  # which would else be worked out again
    return joint


def _girths(section: Section, terms: Array) -> Array:
    """(n - 1,) length of the surface from foot to foot, in widths, of each stretch."""
    steep = np.abs(terms[:, H] / terms[:, W])
    slope = section(np.linspace(-0.5, 0.5, _GIRTH), 1)
    return np.asarray(np.hypot(1.0, 0.5 * (steep[1:] + steep[:-1])[:, None] * slope).mean(axis=1))


def least_noise(terms: Array) -> float:
    """Distance of points that the section of a ridge with these terms (n, 6) may always miss by."""
    return _LEAST_NOISE * median(np.abs(terms[:, H]))
