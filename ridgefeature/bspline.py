"""Non-rational B-spline curves and tensor-product surfaces: the exact geometry every export takes over.

Source: Piegl and Tiller, The NURBS Book, chapters 3 and 6; arc length by Gauss-Legendre a knot span.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ridgefeature.basis import (
    Floats,
    Places,
    basis_matrix,
    checked_knots,
    clamped_knots,
    greville,
    interpolate,
    local_basis,
)

__all__ = ["Curve", "Surface", "basis_matrix", "clamped_knots", "greville", "interpolate"]

_NODES, _WEIGHTS = (
    0.5 * (x + o) for x, o in zip(np.polynomial.legendre.leggauss(16), (1.0, 0.0), strict=True)
)


@dataclass(frozen=True, eq=False)
class Curve:
    """B-spline curve: poles (n, d), knots (n + degree + 1,) repeats written out. Arrays are read-only."""

    poles: Floats
    knots: Floats
    degree: int

    def __post_init__(self) -> None:
        poles = _checked_poles(self.poles, 2, "(n, d)")
        object.__setattr__(self, "poles", poles)
        object.__setattr__(self, "knots", checked_knots(self.knots, self.degree, poles.shape[0])[0])

    @property
    def domain(self) -> tuple[float, float]:
        """The parameters at both ends."""
        return _domain(self.knots, self.degree)

    def __call__(self, t: ArrayLike, derivative: int = 0) -> Floats:
        """Points, or derivatives of the given order, (..., d) at parameters t (...); NaN in, NaN out.

        Raises ValueError for parameters outside the domain.
        """
        at = np.asarray(t, dtype=np.float64)
        places = Places.at(self.knots, self.degree, at.ravel(), derivative)
        return places(self.poles).reshape(*at.shape, self.poles.shape[1])

    def arc_length(self, t0: ArrayLike | None = None, t1: ArrayLike | None = None) -> Any:
        """Arc length from t0 to t1 (broadcast; negative backwards), by default of the whole curve."""
        start, end = self.domain
        return self._length_to(end if t1 is None else t1) - self._length_to(start if t0 is None else t0)

    def at_arc_length(self, s: ArrayLike) -> Any:
        """Parameters (...) at arc lengths s (...) from the start: Newton steps, bisection where they leave.

        Raises ValueError for s below 0 or beyond the curve's length; NaN in, NaN out.
        """
        breaks, lengths = self._length_table
        total = lengths[-1]
        wanted = np.asarray(s, dtype=np.float64)
        if np.any((wanted < -1e-9 * total) | (wanted > total * (1 + 1e-9))):
            raise ValueError(
                f"expected arc lengths from 0 to {total:g}, got {np.nanmin(wanted):g} to "
                f"{np.nanmax(wanted):g}; stay within the curve"
            )
        nan = np.isnan(wanted)
        goal = np.where(nan, 0.0, np.clip(wanted, 0.0, total)).ravel()
        span = np.clip(np.searchsorted(lengths, goal, side="right") - 1, 0, breaks.size - 2)
        low, high = breaks[span], breaks[span + 1]
        width = lengths[span + 1] - lengths[span]
        t = low + (high - low) * (goal - lengths[span]) / np.where(width > 0, width, 1.0)
        for _ in range(60):
            excess = self._length_to(t) - goal
            low, high = np.where(excess <= 0, t, low), np.where(excess >= 0, t, high)
            if np.all(np.abs(excess) <= 1e-14 * total):
                break
            speed = np.linalg.norm(self(t, 1), axis=-1)
            newton = t - excess / np.where(speed > 0, speed, np.inf)
            t = np.where((newton > low) & (newton < high), newton, 0.5 * (low + high))
        return np.where(nan, np.nan, t.reshape(wanted.shape))[()]

    @cached_property
    def _length_table(self) -> tuple[Floats, Floats]:
        start, end = self.domain
        spans = np.unique(self.knots[(self.knots >= start) & (self.knots <= end)])
        inner = (
            spans[:-1, None] + np.diff(spans)[:, None] * np.arange(4) / 4
        )  # quarters: speed may dip within
        breaks = np.append(inner.ravel(), end)
        spans = self._gauss_length(breaks[:-1], breaks[1:])
        return breaks, np.concatenate([[0.0], np.cumsum(spans)])

    def _length_to(self, t: ArrayLike) -> Any:
        breaks, lengths = self._length_table
        at = np.asarray(t, dtype=np.float64)
        span = np.clip(np.searchsorted(breaks, at, side="right") - 1, 0, breaks.size - 2)
        return lengths[span] + self._gauss_length(breaks[span], at)

    def _gauss_length(self, a: Floats, b: Floats) -> Any:
        """Arc length from a to b, both within one quarter of a knot span."""
        speed = np.linalg.norm(self(a[..., None] + (b - a)[..., None] * _NODES, 1), axis=-1)
        return (b - a) * (speed @ _WEIGHTS)


@dataclass(frozen=True, eq=False)
class Surface:
    """Tensor-product B-spline surface in the frame and unit of its poles. Arrays are read-only.

    poles (nu, nv, 3); knots_u (nu + degree_u + 1,) and knots_v likewise, repeats written out.
    Its positive side is that of the normal du x dv.
    """

    poles: Floats
    knots_u: Floats
    knots_v: Floats
    degree_u: int
    degree_v: int

    def __post_init__(self) -> None:
        poles = _checked_poles(self.poles, 3, "(nu, nv, 3)")
        if poles.shape[2] != 3:
            raise ValueError(f"expected poles of shape (nu, nv, 3), got {poles.shape}; pass points in space")
        object.__setattr__(self, "poles", poles)
        object.__setattr__(self, "knots_u", checked_knots(self.knots_u, self.degree_u, poles.shape[0])[0])
        object.__setattr__(self, "knots_v", checked_knots(self.knots_v, self.degree_v, poles.shape[1])[0])

    @property
    def domain(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((u0, u1), (v0, v1))."""
        return _domain(self.knots_u, self.degree_u), _domain(self.knots_v, self.degree_v)

    @cached_property
    def size(self) -> float:
        """Largest extent of the poles along an axis."""
        rows = np.ascontiguousarray(self.poles.reshape(-1, 3).T)  # as stored, 20 times as slow
        return float(np.ptp(rows, axis=1).max())

    @cached_property
    def closed(self) -> tuple[bool, bool]:
        """Whether the surface ends where it starts, along u and along v."""
        p, near = self.poles, 1e-9 * self.size
        return bool(np.abs(p[0] - p[-1]).max() <= near), bool(np.abs(p[:, 0] - p[:, -1]).max() <= near)

    def __call__(self, u: ArrayLike, v: ArrayLike) -> Floats:
        """Points (..., 3) at parameters u and v, broadcast against each other; NaN in, NaN out.

        Raises ValueError for parameters outside the domain.
        """
        return self._partials(u, v, ((0, 0),))[0]

    def derivatives(self, u: ArrayLike, v: ArrayLike, order: int = 1) -> tuple[Floats, ...]:
        """Partial derivatives (..., 3): (du, dv), and with order=2 (du, dv, duu, duv, dvv)."""
        if order not in (1, 2):
            raise ValueError(f"expected order 1 or 2, got {order!r}")
        orders = ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
        return self._partials(u, v, orders[: 2 if order == 1 else 5])

    def normal(self, u: ArrayLike, v: ArrayLike) -> Floats:
        """Unit normals (..., 3), along du x dv; NaN where that vanishes."""
        du, dv = self.derivatives(u, v)
        cross = np.cross(du, dv)
        length = np.linalg.norm(cross, axis=-1, keepdims=True)
        return cross / np.where(length > 0, length, np.nan)

    def on_grid(self, u: ArrayLike, v: ArrayLike, derivative: tuple[int, int] = (0, 0)) -> Floats:
        """Points, or a partial derivative, (m, k, 3) at all pairs of u (m,) and v (k,)."""
        along = basis_matrix(self.knots_u, self.degree_u, u, derivative[0])
        across = basis_matrix(self.knots_v, self.degree_v, v, derivative[1])
        return np.einsum("mi,kj,ijd->mkd", along, across, self.poles, optimize=True)

    def grid(self, nu: int, nv: int) -> Floats:
        """Points (nu, nv, 3) at evenly spaced parameters, borders included; nu and nv at least 2."""
        if nu < 2 or nv < 2:
            raise ValueError(f"expected at least 2 x 2 samples, got {nu} x {nv}")
        (u0, u1), (v0, v1) = self.domain
        return self.on_grid(np.linspace(u0, u1, nu), np.linspace(v0, v1, nv))

    def flux(self) -> float:
        """One third of the integral of S . (du x dv) over the domain: exact by Gauss-Legendre a span.

        Over surfaces that enclose a solid, normals outwards, the values add up to its volume (divergence
        theorem).
        """
        u, wu = _gauss(self.knots_u, self.degree_u)
        v, wv = _gauss(self.knots_v, self.degree_v)
        cross = np.cross(self.on_grid(u, v, (1, 0)), self.on_grid(u, v, (0, 1)))
        total = np.einsum("mkd,mkd,m,k->", self.on_grid(u, v), cross, wu, wv, optimize=True)
        return float(total) / 3.0

    def project(
        self, points: ArrayLike, start: tuple[ArrayLike, ArrayLike] | None = None
    ) -> tuple[Floats, Floats, Floats]:
        """Foot points of points (..., 3): u, v and signed distance, each (...); NaN where there is none.

        Newton steps from the nearest sample of the surface, or from start = (u, v). The distance is
        positive on the side of du x dv. There is no foot point where the nearest point lies on the border
        and the residual is not along the normal; a surface that closes on itself has no border there.
        Of several foot points it is the nearest up to the samples' spacing, a third of a knot span.
        Raises ValueError for a wrong shape or a start outside the domain.
        """
        from ridgefeature.kernels import spline  # compiled code only where it is used

        p = np.asarray(points, dtype=np.float64)
        if p.ndim == 0 or p.shape[-1] != 3:
            raise ValueError(
                f"expected points of shape (..., 3), got {p.shape}; pass x, y, z in the last axis"
            )
        shape = p.shape[:-1]
        u, v = (np.broadcast_to(np.nan, shape), np.broadcast_to(np.nan, shape)) if start is None else start
        for t, (low, high), name in zip((u, v), self.domain, "uv", strict=True):
            if np.any((np.asarray(t) < low) | (np.asarray(t) > high)):
                raise ValueError(
                    f"expected a start with {name} from {low:g} to {high:g}; clip it to the domain"
                )
        starts = [np.array(np.broadcast_to(t, shape), dtype=np.float64).ravel() for t in (u, v)]
        centre, size, samples = self._samples
        exact = (self.poles - centre, self.knots_u, self.knots_v, self.degree_u, self.degree_v)
        local = np.ascontiguousarray(p.reshape(-1, 3) - centre)
        found = spline.project(local, exact, self.closed, *starts, samples, 1e-8 * size)
        return found[:, 0].reshape(shape), found[:, 1].reshape(shape), found[:, 2].reshape(shape)

    @cached_property
    def _samples(self) -> tuple[Floats, float, tuple[Floats, ...]]:
        """Centre and size; blocks of samples about the centre, their u and v, spheres around them."""
        low, high = self.poles.min(axis=(0, 1)), self.poles.max(axis=(0, 1))
        centre = 0.5 * (low + high)
        u, v = _sites(self.knots_u, self.degree_u), _sites(self.knots_v, self.degree_v)
        at = np.stack(np.broadcast_arrays(u[:, None, :, None], v[None, :, None, :]), axis=-1)
        at = at.reshape(u.shape[0] * v.shape[0], -1, 2)
        points = self(at[..., 0], at[..., 1]) - centre
        middles = 0.5 * (points.min(axis=1) + points.max(axis=1))
        radii = np.linalg.norm(points - middles[:, None], axis=-1).max(axis=1)
        blocks = (points, at[..., 0].copy(), at[..., 1].copy(), middles, radii)
        return centre, float(np.linalg.norm(high - low)), blocks

    def _partials(self, u: ArrayLike, v: ArrayLike, orders: Sequence[tuple[int, int]]) -> tuple[Floats, ...]:
        uu, vv = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
        wide, high = uu.ravel(), vv.ravel()
        along = {k: local_basis(self.knots_u, self.degree_u, wide, k) for k in {a for a, _ in orders}}
        across = {k: local_basis(self.knots_v, self.degree_v, high, k) for k in {b for _, b in orders}}
        i = next(iter(along.values()))[0][:, None, None] + np.arange(self.degree_u + 1)[:, None]
        j = next(iter(across.values()))[0][:, None, None] + np.arange(self.degree_v + 1)
        near = self.poles[i, j]
        return tuple(
            np.einsum("mi,mij,mijd->md", along[a][1], across[b][1][:, None, :], near).reshape(*uu.shape, 3)
            for a, b in orders
        )


