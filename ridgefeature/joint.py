"""The joint refit: path, base, height and width along the whole ridge together, against all of its points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.free_section import FREE, SPANS, WIDER, SectionStd, free_section, section_std
from ridgefeature.grid import Grid
from ridgefeature.kernels.strip import TERMS, A, B, C, E, H, W, information, mixture, offsets
from ridgefeature.path_frame import PathFrame, points_along
from ridgefeature.section import Section
from ridgefeature.settings import Settings
from ridgefeature.smoothing import Smooth, basis_at, smoothest

Array = NDArray[np.float64]

_ROUNDS = 4
_WITHOUT_SHAPING = 1
"""Round, from 0, that is the last one where the section stays as it is."""
_FIRST_MIXTURE, _NEXT_MIXTURE = 15, 3
MOST_POINTS, SOME_POINTS = 300_000, 20_000
"""As many are looked at in the last round, and before it."""
_ENOUGH = 5000
"""Points that tell the noise well enough to begin with."""
_START = 0.02
"""Roughness to begin with, in sizes of the terms."""
_SOME_STRAYS = 0.05
_EXACT = 5e-3
"""Least noise, in apex heights: splines are no nearer to a real ridge, and what they miss is no stray."""
_BLOCK = 5
"""Nodes over which noise may be correlated."""
_MEDIAN = 0.89
"""Median of chi-square with six degrees of freedom, by its mean."""
_FAR_OFF = 25.0
"""Squared distance, in noise scales, beyond which a point may lie anywhere."""
_FEWEST = 60
"""Points of the smallest ridge that is refitted."""


@dataclass(frozen=True)
class Noise:
    """Distances of points from the surface: normal, and those of strays, spread evenly."""

    scale: float
    """Standard deviation of those that are no strays."""
    strays: float
    """Share of points that are strays."""
    density: float
    """Of strays, by that of the others at their middle."""
    span: float
    """Distances that strays may have, in all."""
    even: float
    """0 where points lie evenly over the base, 1 where evenly over the surface."""

    @property
    def told(self) -> tuple[float, float, float]:
        """As the kernels take it."""
        return self.scale, self.density, self.even


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

    def between_feet(self, section: Section, middle: float, breadth: float) -> Joint:
        """The same with a section whose feet lie `breadth` apart about `middle`, in widths of the old one."""
        change = np.eye(TERMS)
        change[E, W], change[W, W] = middle, breadth
        return replace(
            self,
            section=section,
            terms=self.terms @ change.T,
            smooth=self.smooth.changed(change),
            section_std=self.section_std.in_parts_of(breadth),
        )

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
    weights: Array | None = None,
    rounds: int = 3,
    flat: bool = False,
    most: int = MOST_POINTS,
) -> Joint | None:
    """The ridge along a path fitted as a whole; None where there are too few points.

    weights (6,): of the penalties of an earlier fit, to begin with. rounds: at most, of which the last does
    not change the section any more. flat: the base stays as curved across as the path has it. most: about
    as many points are looked at.
    """
    points = points_along(grid, path, (0.5 + settings.flank) * path.width, most)
    if len(points) < _FEWEST:
        return None
    some = points[:: 1 + len(points) // SOME_POINTS]
    h, w = float(np.median(np.abs(path.height))), float(np.median(path.width))
    if weights is None:
        weights = (_START * np.array([h, h / w, h / w**2, w, h, w])) ** -2.0
    terms = np.zeros((len(path.at), TERMS))
    terms[:, H], terms[:, W] = path.height, path.width
    first, basis = basis_at(path.coefficients, path.knots)
    middle, wanted = 0.5 * (path.knots[1:] + path.knots[:-1]), _wanted(path)
    noise, inflation = _first_noise(some, terms, section, h, w), 1.0
    shaping = settings.section in ("auto", "learned")
    for n in range(rounds):
        last = n == rounds - 1 or (n >= _WITHOUT_SHAPING and not shaping)
        matrix, goal, noise, gain = _linearised(points if last else some, terms, section, noise, _EXACT * h)
        if not np.isfinite(matrix).all() or not np.isfinite(gain):
            return None
        if n > 0:
            inflation = _inflation(gain * matrix, gain * goal)
        at = 0.5 * (terms[1:] + terms[:-1])
        goal += np.einsum("nij,nj->ni", matrix, at)
        matrix, goal = gain / inflation * matrix, gain / inflation * goal
        if flat:
            _fix(matrix, goal, C)
        smooth = smoothest(matrix, goal, middle, path.coefficients, wanted, weights)
        weights = smooth.weights
        terms = (basis[:, :, None] * smooth.coefficients[first[:, None] + np.arange(4)]).sum(axis=1)
        terms[:, W] = np.clip(terms[:, W], 0.4 * path.width, 2.5 * path.width)
        if shaping and not last:
            new, terms = _shaped(some, terms, section, noise, inflation)
            shaping, section = new is not section, new
        if last:
            break
    counts = np.bincount(points[:, 0].astype(np.int64), minlength=len(middle))[: len(middle)]
    shape = section_std(some, terms, section, noise.told, inflation)
    misfit = _misfit(some, terms, section, noise)
    return Joint(
        path, smooth, terms, section, matrix, goal, counts.astype(float), misfit, noise, inflation, shape
    )


def _misfit(points: Array, terms: Array, section: Section, noise: Noise) -> Array:
    """(n - 1, 2) as Joint.misfit has it."""
    place = points[:, 0].astype(np.int64)
    on = np.abs(points[:, 1] - terms[place, E]) < 0.5 * terms[place, W]
    far = np.minimum((offsets(points[on], terms, section.table) / noise.scale) ** 2, _FAR_OFF)
    both = [np.bincount(place[on], weights, len(terms) - 1) for weights in (None, far)]
    return np.column_stack(both).astype(np.float64)


def _linearised(
    points: Array, terms: Array, section: Section, noise: Noise, least: float
) -> tuple[Array, Array, Noise, float]:
    """Normal equations of all stretches for changes of the terms, noise, what makes them a likelihood."""
    distances = offsets(points, terms, section.table)
    scale, strays, density = mixture(distances, noise.scale, noise.strays, noise.span, least, _NEXT_MIXTURE)
    matrix, right, sums = information(points, terms, section.table, scale, density, noise.even)
    gain = float(sums[3] ** 2 / (sums[2] * sums[1]))
    return matrix, right, replace(noise, scale=scale, strays=strays, density=density), gain


def _fix(matrix: Array, goal: Array, term: int) -> None:
    """Let normal equations ask for 0 of one term, whatever the others are."""
    goal[:, term] = matrix[:, term] = matrix[:, :, term] = 0.0
    matrix[:, term, term] = 1.0


def _shaped(
    points: Array, terms: Array, section: Section, noise: Noise, inflation: float
) -> tuple[Section, Array]:
    """The section and terms, or a free section and its terms where that is better beyond doubt."""
    price, best, kept = np.log(len(points)), 0.0, (section, terms)
    wider = 1.0 if section.name == FREE else WIDER
    for spans in SPANS:
        found = free_section(points, terms, section, noise.told, spans, wider)
        if found is None:
            continue
        cost = price * found.freedom
        net = found.gain / inflation - cost
        if net > best:
            best, kept = net, found.applied(terms)
        if net < -0.5 * cost:
            break  # nor will a finer one do
    return kept


def _first_noise(points: Array, terms: Array, section: Section, h: float, w: float) -> Noise:
    """The noise as some of the points tell it."""
    points = points[:: 1 + len(points) // _ENOUGH]
    distances = offsets(points, terms, section.table)
    scale = max(1.4826 * float(np.median(np.abs(distances))), _EXACT * h)
    span = 4.0 * h + 0.5 * w  # as in PathFrame.tall
    scale, strays, density = mixture(distances, scale, _SOME_STRAYS, span, _EXACT * h, _FIRST_MIXTURE)
    return Noise(scale, strays, density, span, _evenness(points, terms, section))


def _wanted(path: PathFrame) -> Array:
    """(6, n) what the differences of the coefficients should be for path and base to be smooth as a whole."""
    n, s = path.coefficients, path.at
    out = np.zeros((TERMS, n))

    def rate(x: Array) -> Array:
        return np.asarray(np.gradient(x, s, axis=0))

    turn = rate(path.tangent)
    bow = rate((turn * path.normal).sum(axis=1))
    geodesic = rate((turn * path.left).sum(axis=1))
    twist = rate(-(rate(path.normal) * path.left).sum(axis=1))
    step = np.gradient(s, path.knots)
    for term, order, change in ((A, 3, bow), (E, 3, geodesic), (B, 2, twist)):
        # The middle of the coefficients of a difference; the i-th is centred i - 1 knots from the start.
        places = np.clip(np.arange(n - order) + 0.5 * order - 1.0, 0.0, n - 3.0)
        out[term, : n - order] = -np.interp(places, path.knots, change * step**order)
    centres = np.clip(np.arange(n) - 1.0, 0.0, n - 3.0)
    out[C, : n - 1] = -np.diff(0.5 * np.interp(centres, path.knots, path.curvature))
    return out


def _evenness(points: Array, terms: Array, section: Section) -> float:
    """0 where points lie evenly over the base, 1 where evenly over the surface, flanks too."""
    h, w = float(np.median(np.abs(terms[:, H]))), float(np.median(terms[:, W]))

    def stretched(eta: Array) -> Array:
        return np.asarray(np.sqrt(1.0 + (h / w * section(eta, 1)) ** 2))

    eta = points[:, 1] / np.interp(points[:, 0], np.arange(len(terms)), terms[:, W])
    even = np.linspace(-0.5, 0.5, 201)
    on_base, on_surface = (1.0 / stretched(even)).mean(), 1.0 / stretched(even).mean()
    found = (1.0 / stretched(eta[np.abs(eta) < 0.5])).mean()
    return float(np.clip((on_base - found) / max(on_base - on_surface, 1e-12), 0.0, 1.0))


def _inflation(matrix: Array, right: Array) -> float:
    """Variance of sums over blocks of nodes by that of independent noise, 1 or more."""
    n = len(matrix) // _BLOCK * _BLOCK
    whole = matrix[:n].reshape(-1, _BLOCK, TERMS, TERMS).sum(axis=1)
    pull = right[:n].reshape(-1, _BLOCK, TERMS).sum(axis=1)
    sizes = np.sqrt(np.einsum("nii->ni", whole))
    good = (sizes > 0).all(axis=1)
    if not good.any():
        return 1.0
    scaled = whole[good] / (sizes[good, :, None] * sizes[good, None])
    values, vectors = np.linalg.eigh(scaled)
    seen = np.einsum("nij,ni->nj", vectors, pull[good] / sizes[good]) ** 2
    told = values > 1e-6
    each = np.where(told, seen / np.maximum(values, 1e-6), 0.0).sum(axis=1) / told.sum(axis=1)
    return max(1.0, float(np.median(each)) / _MEDIAN)
