"""The noise of a ridge's points: how far they scatter, how many are strays, how they lie, how correlated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels.section_sums import strip_sums
from ridgefeature.kernels.strip import TERMS, H, W, mixture, offsets, places_across
from ridgefeature.medians import median
from ridgefeature.path_frame import NODES_A_WIDTH
from ridgefeature.section import Section
from ridgefeature.smearing import smear

Array = NDArray[np.float64]

EXACT = 5e-3
"""Least noise, in apex heights: splines are no nearer to a real ridge, and what they miss is no stray."""
_FIRST_MIXTURE = 15
_ENOUGH = 5000
"""Points that tell the noise well enough to begin with."""
_FEWEST = 60
"""Points beyond the feet that tell the noise by themselves."""
_BESIDE = 0.7
"""Distance from the spine in widths up to which points are counted to tell how evenly they lie."""
_SOME_STRAYS = 0.05
_NO_STRAY = 3.0
"""Distance from the surface, in noise scales, up to which a point is no stray."""
_STRIP, _FEW, _TOGETHER = 0.1, 3, 3
"""Breadth of strips in widths; fewest points of a part one width long; such parts looked at together."""
_SURE = 3.0
"""Standard deviations from which on such sums are correlated."""
_CROSSING = 1.35
"""What scan lines add to variances, in what strips show of it: lines cross strips, and go on beyond windows.
Told by how often bands of heights hold the truth on banded scans."""
_BLOCK = 5
"""Nodes over which noise may be correlated."""
_MEDIAN = 0.89
"""Median of chi-square with six degrees of freedom, by its mean."""


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
    blur: float
    """Standard deviation of the places of points: that of heights, without what a wrong section adds."""

    @property
    def told(self) -> tuple[float, float]:
        """As the kernels take it."""
        return self.scale, self.density

    @property
    def all(self) -> tuple[float, float, float, float]:
        """As a likelihood takes it."""
        return self.blur, self.even, self.strays, self.span


def first_noise(
    points: Array, terms: Array, section: Section, h: float, w: float, even: float | None = None
) -> Noise:
    """The noise as some of the points tell it; even: how they lie, if that is known."""
    points = np.ascontiguousarray(points[:: 1 + len(points) // _ENOUGH])
    seen = smear(section, terms, 0.0, 0.0).told
    distances, far = offsets(points, terms, seen, EXACT * h)
    scale = max(1.4826 * median(np.abs(distances)), EXACT * h)
    span = 4.0 * h + 0.5 * w  # as in PathFrame.tall
    scale, strays, density = mixture(distances, far, scale, _SOME_STRAYS, span, EXACT * h, _FIRST_MIXTURE)
    blur = blur_of(points, terms, distances, scale, span, EXACT * h)
    if even is None:
        even = _evenness(points, terms, section, blur)
    return Noise(scale, strays, density, span, even, blur)


def blur_of(points: Array, terms: Array, distances: Array, scale: float, span: float, least: float) -> float:
    """The noise as points beyond the feet tell it, but no more than all of them do."""
    every = 1 + len(points) // _ENOUGH
    beyond = distances[::every][np.abs(places_across(points[::every], terms)) > 0.5]
    if len(beyond) < _FEWEST:
        return scale
    return min(mixture(beyond, np.abs(beyond), scale, _SOME_STRAYS, span, least, _FIRST_MIXTURE)[0], scale)


def evenness(points: Array, terms: Array, section: Section, noise: Noise) -> float:
    """0 where points lie evenly over the base, 1 where evenly over the surface, flanks too.

    Told by those points that are no strays: these lie evenly over the base whatever the others do.
    """
    points = points[:: 1 + len(points) // _ENOUGH]
    seen = smear(section, terms, noise.blur, noise.even).told
    far = offsets(points, terms, seen, noise.scale)[1]
    return _evenness(points[far < _NO_STRAY * noise.scale], terms, section, noise.blur)


def _evenness(points: Array, terms: Array, section: Section, noise: float) -> float:
    """The same of points among which there are no strays."""
    h, w = median(np.abs(terms[:, H])), median(terms[:, W])

    def stretched(eta: Array) -> Array:
        return np.asarray(np.sqrt(1.0 + (h / w * section(eta, 1)) ** 2))

    eta = places_across(points, terms)
    places = np.linspace(-1.0, 1.0, 401)
    dense = stretched(places)
    if noise > 0:
        spread = np.exp(-0.5 * (np.linspace(-2.0, 2.0, 801) * w / noise) ** 2)
        dense = np.convolve(dense, spread, "valid") / np.convolve(np.ones(401), spread, "valid")
    inner = np.abs(places) < _BESIDE
    near = eta[np.abs(eta) < _BESIDE]
    if not len(near):
        return 0.0
    found = np.interp(near, places, dense).mean()
    on_base, on_surface = dense[inner].mean(), (dense[inner] ** 2).mean() / dense[inner].mean()
    return float(np.clip((found - on_base) / max(on_surface - on_base, 1e-12), 0.0, 1.0))


def inflation_along(
    points: Array, terms: Array, distances: Array, shares: Array, scale: float, freedom: float
) -> Array:
    """Variance of sums over points by that of independent noise, 1 or more, of each stretch (n - 1,).

    Told by sums over narrow strips beside each other along the ridge, each a width long.

    points (m, 3) in path coordinates and terms (n, 6) as in kernels.strip; distances (m,) from where points
    are expected; shares (m,): chance that each is no stray; freedom: by how
    much the fit made the squares of all sums less, negative if more. Points
    of one scan line may have an error in common: where such lines run along the ridge their sums tell far
    less than so many points would.
    """
    strips = np.floor(places_across(points, terms) / _STRIP).astype(np.int64)
    at = (points[:, 0] / NODES_A_WIDTH).astype(np.int64)
    sums, squares, counts = strip_sums(at, strips - strips.min(), shares * distances / scale)
    windows = len(sums)
    told = (counts >= _FEW) & (squares > 0)
    seen = np.where(told, sums**2 / np.where(told, squares, 1.0), 0.0).sum(axis=1)
    free = np.maximum(told.sum(axis=1) - min(freedom / windows, TERMS), 0.0)
    seen = np.where(free > 0, seen, 0.0)
    if seen.sum() < free.sum() + _SURE * np.sqrt(2.0 * free.sum()):
        return np.ones(len(terms) - 1)
    near = np.ones(min(_TOGETHER, windows))
    found = np.convolve(seen, near, "same") / np.maximum(np.convolve(free, near, "same"), 1.0)
    found = 1.0 + _CROSSING * (found - 1.0)
    middles = (np.arange(len(terms) - 1) + 0.5) / NODES_A_WIDTH - 0.5
    return np.maximum(np.interp(middles, np.arange(windows), found), 1.0)


def inflation_of(matrix: Array, right: Array) -> float:
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
    return max(1.0, median(each) / _MEDIAN)
