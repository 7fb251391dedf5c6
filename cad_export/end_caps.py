"""Where the end rows of an open ridge leave the base, and the faces that close it there. OCP only."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.basis import basis_matrix, interpolate
from ridgefeature.bspline import Curve, Surface, clamped_knots, greville

Floats = NDArray[np.float64]


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
    breaks = np.unique(gap.knots[some[0] : some[-1] + gap.degree + 2])
    v = _halved(breaks, 32)
    g = gap(v)
    square = (g**2).sum(axis=1)
    sign = np.where(square > least**2, np.sign(g @ g[np.argmax(square)]), 0.0)
    changes = np.flatnonzero(np.diff(sign))
    starts, ends = (changes[sign[changes + k] != 0] for k in (1, 0))
    ends = ends[ends > starts[0]] if starts.size else starts
    starts = starts[: len(ends)]
    off, on = v[np.concatenate([starts, ends + 1])], v[np.concatenate([starts + 1, ends])]
    return [(a, b) for a, b in _edges(gap, least, off, on).reshape(2, -1).T.tolist()]


def _edges(gap: Curve, least: float, off: Floats, on: Floats) -> Floats:
    """Where the gap reaches `least`: between parameters (m,) where it is smaller and where it is larger."""
    for _ in range(4):
        t = np.linspace(off, on, 33)
        first = np.argmax((gap(t) ** 2).sum(axis=-1) >= least**2, axis=0)
        row = np.arange(len(off))
        off, on = t[np.maximum(first - 1, 0), row], t[first, row]
    return on


def _lift(gap: Curve, base: Curve, a: float, b: float) -> Lift:
    """The ruled surface from the base's row in the direction of the ridge's.

    The direction is a smooth curve of unit vectors: the row itself is no border of the surface, which would
    shrink to points at both feet, but a curve on it.
    """
    inner = np.unique(gap.knots)
    inner = inner[(inner > a) & (inner < b)]
    knots = clamped_knots(np.concatenate([[a], inner, [b]]), 3)
    fine = clamped_knots(_halved(np.concatenate([[a], inner, [b]]), 4), 3)
    t = _halved(fine[3:-3], 3)
    both = Curve(np.hstack([base.poles, gap.poles]), base.knots, base.degree)
    low, apart = np.split(both(t), 2, axis=1)
    mean = apart[np.argmax((apart**2).sum(axis=1))]
    size = np.linalg.norm(apart, axis=1, keepdims=True) * np.sign(apart @ mean)[:, None]
    basis = basis_matrix(knots, 3, t)
    up = np.linalg.lstsq(basis * size, apart, rcond=1e-9)[0]
    foot = interpolate(knots, 3, base(greville(knots, 3)))
    reach = np.array([min(0.0, 1.25 * size.min()), max(0.0, 1.25 * size.max())])
    sites = greville(fine, 3)
    along = basis_matrix(knots, 3, sites) @ up
    rise = Curve(interpolate(fine, 3, (gap(sites) * along).sum(1) / (along**2).sum(1))[:, None], fine, 3)
    off = np.linalg.norm((basis @ up) * rise(t) - apart, axis=1).max()
    off = max(float(off), float(np.linalg.norm(low - basis @ foot, axis=1).max()))
    return Lift((a, b), knots, foot, up, reach, rise, off)


def _halved(breaks: Floats, parts: int) -> Floats:
    at = np.arange(parts * (len(breaks) - 1) + 1) / parts
    return np.interp(at, np.arange(len(breaks)), breaks)
