"""Points along a ridge in coordinates of its path, and what each short stretch of them says of the ridge.

A path is given at nodes: origin, tangent, left and normal (n, 3) each, and the curvature (n,) of its base
across. Coordinates of a point are s in nodes, y along the base to the left, and z over the base.

The surface is z = a + b y + c y^2 + h f((y - e) / w): the base's offset, tilt and curvature, the section f
with height, width and its shift sideways. In all arrays they are ordered a, b, c, e, h, w. Points are held
against the section as noise smears it (kernels.smeared).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.residual import INNER, OPTIONS
from ridgefeature.kernels.smeared import smeared_at

Floats = NDArray[np.float64]
TERMS = 6
A, B, C, E, H, W = range(TERMS)
_LEAST_STEP = 0.15
"""Distance of neighbouring nodes' planes, in parts of that of the nodes, below which they soon meet."""


@njit(**INNER)
def rectified(
    points: Floats,
    origin: Floats,
    tangent: Floats,
    left: Floats,
    normal: Floats,
    curvature: Floats,
    reach: Floats,
    tall: Floats,
    first: int,
) -> Floats:
    """Coordinates (m, 3) of those points (n, 3) that lie between the first and the last node.

    All in the points' frame. reach (nodes,): how far to either side; tall (nodes,): how far above and below
    the base. The nodes are numbered from `first` on. Of several places that a point may have the one
    nearest to the path is taken.
    """
    n = origin.shape[0]
    out = np.empty((points.shape[0], 3))
    m = 0
    ahead, steps = np.empty(n), np.empty(n - 1)
    # By columns, for SIMD.
    planes = np.empty((4, n))
    for j in range(n):
        planes[0, j], planes[1, j], planes[2, j] = tangent[j, 0], tangent[j, 1], tangent[j, 2]
        planes[3, j] = _along(0.0, 0.0, 0.0, origin, tangent, j)
    for j in range(n - 1):
        steps[j] = _distance(origin, j)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for j in range(n):
            ahead[j] = planes[3, j] + x * planes[0, j] + y * planes[1, j] + z * planes[2, j]
        best = -1.0
        for j in range(n - 1):
            if not ahead[j] >= 0.0 > ahead[j + 1]:
                continue
            step = steps[j]
            span = ahead[j] - ahead[j + 1]
            if span < _LEAST_STEP * step:
                continue
            u = ahead[j] / span
            v = 1.0 - u
            px, py, pz = _from_path(x, y, z, origin, tangent, j, u, step)
            side = _on_mean(px, py, pz, left, j, u)
            over = _on_mean(px, py, pz, normal, j, u)
            side, over, seen = _unrolled(side, over, v * curvature[j] + u * curvature[j + 1])
            if not seen:
                continue
            far = v * reach[j] + u * reach[j + 1]
            if abs(side) > far or abs(over) > v * tall[j] + u * tall[j + 1]:
                continue
            if best < 0.0 or abs(side) < best:
                best = abs(side)
                out[m, 0], out[m, 1], out[m, 2] = first + j + u, side, over
        if best >= 0.0:
            m += 1
    return out[:m]


@njit(**INNER)
def _unrolled(side: float, over: float, bend: float) -> tuple[float, float, bool]:
    """Arc length and height over a base that is an arc of a circle; heights are along its radii."""
    if abs(bend) * (abs(side) + abs(over)) <= 1e-9:
        return side, over, True
    room = 1.0 - bend * over
    if room <= 0.2:
        return side, over, False
    radius = math.sqrt(bend * bend * side * side + room * room)
    return math.atan2(bend * side, room) / bend, (1.0 - radius) / bend, True


@njit(**INNER)
def _along(x: float, y: float, z: float, origin: Floats, tangent: Floats, j: int) -> float:
    """How far a point lies ahead of the j-th node."""
    return (
        (x - origin[j, 0]) * tangent[j, 0]
        + (y - origin[j, 1]) * tangent[j, 1]
        + (z - origin[j, 2]) * tangent[j, 2]
    )


@njit(**INNER)
def _distance(origin: Floats, j: int) -> float:
    """From the j-th node to the next."""
    dx, dy, dz = (
        origin[j + 1, 0] - origin[j, 0],
        origin[j + 1, 1] - origin[j, 1],
        origin[j + 1, 2] - origin[j, 2],
    )
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@njit(**INNER)
def _from_path(
    x: float, y: float, z: float, origin: Floats, tangent: Floats, j: int, u: float, step: float
) -> tuple[float, float, float]:
    """From the path, a part u of the way from the j-th node to the next, to a point.

    It is the cubic that starts and ends along the tangents (Hermite), so that the path has no corners.
    """
    v = 1.0 - u
    k0, k1 = step * u * v * v, -step * u * u * v
    ahead = u * u * (3.0 - 2.0 * u)
    back = 1.0 - ahead
    return (
        x - back * origin[j, 0] - ahead * origin[j + 1, 0] - k0 * tangent[j, 0] - k1 * tangent[j + 1, 0],
        y - back * origin[j, 1] - ahead * origin[j + 1, 1] - k0 * tangent[j, 1] - k1 * tangent[j + 1, 1],
        z - back * origin[j, 2] - ahead * origin[j + 1, 2] - k0 * tangent[j, 2] - k1 * tangent[j + 1, 2],
    )


