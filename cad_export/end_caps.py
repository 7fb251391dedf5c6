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

    span: parameters across. The surface's u is the row's parameter, its v the distance along `up`; the base's
    row is at v = 0 and the ridge's at v = rise(u), to within `distance`.
    """

    span: tuple[float, float]
    surface: Surface
    rise: Curve
    distance: float


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
    poles = foot[:, None] + reach[:, None] * up[:, None]
    surface = Surface(poles, knots, np.array([reach[0], reach[0], reach[1], reach[1]]), 3, 1)
    sites = greville(fine, 3)
    at = row(sites) - base(sites)
    along = basis_matrix(knots, 3, sites) @ up
    rise = Curve(interpolate(fine, 3, (at * along).sum(1) / (along**2).sum(1))[:, None], fine, 3)
    off = np.linalg.norm((basis @ up) * rise(t) - gap, axis=1).max()
    off = max(float(off), float(np.linalg.norm(base(t) - basis @ foot, axis=1).max()))
    return Lift((a, b), surface, rise, off)


def _halved(breaks: Floats, parts: int) -> Floats:
    at = np.arange(parts * (len(breaks) - 1) + 1) / parts
    return np.interp(at, np.arange(len(breaks)), breaks)


def _caps_flux(surface: Surface, base: Surface) -> float:
    """The caps' part in the volume: ruled faces from the base's end rows to the ridge's."""
    if surface.closed[0]:
        return 0.0
    up = np.array([0.0, 0.0, 1.0, 1.0])
    ends = (
        Surface(np.stack([base.poles[k], surface.poles[k]], axis=1), base.knots_v, up, base.degree_v, 1)
        for k in (0, -1)
    )
    first, last = (end.flux() for end in ends)
    return last - first


def volume_between(surface: Surface, base: Surface) -> float:
    """Volume from the base up to the surface, caps included, below 0 for a groove: exact by Gauss-Legendre.

    As the difference of both surfaces' flux, worked out on one set of nodes (divergence theorem). Raises
    ValueError where the surface turns over above its base: where their normals point to opposite sides.
    """
    (u, wu), (v, wv) = (
        _gauss(k, d) for k, d in ((base.knots_u, base.degree_u), (base.knots_v, base.degree_v))
    )
    along = [basis_matrix(base.knots_u, base.degree_u, u, k) for k in (0, 1)]
    across = [basis_matrix(base.knots_v, base.degree_v, v, k) for k in (0, 1)]
    centre = base.poles.mean(axis=(0, 1))  # near by, so that digits are not lost in the difference
    poles = np.stack([surface.poles, base.poles]) - centre
    rows = [np.matmul(a, poles.reshape(2, len(poles[0]), -1)).reshape(2, len(u), -1, 3) for a in along]
    point, du, dv = (np.matmul(across[k], rows[i]) for i, k in ((0, 0), (1, 0), (0, 1)))
    normal = np.cross(du, dv)
    if not ((normal[0] * normal[1]).sum(axis=-1) > 0).all():
        raise ValueError(
            "surface: expected one that does not fold over itself, it does; use a lower height or "
            "a path with wider bends"
        )
    flux = np.einsum("smk,m,k->s", (point * normal).sum(axis=-1), wu, wv) / 3
    moved = replace(surface, poles=poles[0]), replace(base, poles=poles[1])
    return float(flux[0] - flux[1]) + _caps_flux(*moved)


def _gauss(knots: Floats, degree: int) -> tuple[Floats, Floats]:
    """Nodes and weights, exact for the products of three splines of the degree."""
    x, w = np.polynomial.legendre.leggauss((3 * degree + 1) // 2)
    breaks = np.unique(knots)
    half = 0.5 * np.diff(breaks)[:, None]
    return (breaks[:-1, None] + half * (1.0 + x)).ravel(), (half * w).ravel()
