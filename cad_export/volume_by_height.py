"""The volume under a ridge as a cubic in its height, and the heights at which it folds. Without OCCT."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ridgefeature.basis import basis_matrix
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
        (u, wu), (v, wv) = _gauss(base.knots_u, base.degree_u), _gauss(base.knots_v, base.degree_v)
        along = [basis_matrix(base.knots_u, base.degree_u, u, k) for k in (0, 1)]
        across = [basis_matrix(base.knots_v, base.degree_v, v, k).T for k in (0, 1)]
        poles = np.stack([base.poles - centre, self.surface.poles - base.poles])
        # Coordinates first, (2, 3, m, k): whole arrays lie together, which the products below are faster on.
        columns = [np.ascontiguousarray(np.moveaxis(poles, 3, 1)) @ b for b in across]
        (f, d), (fu, du), (fv, dv) = (along[i] @ columns[k] for i, k in ((0, 0), (1, 0), (0, 1)))
        normals = _cross(fu, fv), _cross(fu, dv) + _cross(du, fv), _cross(du, dv)
        flux = [[float(wu @ _dot(p, n) @ wv) / 3 for n in normals] for p in (f, d)]
        caps = _caps_flux(base, poles, 1.0), _caps_flux(base, poles, -1.0)
        volumes = (
            flux[0][1] + flux[1][0] + 0.5 * (caps[0] - caps[1]),
            flux[0][2] + flux[1][1] + 0.5 * (caps[0] + caps[1]),
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
    bounds = [f"{word} {h:.3g}" for word, h in (("above", low), ("below", high)) if np.isfinite(h)]
    return f"stay {' and '.join(bounds)}, or use a path with wider bends"


def _caps_flux(base: Surface, poles: Floats, h: float) -> float:
    """The caps' part at height h: ruled faces from the base's end rows to the ridge's."""
    if base.closed[0]:
        return 0.0
    up = np.array([0.0, 0.0, 1.0, 1.0])
    first, last = (
        Surface(
            np.stack([poles[0, k], poles[0, k] + h * poles[1, k]], axis=1), base.knots_v, up, base.degree_v, 1
        ).flux()
        for k in (0, -1)
    )
    return last - first


def _gauss(knots: Floats, degree: int) -> tuple[Floats, Floats]:
    """Nodes and weights, exact for the products of three splines of the degree."""
    x, w = np.polynomial.legendre.leggauss((3 * degree + 1) // 2)
    breaks = np.unique(knots)
    half = 0.5 * np.diff(breaks)[:, None]
    return (breaks[:-1, None] + half * (1.0 + x)).ravel(), (half * w).ravel()


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross product of coordinates (3, ...)."""
    (ax, ay, az), (bx, by, bz) = a, b
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
