"""Foot points on a tensor-product B-spline surface: projected Newton from the nearest sample."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import copy_into

Floats = NDArray[np.float64]
Spline = tuple[Floats, Floats, Floats, int, int]  # poles (nu, nv, 3), knots_u, knots_v, degree_u, degree_v


@njit(cache=True)
def _basis(knots: Floats, degree: int, n_poles: int, t: float, out: Floats) -> int:
    """Write values, first and second derivatives into out (3, degree + 1); return the first pole's index."""
    low, high = degree, n_poles  # knots[low] <= t <= knots[high]
    while high - low > 1:
        mid = (low + high) // 2
        if knots[mid] <= t and knots[mid] < knots[n_poles]:
            low = mid
        else:
            high = mid
    out[:, :] = 0.0
    out[0, 0] = 1.0
    for q in range(1, degree + 1):
        carry0 = carry1 = carry2 = 0.0
        for r in range(q):
            left = knots[low - q + 1 + r]
            right = knots[low + 1 + r]
            scale = 1.0 / (right - left)
            a, b = (right - t) * scale, (t - left) * scale
            n0, n1, n2 = out[0, r], out[1, r], out[2, r]
            out[0, r] = carry0 + a * n0
            out[1, r] = carry1 + a * n1 - scale * n0
            out[2, r] = carry2 + a * n2 - 2.0 * scale * n1
            carry0 = b * n0
            carry1 = b * n1 + scale * n0
            carry2 = b * n2 + 2.0 * scale * n1
        out[0, q], out[1, q], out[2, q] = carry0, carry1, carry2
    return low - degree


@njit(cache=True)
def _evaluate(surface: Spline, u: float, v: float, bu: Floats, bv: Floats, out: Floats) -> None:
    """Write S, Su, Sv, Suu, Suv, Svv into out (6, 3); bu (3, degree_u + 1) and bv are work space."""
    poles, knots_u, knots_v, degree_u, degree_v = surface
    iu = _basis(knots_u, degree_u, poles.shape[0], u, bu)
    iv = _basis(knots_v, degree_v, poles.shape[1], v, bv)
    out[:, :] = 0.0
    for i in range(degree_u + 1):
        b0, b1, b2 = bu[0, i], bu[1, i], bu[2, i]
        for c in range(3):
            s = sv = svv = 0.0
            for j in range(degree_v + 1):
                x = poles[iu + i, iv + j, c]
                s += bv[0, j] * x
                sv += bv[1, j] * x
                svv += bv[2, j] * x
            out[0, c] += b0 * s
            out[1, c] += b1 * s
            out[2, c] += b0 * sv
            out[3, c] += b2 * s
            out[4, c] += b1 * sv
            out[5, c] += b0 * svv


@njit(cache=True)
def _dot(a: Floats, b: Floats) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _nearest_sample(
    x: float, y: float, z: float, samples: Floats, centres: Floats, radii: Floats
) -> tuple[int, int]:
    """(i, j) of the nearest of samples (m, k, 3); a block whose bounding sphere is too far is skipped."""
    first, bound = 0, np.inf
    for i in range(samples.shape[0]):
        d2 = (x - centres[i, 0]) ** 2 + (y - centres[i, 1]) ** 2 + (z - centres[i, 2]) ** 2
        if d2 < bound:
            first, bound = i, d2
    best, bi, bj = np.inf, 0, 0
    reach = np.inf
    for step in range(-1, samples.shape[0]):
        i = first if step < 0 else step
        d2 = (x - centres[i, 0]) ** 2 + (y - centres[i, 1]) ** 2 + (z - centres[i, 2]) ** 2
        if d2 > (reach + radii[i]) ** 2 or step == first:
            continue
        nearest, at = np.inf, 0
        for j in range(samples.shape[1]):
            e = (x - samples[i, j, 0]) ** 2 + (y - samples[i, j, 1]) ** 2 + (z - samples[i, j, 2]) ** 2
            if e < nearest:
                nearest, at = e, j
        if nearest < best:
            best, bi, bj = nearest, i, at
            reach = np.sqrt(best)
    return bi, bj


@njit(cache=True)
def _direction(d: Floats, r: Floats, free_u: bool, free_v: bool) -> tuple[float, float]:
    """Newton step (du, dv) of half the squared distance; Gauss-Newton where the Hessian is not positive."""
    gu, gv = -_dot(d[1], r), -_dot(d[2], r)
    euu, euv, evv = _dot(d[1], d[1]), _dot(d[1], d[2]), _dot(d[2], d[2])
    for attempt in range(2):
        bend = 1.0 - attempt
        huu = euu - bend * _dot(d[3], r)
        huv = euv - bend * _dot(d[4], r)
        hvv = evv - bend * _dot(d[5], r)
        if not free_u or not free_v:
            huv = 0.0
        fine_u = (not free_u) or huu > 1e-9 * euu
        fine_v = (not free_v) or hvv > 1e-9 * evv
        if fine_u and fine_v and (huv == 0.0 or huu * hvv - huv * huv > 1e-9 * huu * hvv):
            break
    if free_u and free_v:
        det = huu * hvv - huv * huv
        if det <= 1e-14 * huu * hvv:
            return (-gu / euu if euu > 0 else 0.0), (-gv / evv if evv > 0 else 0.0)
        return (huv * gv - hvv * gu) / det, (huv * gu - huu * gv) / det
    if free_u:
        return (-gu / huu if huu > 0 else 0.0), 0.0
    return 0.0, (-gv / hvv if free_v and hvv > 0 else 0.0)


