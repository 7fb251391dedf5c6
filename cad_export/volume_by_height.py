"""The volume under a ridge as a cubic in its height, and the heights at which it folds. Without OCCT."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from ridgefeature.basis import local_basis
from ridgefeature.bspline import Surface

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class VolumeByHeight:
    """A base and a surface over it of the same knots, and all heights h: base + h (surface - base).

    What the surface sweeps as h grows: its rise times its normal, a square in h. Exact by Gauss-Legendre.
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
    def _coefficients(self) -> tuple[float, ...]:
        return self._worked_out[0]

    @cached_property
    def _worked_out(self) -> tuple[tuple[float, ...], tuple[float, float]]:
        base, rise = self.base, self.surface.poles - self.base.poles
        u, v = _nodes(base.knots_u.tobytes(), base.degree_u), _nodes(base.knots_v.tobytes(), base.degree_v)
        swept, limits = np.zeros(3), [(-np.inf, np.inf)]
        # span by span across, where the rise is not 0: else it adds nothing, and arrays fit the cache
        raised = np.abs(rise).max(axis=0).max(axis=1) > 0  # axis by axis ten times as fast
        spans = np.flatnonzero(raised[v.near].any(axis=1))
        first, last = (v.near[spans[0], 0], v.near[spans[-1], -1]) if spans.size else (0, 0)
        poles = np.stack([base.poles, rise], axis=1)[:, :, first : last + 1].swapaxes(2, 3)
        along = u.values(poles)  # (value or rate, base or rise, 3, v's poles, u's nodes)
        weighed = along[0, 1] * u.weights.ravel()
        for k in spans:
            near = slice(v.near[k, 0] - first, v.near[k, -1] + 1 - first)
            value, rate = v.basis[0][k], v.basis[1][k]
            d = v.weights[k][:, None] * value @ weighed[:, near]  # (3, v's nodes, u's nodes), as what follows
            normals = _crosses(value @ along[1, :, :, near], rate @ along[0, :, :, near])
            normals[0, 1] += normals[1, 0]
            by_power = normals[0, 0], normals[0, 1], normals[1, 1]  # of h
            swept += [np.vdot(d, n) for n in by_power]
            limits.append(_limits(*(np.einsum("kvu,kvu->vu", normals[0, 0], n) for n in by_power)))
        lows, highs = zip(*limits, strict=True)
        return tuple((swept / (1, 2, 3)).tolist()), (float(max(lows)), float(min(highs)))


def volume_between(surface: Surface, base: Surface) -> float:
    """Volume from the base up to the surface; ValueError where the surface folds over its base."""
    found = VolumeByHeight(surface, base)
    found.check(1.0)
    return found.at(1.0)


def _limits(a: Floats, b: Floats, c: Floats) -> tuple[float, float]:
    """Between which h around 0 a + b h + c h^2 stays above 0, everywhere."""
    if not a.min() > 0:
        return 0.0, 0.0
    # The roots as 1 / h, so that none is lost where c is nearly 0: a x^2 + b x + c = 0.
    half = 0.5 * b
    with np.errstate(invalid="ignore"):
        root = np.sqrt(half * half - a * c)  # NaN without any: neither highest nor lowest
    highest, lowest = (float(np.fmax.reduce(x / a, axis=None)) for x in (root - half, root + half))
    return (-1 / lowest if lowest > 0 else -np.inf), (1 / highest if highest > 0 else np.inf)


def _advice(low: float, high: float) -> str:
    if low == high:
        return "use a path with wider bends"
    bounds = [f"{word} {h:.3g}" for word, h in (("above", low), ("below", high)) if abs(h) < 100]
    stay = f"stay {' and '.join(bounds)}, or " if bounds else ""
    return f"{stay}use a path with wider bends"


@dataclass(frozen=True, eq=False)
class _Nodes:
    """Gauss-Legendre nodes in every span of a clamped spline, exact for products of three such splines.

    near: the poles that bear on a span (k, degree + 1); basis: of values and derivatives, (k, n, degree + 1);
    weights (k, n).
    """

    near: NDArray[np.intp]
    basis: tuple[Floats, Floats]
    weights: Floats

    def values(self, poles: Floats) -> Floats:
        """Values and derivatives (2, ..., all nodes) of splines with the poles (n, ...)."""
        near = poles.reshape(len(poles), -1)[self.near].swapaxes(1, 2)
        made = np.empty((2, near.shape[1], *self.weights.shape))
        for out, basis in zip(made, self.basis, strict=True):
            np.matmul(near, basis.swapaxes(1, 2), out=out.swapaxes(0, 1))  # nodes last, without a copy
        return made.reshape(2, *poles.shape[1:], -1)


@lru_cache(16)
def _nodes(knots: bytes, degree: int) -> _Nodes:
    """The nodes for these knots; other widths and heights have the same."""
    x, w = np.polynomial.legendre.leggauss((3 * degree + 1) // 2)
    t = np.frombuffer(knots)
    breaks = np.unique(t)
    half = 0.5 * np.diff(breaks)[:, None]
    nodes = (breaks[:-1, None] + half * (1.0 + x)).ravel()
    found = [local_basis(t, degree, nodes, k) for k in (0, 1)]
    value, rate = (basis.reshape(len(half), len(x), degree + 1) for _, basis in found)
    return _Nodes(found[0][0][:: len(x), None] + np.arange(degree + 1), (value, rate), half * w)


def _crosses(a: Floats, b: Floats) -> Floats:
    """Vector products of all a (n, 3, ...) with all b (m, 3, ...): (n, m, 3, ...)."""
    made = np.empty((len(a), *b.shape))
    for k, i, j in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[:, None, i], b[:, j], out=made[:, :, k])
        made[:, :, k] -= a[:, None, j] * b[:, i]
    return made
