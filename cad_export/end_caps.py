"""Where the end rows of an open ridge leave the base, and the faces that close it there. OCP only."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from ridgefeature.basis import Places, solved
from ridgefeature.bspline import Curve, Surface, basis_matrix, clamped_knots, greville

Floats = NDArray[np.float64]


_SAMPLES = 32  # a knot span, to find where a row leaves the base


@dataclass(frozen=True, eq=False)
class Lift:
    """A stretch of an end row that is off the base, and the ruled surface between the two.

    span: parameters across. foot: the base's row, up: unit vectors from it, reach: how far the surface goes
    along them, one of both bounds 0; poles of cubics on `knots`. rise: how far the ridge's row is from the
    base's, to within `distance`.
    """

    span: tuple[float, float]
    knots: Floats
    foot: Floats
    up: Floats
    reach: Floats
    rise: Curve
    distance: float

    @property
    def surface(self) -> Surface:
        """u is the row's parameter, v the distance along `up`; the ridge's row is at v = rise(u)."""
        low, high = self.reach
        poles = self.foot[:, None] + self.reach[:, None] * self.up[:, None]
        return Surface(poles, self.knots, np.array([low, low, high, high]), 3, 1)

    def times(self, factor: float) -> Lift:
        """The same stretch with the row `factor` times as far off the base, factor above 0."""
        if factor == 1:
            return self
        rise = replace(self.rise, poles=factor * self.rise.poles)
        return replace(self, reach=factor * self.reach, rise=rise, distance=factor * self.distance)


def lifts(row: Curve, base: Curve, least: float) -> list[Lift]:
    """The stretches of a ridge's end row that are off the base's row, in ascending order.

    Both rows have the same knots. A row is off the base where their distance is `least` or more. Where their
    distance changes its sign a stretch ends and the next begins.
    """
    gap = Curve(row.poles - base.poles, row.knots, row.degree)
    return [_lift(gap, base, a, b) for a, b in _stretches(gap, least)]


def _stretches(gap: Curve, least: float) -> list[tuple[float, float]]:
    apart = np.abs(gap.poles).max(axis=1)
    if apart.max() <= least:
        return []
    some = np.flatnonzero(apart)  # beyond what these poles bear on there is no gap
    v, places = _looked_at(gap.knots.tobytes(), gap.degree, int(some[0]), int(some[-1]))
    g = places(gap.poles)
    square = (g**2).sum(axis=1)
    sign = np.where(square > least**2, np.sign(g @ g[np.argmax(square)]), 0.0)
    changes = np.flatnonzero(np.diff(sign))
    starts, ends = (changes[sign[changes + k] != 0] for k in (1, 0))
    ends = ends[ends > starts[0]] if starts.size else starts
    starts = starts[: len(ends)]
    pairs = zip(starts.tolist(), ends.tolist(), strict=True)
    edge = partial(_edge, v, g, gap.degree, least)
    return [(edge(i, i + 1), edge(k + 1, k)) for i, k in pairs]


@lru_cache(8)  # the same for all widths
def _looked_at(knots: bytes, degree: int, first: int, last: int) -> tuple[Floats, Places]:
    """Parameters close together where poles from first to last bear on a curve."""
    own = np.frombuffer(knots)
    v = _halved(np.unique(own[first : last + degree + 2]), _SAMPLES)
    return v, Places.at(own, degree, v)


def _edge(v: Floats, g: Floats, degree: int, least: float, off: int, on: int) -> float:
    """Where the gap, g (n, 3) at parameters v (n,), reaches `least`: between the samples `off` and `on`.

    Between knots the gap is a polynomial: that through degree + 1 samples of the same span. By bisection.
    """
    span = min(off, on) // _SAMPLES * _SAMPLES
    start = min(max(min(off, on) - 1, span), span + _SAMPLES - degree)
    terms = _through(degree) @ g[start : start + degree + 1]
    *terms, last = np.sum([np.convolve(term, term) for term in terms.T], axis=0).tolist()
    below, above = 0.0, 1.0
    for _ in range(20):
        middle = 0.5 * (below + above)
        x, square = off - start + middle * (on - off), 0.0
        for term in terms:
            square = (square + term) * x
        below, above = (below, middle) if square + last >= least**2 else (middle, above)
    return float(v[off] + above * (v[on] - v[off]))


@lru_cache(8)
def _through(degree: int) -> Floats:
    """From values at 0, 1, ..., degree to a polynomial's coefficients, the highest power first."""
    return np.asarray(np.linalg.inv(np.vander(np.arange(degree + 1))), dtype=np.float64)


def _lift(gap: Curve, base: Curve, a: float, b: float) -> Lift:
    """The ruled surface from the base's row in the direction of the ridge's.

    The direction is a smooth curve of unit vectors: the row itself is no border of the surface, which would
    shrink to points at both feet, but a curve on it.
    """
    inner = np.unique(gap.knots)
    breaks = np.concatenate([[a], inner[(inner > a) & (inner < b)], [b]])
    knots, fine = clamped_knots(breaks, 3), clamped_knots(_halved(breaks, 4), 3)
    t, sites, rough = _halved(fine[3:-3], 3), greville(fine, 3), greville(knots, 3)
    at_first, then, last = slice(len(t)), slice(len(t), len(t) + len(sites)), slice(-len(rough), None)
    places = np.concatenate([t, sites, rough])
    points = Places.at(base.knots, base.degree, places)(np.hstack([base.poles, gap.poles]))
    low, feet, apart, gaps = points[at_first, :3], points[last, :3], points[at_first, 3:], points[then, 3:]
    basis = basis_matrix(knots, 3, places)
    at_t, at_sites, at_rough = basis[at_first], basis[then], basis[last]
    mean = apart[np.argmax((apart**2).sum(axis=1))]
    size = np.linalg.norm(apart, axis=1, keepdims=True) * np.sign(apart @ mean)[:, None]
    up = np.linalg.lstsq(at_t * size, apart, rcond=1e-9)[0]
    foot = solved(at_rough, feet)
    reach = np.array([min(0.0, 1.25 * size.min()), max(0.0, 1.25 * size.max())])
    along = at_sites @ up
    heights = (gaps * along).sum(1, keepdims=True) / (along**2).sum(1, keepdims=True)
    basis = basis_matrix(fine, 3, places[: then.stop])
    rise = Curve(solved(basis[then], heights), fine, 3)
    off = np.linalg.norm((at_t @ up) * (basis[at_first] @ rise.poles) - apart, axis=1).max()
    off = max(float(off), float(np.linalg.norm(low - at_t @ foot, axis=1).max()))
    return Lift((a, b), knots, foot, up, reach, rise, off)


def _halved(breaks: Floats, parts: int) -> Floats:
    at = np.arange(parts * (len(breaks) - 1) + 1) / parts
    return np.interp(at, np.arange(len(breaks)), breaks)