@njit(cache=True)
def _into(t: float, low: float, high: float, closed: bool) -> float:
    """t clipped to [low, high], or wrapped once around a closed direction."""
    if closed and (t < low or t > high):
        t = t + (high - low) if t < low else t - (high - low)
    return min(max(t, low), high)


@njit(cache=True)
def _split(d: Floats, r: Floats) -> tuple[float, float]:
    """Length of r along the surface (0 at a foot point) and signed length of r along the normal Su x Sv."""
    nx = d[1, 1] * d[2, 2] - d[1, 2] * d[2, 1]
    ny = d[1, 2] * d[2, 0] - d[1, 0] * d[2, 2]
    nz = d[1, 0] * d[2, 1] - d[1, 1] * d[2, 0]
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return np.inf, np.nan
    nx, ny, nz = nx / length, ny / length, nz / length
    along = r[0] * nx + r[1] * ny + r[2] * nz
    tx, ty, tz = r[0] - along * nx, r[1] - along * ny, r[2] - along * nz
    return np.sqrt(tx * tx + ty * ty + tz * tz), along


@njit(cache=True)
def _load(
    p: Floats, surface: Spline, u: float, v: float, work: tuple[Floats, ...], d: Floats, r: Floats
) -> float:
    """Evaluate into d and write the residual p - S into r; return its square."""
    _evaluate(surface, u, v, work[0], work[1], d)
    for c in range(3):
        r[c] = p[c] - d[0, c]
    return _dot(r, r)


@njit(cache=True)
def _foot(
    p: Floats,
    u: float,
    v: float,
    surface: Spline,
    closed: tuple[bool, bool],
    work: tuple[Floats, ...],
    now: Floats,
    r: Floats,
    tolerance: float,
) -> tuple[float, float]:
    """Walk from (u, v) to the foot point of p; now and r hold derivatives and residual there."""
    poles, knots_u, knots_v, degree_u, degree_v = surface
    u0, u1 = knots_u[degree_u], knots_u[poles.shape[0]]
    v0, v1 = knots_v[degree_v], knots_v[poles.shape[1]]
    then, q = work[2], work[3][0]
    f = _load(p, surface, u, v, work, now, r)
    for _ in range(60):
        gu, gv = -_dot(now[1], r), -_dot(now[2], r)
        free_u = closed[0] or not ((u <= u0 and gu >= 0.0) or (u >= u1 and gu <= 0.0))
        free_v = closed[1] or not ((v <= v0 and gv >= 0.0) or (v >= v1 and gv <= 0.0))
        du, dv = _direction(now, r, free_u, free_v)
        slope = 2.0 * (gu * du + gv * dv)
        noise = 1e-13 * f + 1e-6 * tolerance * np.sqrt(f)
        size, moved = 1.0, False
        while size > 1e-4 and not moved:
            nu = _into(u + size * du, u0, u1, closed[0])
            nv = _into(v + size * dv, v0, v1, closed[1])
            g = _load(p, surface, nu, nv, work, then, q)
            # a gain below the rounding of f cannot be seen: then the Newton step itself is trusted
            moved = g < f + 1e-4 * size * slope or -slope <= noise
            size *= 0.5
        if not moved:
            break
        step = abs(nu - u) / (u1 - u0) + abs(nv - v) / (v1 - v0)
        u, v, f = nu, nv, g
        for i in range(6):
            copy_into(now[i], then[i])
        copy_into(r, q)
        if step < 1e-8 or -slope <= 1e-28 * f:  # Newton squares the error: the next step would be rounding
            break
    return u, v


@njit(cache=True)
def project(
    points: Floats,
    surface: Spline,
    closed: tuple[bool, bool],
    start_u: Floats,
    start_v: Floats,
    samples: tuple[Floats, ...],
    tolerance: float,
) -> Floats:
    """Foot points of points (n, 3): (n, 3) of u, v, signed distance; NaN where there is none.

    `surface` is (poles, knots_u, knots_v, degree_u, degree_v). Starts are start_u, start_v (n,) where finite,
    else the nearest sample; `samples` is m blocks of points (m, k, 3), their u and v (m, k), and spheres
    around them, centres (m, 3) and radii (m,). A foot point holds when the residual along the surface is
    within tolerance (a length).
    """
    blocks, samples_u, samples_v, centres, radii = samples
    result = np.full((points.shape[0], 3), np.nan)
    now, r = np.empty((6, 3)), np.empty(3)
    work = (np.empty((3, surface[3] + 1)), np.empty((3, surface[4] + 1)), np.empty((6, 3)), np.empty((1, 3)))
    for n in range(points.shape[0]):
        p = points[n]
        if not np.isfinite(p[0] + p[1] + p[2]):
            continue
        u, v = start_u[n], start_v[n]
        if not np.isfinite(u + v):
            i, j = _nearest_sample(p[0], p[1], p[2], blocks, centres, radii)
            u, v = samples_u[i, j], samples_v[i, j]
        u, v = _foot(p, u, v, surface, closed, work, now, r, tolerance)
        tangential, along = _split(now, r)
        if tangential <= tolerance:
            result[n, 0], result[n, 1], result[n, 2] = u, v, along
    return result