def _gauss(knots: Floats, degree: int) -> tuple[Floats, Floats]:
    """Nodes and weights that integrate polynomials of degree 3 degree - 1 exactly, over all spans."""
    x, w = np.polynomial.legendre.leggauss((3 * degree + 1) // 2)
    start, end = _domain(knots, degree)
    breaks = np.unique(knots[(knots >= start) & (knots <= end)])
    half = 0.5 * np.diff(breaks)[:, None]
    return (breaks[:-1, None] + half * (1.0 + x)).ravel(), (half * w).ravel()


def _sites(knots: Floats, degree: int, block: int = 5) -> Floats:
    """Start values for foot points (m, block): a few parameters in every span, both ends included."""
    start, end = _domain(knots, degree)
    breaks = np.unique(knots[(knots >= start) & (knots <= end)])
    each = max(degree, -(-12 // (breaks.size - 1)))
    inner = breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(each) / each
    padding = np.full(block - inner.size % block, end)
    return np.concatenate([inner.ravel(), padding]).reshape(-1, block)


def _domain(knots: Floats, degree: int) -> tuple[float, float]:
    return float(knots[degree]), float(knots[knots.size - degree - 1])


def _checked_poles(poles: ArrayLike, ndim: int, shape: str) -> Floats:
    p: NDArray[np.float64] = np.array(poles, dtype=np.float64)
    if p.ndim != ndim or p.size == 0:
        raise ValueError(f"expected poles of shape {shape}, got {p.shape}; reshape them")
    if not np.all(np.isfinite(p)):
        raise ValueError(
            f"expected finite poles, got {np.count_nonzero(~np.isfinite(p))} that are not; drop them"
        )
    p.setflags(write=False)
    return p
