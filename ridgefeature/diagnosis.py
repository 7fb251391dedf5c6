"""Where a ridge is to be trusted: how the scan's points lie about the finished surface."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ridgefeature.curvilinear import local_coordinates, over_base, templates_on, thinned
from ridgefeature.doubts import doubts, to_one_side
from ridgefeature.folds import with_folds
from ridgefeature.grid import build_grid, nearest_distances
from ridgefeature.kernels.strip import mixture
from ridgefeature.ridge import Ridge
from ridgefeature.scan import Scan, as_scan

Array = NDArray[np.float64]

MOST = 200_000
"""Points about the ridge that are looked at: of more a choice tells the same."""
_FEWEST = 16
"""Points below which nothing is said of the noise."""
_REACH = (2.0, 0.25)
"""Heights and widths, in all, from the surface up to which a point may be one of the ridge or a stray."""
_ROUNDS, _SOME_STRAYS = 30, 0.05
_NEAR, _NEIGHBOURS = 2.0, 8
"""Spacings from a point within which the surface counts as seen; points that tell the spacing."""
_PLACES = (400, 25)
"""Places along and across at which the surface is asked whether it was seen."""
_STRETCH, _STRETCHES = 0.5, (8, 60)
"""Length of a stretch in widths between the feet; least and largest number of them."""
_NORMAL = 1.4826
"""Standard deviation over median absolute deviation of a normal distribution."""


@dataclass(frozen=True)
class TemplateFit:
    """What the fit of one template said, and how it went with the finished surface. Lengths in its unit."""

    arc_length: float
    """Of its middle, along the finished ridge."""
    status: str
    points: int
    inliers: int
    evaluations: int
    M: float
    """Mean directed distance from the patch to the scan, and what it is for a perfect patch."""
    M_floor: float
    deviation_rms: float
    """Of the points between the feet that are no strays from the finished surface, along this template."""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """How a scan's points lie about a ridge's finished surface. Lengths in the ridge's unit."""

    arc_length: Array
    """(m,) of the scan points over or under the surface."""
    across: Array
    """(m,) their distance from the spine, positive to the left."""
    deviation: Array
    """(m,) their signed distance to the surface, positive on the side of its normal."""
    stray: NDArray[np.bool_]
    """(m,) whether a point is a stray rather than one of the surface with noise."""
    noise: float
    """Standard deviation of the others' distances; NaN below 16 points."""
    outliers: float
    """Share of strays."""
    reduced_chi_square: float
    """Mean square of the deviations between the feet over that of the noise as neighbours along the ridge
    tell it by their differences, which no smooth misfit enters (pure error): 1 where nothing but noise is
    left, more where the surface misses the points, or the noise is shared by neighbours."""
    coverage: float
    """Share of the surface between the feet with scan points near it."""
    seen: NDArray[np.bool_]
    """(n, m) where that is, at even places along the ridge and from the right foot to the left."""
    stretches: Array
    """(j + 1,) arc lengths between which the next three are told."""
    stretch_rms: Array
    """(j,) robust root mean square of all deviations between the feet; NaN where there are no points."""
    stretch_outliers: Array
    """(j,) share of strays between the feet."""
    stretch_coverage: Array
    """(j,) share of the surface between the feet with scan points near it."""
    templates: tuple[TemplateFit, ...]
    """Those that are part of the finished ridge."""
    doubts: tuple[tuple[float, float, str], ...]
    """From which arc length to which not to trust it, and why; in order, empty where there is no doubt."""

    def summary(self) -> dict[str, object]:
        """Figures as plain numbers and words, for a table or for JSON."""
        return {
            "coverage": self.coverage,
            "outliers": self.outliers,
            "noise": self.noise,
            "reduced_chi_square": self.reduced_chi_square,
            "doubts": [{"from": a, "to": b, "why": why} for a, b, why in self.doubts],
            "templates": [dict(vars(t)) for t in self.templates],
        }


def diagnose(ridge: Ridge, scan: Scan | ArrayLike) -> Diagnosis:
    """Hold the finished surface against the scan it was registered in.

    scan: a Scan or (n, 3) points, in the ridge's frame and unit. Noise and strays are told by a mixture of a
    normal and an even distribution (EM: Dempster, Laird and Rubin 1977), pure error by differences of
    neighbours (von Neumann 1941), reduced chi-square as in the lack-of-fit test of Draper and Smith, Applied
    Regression Analysis. Of more than 200,000 points about the ridge a random choice is looked at, always the
    same one. Raises ValueError for a scan that is none.
    """
    points, s, y, d = _footprint(ridge, as_scan(scan, ridge.unit).points)
    width = np.interp(s, ridge.arc_length, ridge.width)
    inner = np.abs(y) <= 0.5 * width
    noise, outliers, stray = _noise(ridge, d)
    edges = _edges(ridge)
    seen = _seen(ridge, points, noise)
    at = np.clip(np.searchsorted(edges, s, side="right") - 1, 0, len(edges) - 2)
    rms, strays = _along(at[inner], d[inner], stray[inner], len(edges) - 1)
    part = np.clip((np.arange(len(seen)) + 0.5) / len(seen) * (len(edges) - 1), 0, len(edges) - 2).astype(int)
    covered = np.bincount(part, seen.mean(axis=1), len(edges) - 1) / np.bincount(
        part, minlength=len(edges) - 1
    )
    kept, side = ~stray, np.where(stray, np.sign(d), 0.0)
    return Diagnosis(
        arc_length=s,
        across=y,
        deviation=d,
        stray=stray,
        noise=noise,
        outliers=outliers,
        reduced_chi_square=_chi_square(ridge, s[kept], y[kept], d[kept], inner[kept]),
        coverage=float(seen.mean()),
        seen=seen,
        stretches=edges,
        stretch_rms=rms,
        stretch_outliers=strays,
        stretch_coverage=covered,
        templates=_fits(ridge, s[kept & inner], d[kept & inner]),
        doubts=with_folds(
            doubts(ridge, edges, rms / noise, strays, covered, to_one_side(ridge, edges, s, y, side)), ridge
        ),
    )


