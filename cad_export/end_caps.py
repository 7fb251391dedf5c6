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
    return [_lift(row, base, a, b) for a, b in _stretches(row, base, least)]


def _stretches(row: Curve, base: Curve, least: float) -> list[tuple[float, float]]:
    gap = Curve(row.poles - base.poles, row.knots, row.degree)
    if np.abs(gap.poles).max() <= least:
        return []
    breaks = np.unique(row.knots)
    v = np.interp(np.arange(32 * (len(breaks) - 1) + 1) / 32, np.arange(len(breaks)), breaks)
    g = gap(v)
    side = g @ g[np.argmax((g**2).sum(axis=1))]
    sign = np.where((g**2).sum(axis=1) > least**2, np.sign(side), 0.0)
    changes = np.flatnonzero(np.diff(sign) != 0)
    ends = [(int(i), float(sign[i]), float(sign[i + 1])) for i in changes]
    found, start = [], None
    for i, before, after in ends:
        if before != 0 and start is not None:
            found.append((start, _edge(gap, least, v[i + 1], v[i])))
        if after != 0:
            start = _edge(gap, least, v[i], v[i + 1])
    return found


def _edge(gap: Curve, least: float, off: float, on: float) -> float:
    """Where the gap reaches `least` between a parameter where it is smaller and one where it is larger."""
    for _ in range(2):
        t = np.linspace(off, on, 1025)
        first = int(np.argmax(np.linalg.norm(gap(t), axis=1) >= least))
        off, on = float(t[max(first - 1, 0)]), float(t[first])
    return on


def _lift(row: Curve, base: Curve, a: float, b: float) -> Lift:
    """The ruled surface from the base's row in the direction of the ridge's.

    The direction is a smooth curve of unit vectors: the row itself is no border of the surface, which would
    shrink to points at both feet, but a curve on it.
    """
    inner = np.unique(row.knots)
    inner = inner[(inner > a) & (inner < b)]
    knots = clamped_knots(np.concatenate([[a], inner, [b]]), 3)
    fine = clamped_knots(_halved(np.concatenate([[a], inner, [b]]), 4), 3)
    t = _halved(fine[3:-3], 3)
    gap = row(t) - base(t)
    mean = gap[np.argmax((gap**2).sum(axis=1))]
    size = np.linalg.norm(gap, axis=1, keepdims=True) * np.sign(gap @ mean)[:, None]
    basis = basis_matrix(knots, 3, t)
    up = np.linalg.lstsq(basis * size, gap, rcond=1e-9)[0]
    foot = interpolate(knots, 3, base(greville(knots, 3)))
    reach = np.array([min(0.0, 1.25 * size.min()), max(0.0, 1.25 * size.max())])
    sites = greville(fine, 3)
    at = row(sites) - base(sites)
    along = basis_matrix(knots, 3, sites) @ up
    rise = Curve(interpolate(fine, 3, (at * along).sum(1) / (along**2).sum(1))[:, None], fine, 3)
    off = np.linalg.norm((basis @ up) * rise(t) - gap, axis=1).max()
    off = max(float(off), float(np.linalg.norm(base(t) - basis @ foot, axis=1).max()))
    return Lift((a, b), knots, foot, up, reach, rise, off)


def _halved(breaks: Floats, parts: int) -> Floats:
    at = np.arange(parts * (len(breaks) - 1) + 1) / parts
    return np.interp(at, np.arange(len(breaks)), breaks)
