"""The volume under a ridge as a cubic in its height, and the heights at which it folds. Without OCCT."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ridgefeature.basis import local_basis
from ridgefeature.bspline import Surface

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class VolumeByHeight:
    """A base and a surface over it of the same knots, and all heights h: base + h (surface - base).

    Exact by Gauss-Legendre, as a surface's flux (divergence theorem) is a cubic in h.
    """

    surface: Surface
    base: Surface

    def at(self, h: float) -> float:
        """Volume from the base up to height h, caps at open ends included, below 0 for a groove."""
        first, second, third = self._coefficients
        return float(h * (first + h * (second + h * third)))

    def check(self, h: float) -> None:
        """Raise ValueError where the surface at h turns over above its base: their normals are opposed."""
        low, high = self.limits
        if not low < h < high:
            raise ValueError(
                f"surface: expected one that does not fold over itself, it does at {h:g} times its height; "
                f"{_advice(low, high)}"
            )

    @property
    def limits(self) -> tuple[float, float]:
        """The heights between which the surface does not turn over; equal where the base itself does."""
        return self._worked_out[1]

    @property
    def _coefficients(self) -> tuple[float, float, float]:
        return self._worked_out[0]

    @cached_property
    def _worked_out(self) -> tuple[tuple[float, float, float], tuple[float, float]]:
        base, centre = self.base, self.base.poles.mean(axis=(0, 1))  # near by, so that no digits are lost
        u, v = _Nodes.of(base.knots_u, base.degree_u), _Nodes.of(base.knots_v, base.degree_v)
        poles = np.stack([base.poles - centre, self.surface.poles - base.poles])
        rows = np.moveaxis(poles, 1, 0).reshape(poles.shape[1], -1)
        # (v's poles, 2, 3, u's nodes): each coordinate is a whole array in the products below
        along = [u.values(rows, k).reshape(-1, 2, poles.shape[2], 3).transpose(2, 1, 3, 0) for k in (0, 1)]
        columns = [np.ascontiguousarray(a).reshape(len(a), -1) for a in along]
        grids = (v.values(columns[i], k) for i, k in ((0, 0), (1, 0), (0, 1)))
        (f, d), (fu, du), (fv, dv) = (np.moveaxis(g.reshape(len(g), 2, 3, -1), 0, 2) for g in grids)
        normals = _cross(fu, fv), _cross(fu, dv) + _cross(du, fv), _cross(du, dv)
        flux = [[float(v.weights @ _dot(p, n) @ u.weights) / 3 for n in normals] for p in (f, d)]
        caps = [0.0, 0.0] if base.closed[0] else _caps(poles, v)
        volumes = (
            flux[0][1] + flux[1][0] + caps[0],
            flux[0][2] + flux[1][1] + caps[1],
            flux[1][2],
        )
        return volumes, _limits(*(_dot(n, normals[0]) for n in normals))


def volume_between(surface: Surface, base: Surface) -> float:
    """Volume from the base up to the surface; ValueError where the surface folds over its base."""
    found = VolumeByHeight(surface, base)
    found.check(1.0)
    return found.at(1.0)


def _limits(a: Floats, b: Floats, c: Floats) -> tuple[float, float]:
    """Between which h around 0 a + b h + c h^2 stays above 0, everywhere."""
    if not (a > 0).all():
        return 0.0, 0.0
    # The roots as 1 / h, so that none is lost where c is nearly 0: a x^2 + b x + c = 0.
    square = b * b - 4 * a * c
    some = square >= 0
    if not some.any():
        return -np.inf, np.inf
    root, half = np.sqrt(square[some]), -b[some]
    highest, lowest = ((half + root) / (2 * a[some])).max(), ((half - root) / (2 * a[some])).min()
    return (1 / lowest if lowest < 0 else -np.inf), (1 / highest if highest > 0 else np.inf)


def _advice(low: float, high: float) -> str:
    if low == high:
        return "use a path with wider bends"
    bounds = [f"{word} {h:.3g}" for word, h in (("above", low), ("below", high)) if abs(h) < 100]
    stay = f"stay {' and '.join(bounds)}, or " if bounds else ""
    return f"{stay}use a path with wider bends"


def _caps(poles: Floats, v: _Nodes) -> list[float]:
    """The caps' part in the volume, of h and of h^2: ruled faces from the base's end rows to the ridge's."""
    rows = poles[:, [0, -1]].transpose(2, 1, 0, 3)  # (v's poles, end, base or rise, 3)
    flat = rows.reshape(len(rows), -1)
    values, rates = (np.moveaxis(v.values(flat, k).reshape(-1, 2, 2, 3), 0, 3) for k in (0, 1))
    parts = [0.0, 0.0]
    for end, sign in enumerate((-1, 1)):
        (f, d), (df, dd) = (x[end] for x in (values, rates))
        parts[0] += sign * float(v.weights @ _dot(f, _cross(df, d))) / 3
        parts[1] += sign * float(v.weights @ _dot(f, _cross(dd, d))) / 6
    return parts


@dataclass(frozen=True, eq=False)
class _Nodes:
    """Gauss-Legendre nodes in every span of a clamped spline, exact for products of three such splines.

    first: the first pole that bears on a span (k,); basis: of values and derivatives, (k, n, degree + 1).
    """

    first: NDArray[np.intp]
    basis: tuple[Floats, Floats]
    weights: Floats

    @staticmethod
    def of(knots: Floats, degree: int) -> _Nodes:
        x, w = np.polynomial.legendre.leggauss((3 * degree + 1) // 2)
        breaks = np.unique(knots)
        half = 0.5 * np.diff(breaks)[:, None]
        nodes = (breaks[:-1, None] + half * (1.0 + x)).ravel()
        found = [local_basis(knots, degree, nodes, k) for k in (0, 1)]
        shape = len(half), len(x), degree + 1
        value, rate = (basis.reshape(shape) for _, basis in found)
        return _Nodes(found[0][0][:: len(x)], (value, rate), (half * w).ravel())

    def values(self, poles: Floats, derivative: int = 0) -> Floats:
        """Values (all nodes, m) of splines with the poles (n, m)."""
        basis = self.basis[derivative]
        near = poles[self.first[:, None] + np.arange(basis.shape[2])]
        return np.matmul(basis, near).reshape(-1, poles.shape[1])


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross product of coordinates (3, ...)."""
    (ax, ay, az), (bx, by, bz) = a, b
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