@njit(**INNER)
def _on_mean(px: float, py: float, pz: float, axes: Floats, j: int, u: float) -> float:
    """A vector along the axis between those of the j-th node and of the next."""
    v = 1.0 - u
    ax = v * axes[j, 0] + u * axes[j + 1, 0]
    ay = v * axes[j, 1] + u * axes[j + 1, 1]
    az = v * axes[j, 2] + u * axes[j + 1, 2]
    return (px * ax + py * ay + pz * az) / math.sqrt(ax * ax + ay * ay + az * az)


Terms = tuple[float, float, float, float, float, float]
Seen = tuple[Floats, float, int]


@njit(**INNER)
def terms_at(terms: Floats, s: float) -> tuple[int, Terms]:
    """The stretch that a place between nodes is in, and the six terms there."""
    j = min(np.int64(s), terms.shape[0] - 2)
    u = s - j
    v = 1.0 - u
    return j, (
        v * terms[j, A] + u * terms[j + 1, A],
        v * terms[j, B] + u * terms[j + 1, B],
        v * terms[j, C] + u * terms[j + 1, C],
        v * terms[j, E] + u * terms[j + 1, E],
        v * terms[j, H] + u * terms[j + 1, H],
        v * terms[j, W] + u * terms[j + 1, W],
    )


@njit(**OPTIONS)
def places_across(points: Floats, terms: Floats) -> Floats:
    """Places (m,) of points (m, 3) in path coordinates across the ridge, in widths from its middle."""
    out = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        _, there = terms_at(terms, points[i, 0])
        out[i] = (points[i, 1] - there[3]) / there[5]
    return out


@njit(**INNER)
def seen_at(
    y: float, z: float, terms: Terms, values: Floats, reach: float, scale: float
) -> tuple[float, float, float, float, float, float, float, float]:
    """A point against where points seen at its y are expected.

    Its distance from their mean height, by the deviation of heights there; that from the nearest height that
    the surface has near by, by the noise, if it is less; the mean height, its derivative with the apex
    height, its slope and second derivative by place in widths, that place, and 1 over the deviation.
    """
    a, b, c, e, h, w = terms
    eta = (y - e) / w
    f, rate, bow, spread, low, high, growth = smeared_at(eta, values, reach)
    tilt, steep = b + 2.0 * c * y, h / w
    variance = 1.0 + tilt * tilt + steep * (2.0 * tilt * rate + steep * spread)
    per_scale = 1.0 / (scale * math.sqrt(max(variance, 0.1)))
    z -= a + y * (b + c * y)
    r = (z - h * f) * per_scale
    # Beside a steep flank points are high or low, and few as high as the mean: those are no strays.
    above, below = (high, low) if h >= 0.0 else (low, high)
    out = max(max(z - h * above, h * below - z), 0.0) / scale
    return r, min(out, abs(r)), f, growth, rate, bow, eta, per_scale


@njit(**INNER)
def share_of_surface(r: float, inverse: float, stray: float) -> float:
    """Chance that a point is of the surface, no stray, by its distance in noise scales."""
    return 1.0 / (1.0 + stray / inverse * _exponential(min(0.5 * r * r, 50.0)))


@njit(**INNER)
def _exponential(x: float) -> float:
    """e to the power of x from 0 to 50, to 1e-12 of it, by multiplications alone: loops over it are SIMD.

    The series of e to the power of x / 1024, squared ten times.
    """
    y = x * (1.0 / 1024.0)
    series = 1.0 + y / 7.0
    series = 1.0 + y / 6.0 * series
    series = 1.0 + y / 5.0 * series
    series = 1.0 + y / 4.0 * series
    series = 1.0 + y / 3.0 * series
    series = 1.0 + y / 2.0 * series
    power = 1.0 + y * series
    for _ in range(10):
        power *= power
    return power


@njit(**OPTIONS)
def offsets(points: Floats, terms: Floats, seen: Seen, scale: float) -> tuple[Floats, Floats]:
    """Distances (m,) of points (m, 3) in path coordinates from where they are expected; terms (nodes, 6).

    They are heights in units of how much these scatter by the noise, times the noise scale: near a surface
    that is nearly flat they are distances from it. The second ones tell strays: they are less where the
    surface is as high near by. seen: the smeared section (kernels.smeared) once a `stride` of nodes, its
    reach, and that stride.
    """
    values, reach, stride = seen
    out, far = np.empty(points.shape[0]), np.empty(points.shape[0])
    for i in range(points.shape[0]):
        _, there = terms_at(terms, points[i, 0])
        own = values[np.int64(points[i, 0] / stride + 0.5)]
        found = seen_at(points[i, 1], points[i, 2], there, own, reach, scale)
        out[i], far[i] = scale * found[0], scale * found[1]
    return out, far


@njit(**OPTIONS)
def mixture(
    r: Floats, far: Floats, scale: float, share: float, span: float, least: float, rounds: int
) -> tuple[float, float, float]:
    """Noise scale and share of strays, and the density of strays over that of the others at their middle.

    Residuals r (n,) are a mixture of a normal distribution and strays spread evenly over `span` (Dempster,
    Laird and Rubin 1977), to begin with of this scale and this share of strays. far (n,): what tells strays,
    up to |r|. least: of the scale.
    """
    stray = 0.0
    for _ in range(rounds):
        stray = share / (1.0 - share) * math.sqrt(2.0 * math.pi) * scale / span
        total = square = 0.0
        inverse = 1.0 / scale
        for i in range(r.size):
            weight = share_of_surface(far[i] * inverse, 1.0, stray)
            total += weight
            square += weight * r[i] * r[i]
        scale = max(math.sqrt(square / max(total, 1.0)), least)
        share = min(max(1.0 - total / r.size, 1e-3), 0.5)
    return scale, share, stray