def _footprint(ridge: Ridge, points: Array) -> tuple[Array, Array, Array, Array]:
    """The points over or under the surface: the points, s, y and signed distance to it."""
    height = np.abs(ridge.height)
    room = ridge.border.max() + height.max() + sum(_REACH) * max(height.max(), ridge.width.max())
    low, high = ridge.spine.min(axis=0) - room, ridge.spine.max(axis=0) + room
    points = thinned(points[((points >= low) & (points <= high)).all(axis=1)], MOST)
    s, y, z = local_coordinates(ridge, points)
    breadth, tall, width = (np.interp(s, ridge.arc_length, a) for a in (ridge.border, height, ridge.width))
    reach = _REACH[0] * tall + _REACH[1] * width
    inside = (
        (s >= 0)
        & (s <= ridge.length)
        & (np.abs(y) <= breadth)
        & (np.abs(over_base(ridge, s, y, z)) <= tall + reach)
    )
    surface = ridge.surface()
    (_, longest), (least, most) = surface.domain
    # From where the point is in the stations' frames: a search for the nearest sample takes ten times longer.
    start = np.clip(s[inside], 0, longest), np.clip(y[inside] / width[inside], least, most)
    d = surface.project(points[inside], start)[2]
    near = np.isfinite(d) & (np.abs(d) <= reach[inside])
    return points[inside][near], s[inside][near], y[inside][near], d[near]


def _noise(ridge: Ridge, d: Array) -> tuple[float, float, NDArray[np.bool_]]:
    """Standard deviation of the noise, share of strays, and which they are."""
    if len(d) < _FEWEST:
        return np.nan, np.nan, np.zeros(len(d), bool)
    height, width = float(np.median(np.abs(ridge.height))), float(np.median(ridge.width))
    least = 1e-6 * (height + width)
    span = 2 * (_REACH[0] * height + _REACH[1] * width)
    start = max(_NORMAL * float(np.median(np.abs(d))), least)
    scale, _, density = mixture(d, np.abs(d), start, _SOME_STRAYS, span, least, _ROUNDS)
    stray = np.exp(-0.5 * (d / scale) ** 2) < density
    return float(scale), float(stray.mean()), stray


def _chi_square(ridge: Ridge, s: Array, y: Array, d: Array, inner: NDArray[np.bool_]) -> float:
    """Mean square of deviations between the feet over the pure error of all."""
    if inner.sum() < _FEWEST:
        return np.nan
    area = np.trapezoid(2 * ridge.border, ridge.arc_length)
    spacing = math.sqrt(area / len(s))
    strip = np.floor(y / spacing)
    order = np.lexsort((d, s, strip))
    neighbours = (np.diff(strip[order]) == 0) & (np.diff(s[order]) < 3 * spacing)
    if neighbours.sum() < _FEWEST:
        return np.nan
    pure = 0.5 * float((np.diff(d[order])[neighbours] ** 2).mean())
    return float((d[inner] ** 2).mean()) / pure if pure > 0 else np.nan


def _edges(ridge: Ridge) -> Array:
    count = round(ridge.length / (_STRETCH * float(np.median(ridge.width))))
    return np.linspace(0.0, ridge.length, int(np.clip(count, *_STRETCHES)) + 1)


def _seen(ridge: Ridge, points: Array, noise: float) -> NDArray[np.bool_]:
    """(places along, places across) whether a scan point is near the surface there, between the feet."""
    n, m = _PLACES
    if len(points) <= _NEIGHBOURS:
        return np.zeros((n, m), bool)
    surface = ridge.surface()
    u = (np.arange(n) + 0.5) / n * ridge.length
    v = np.linspace(-0.5, 0.5, 2 * m + 1)[1::2]
    grid = build_grid(points)
    every = points[:: 1 + len(points) // 2000]
    # Points of an area lie evenly: k of them in a circle about one. In rows they lie apart as rows do.
    apart = nearest_distances(grid, every, _NEIGHBOURS + 1)[:, -1]
    spacing = float(np.median(apart)) * math.sqrt(math.pi / _NEIGHBOURS)
    gaps = nearest_distances(grid, surface(u[:, None], v[None, :]).reshape(-1, 3)).reshape(n, m)
    return np.asarray(gaps <= _NEAR * spacing + 3 * noise)


def _along(at: NDArray[np.intp], d: Array, stray: NDArray[np.bool_], count: int) -> tuple[Array, Array]:
    """Robust root mean square of the deviations in each stretch, and the share of strays."""
    rms, strays = np.full(count, np.nan), np.zeros(count)
    for i in range(count):
        here = at == i
        if here.any():
            rms[i] = _NORMAL * np.median(np.abs(d[here]))
            strays[i] = stray[here].mean()
    return rms, strays


def _fits(ridge: Ridge, s: Array, d: Array) -> tuple[TemplateFit, ...]:
    fits = []
    for template, middle in zip(*templates_on(ridge), strict=True):
        aside = np.abs(s - middle)
        if ridge.closed:
            aside = np.minimum(aside, ridge.length - aside)
        here = d[aside <= 0.5 * template.length]
        rms = float(np.sqrt((here**2).mean())) if len(here) else np.nan
        counts = template.status, template.points, template.inliers, template.evaluations
        fits.append(TemplateFit(float(middle), *counts, template.M, template.M_floor, rms))
    return tuple(fits)
