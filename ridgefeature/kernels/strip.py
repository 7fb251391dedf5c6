"""Points along a ridge in coordinates of its path, and what each short stretch of them says of the ridge.

A path is given at nodes: origin, tangent, left and normal (n, 3) each, and the curvature (n,) of its base
across. Coordinates of a point are s in nodes, y along the base to the left, and z over the base.

The surface is z = a + b y + c y^2 + h f((y - e) / w): the base's offset, tilt and curvature, the section f
with height, width and its shift sideways. In all arrays they are ordered a, b, c, e, h, w.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.residual import INNER, OPTIONS, split

Floats = NDArray[np.float64]
TERMS = 6
A, B, C, E, H, W = range(TERMS)
_LEAST_STEP = 0.15
"""Distance of neighbouring nodes' planes, in parts of that of the nodes, below which they soon meet."""


@njit(**OPTIONS)
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
            bend = v * curvature[j] + u * curvature[j + 1]
            if abs(bend) * (abs(side) + abs(over)) > 1e-9:
                # Unrolled: the base is an arc of a circle, heights are along its radii.
                room = 1.0 - bend * over
                if room <= 0.2:
                    continue
                radius = math.sqrt(bend * bend * side * side + room * room)
                side, over = math.atan2(bend * side, room) / bend, (1.0 - radius) / bend
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
Columns = tuple[Floats, Floats, Floats, Floats]


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


@njit(**INNER)
def surface_at(y: float, terms: Terms, table: Columns) -> tuple[float, float, float, float, float, float]:
    """Height of the base and of the section (part of the apex height), how the latter changes with y for an
    apex height of 1, place in widths, slope and second derivative of the surface."""
    a, b, c, e, h, w = terms
    constant, linear, quadratic, cubic = table
    spans = constant.size - 2.0
    eta = (y - e) / w
    position = min(max((eta + 0.5) * spans + 1.0, 0.5), spans + 1.5)
    span = np.int64(position)
    t = position - span
    per_y = spans / w
    p, q, r = linear[span], quadratic[span], cubic[span]
    f = constant[span] + t * (p + t * (q + t * r))
    rate = per_y * (p + t * (2.0 * q + 3.0 * t * r))
    bow = h * per_y * per_y * (2.0 * q + 6.0 * t * r)
    return a + y * (b + c * y), f, rate, eta, b + 2.0 * c * y + h * rate, 2.0 * c + bow


@njit(**INNER)
def noise_bias(scale: float, bow: float, inverse: float, even: float) -> float:
    """Mean distance, in noise scales, of points measured about a bent surface, seen at their own y.

    The mean height at a measured y is that of the surface smeared over the noise. even: 0 for points that lie
    evenly over the base, 1 evenly over the surface. inverse: 1 over the length of the surface's gradient.
    """
    bias = 0.5 * scale * bow * inverse * (1.0 + 2.0 * even * (1.0 - inverse * inverse))
    return min(max(bias, -0.5), 0.5)


@njit(**INNER)
def share_of_surface(r: float, inverse: float, stray: float) -> float:
    """Chance that a point is of the surface, no stray, by its distance in noise scales."""
    return 1.0 / (1.0 + stray / inverse * math.exp(min(0.5 * r * r, 50.0)))


@njit(**OPTIONS)
def offsets(points: Floats, terms: Floats, table: Floats) -> Floats:
    """Distances (m,) of points (m, 3) in path coordinates from the surface; terms (nodes, 6)."""
    own = split(table)
    out = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        _, there = terms_at(terms, points[i, 0])
        base, f, _, _, slope, _ = surface_at(points[i, 1], there, own)
        out[i] = (points[i, 2] - base - there[4] * f) / math.sqrt(1.0 + slope * slope)
    return out


@njit(**OPTIONS)
def mixture(
    r: Floats, scale: float, share: float, span: float, least: float, rounds: int
) -> tuple[float, float, float]:
    """Noise scale and share of strays, and the density of strays over that of the others at their middle.

    Residuals r (n,) are a mixture of a normal distribution and strays spread evenly over `span` (Dempster,
    Laird and Rubin 1977), to begin with of this scale and this share of strays. least: of the
    scale.
    """
    stray = 0.0
    for _ in range(rounds):
        stray = share / (1.0 - share) * math.sqrt(2.0 * math.pi) * scale / span
        total = square = 0.0
        inverse = 1.0 / scale
        for i in range(r.size):
            weight = share_of_surface(r[i] * inverse, 1.0, stray)
            total += weight
            square += weight * r[i] * r[i]
        scale = max(math.sqrt(square / max(total, 1.0)), least)
        share = min(max(1.0 - total / r.size, 1e-3), 0.5)
    return scale, share, stray


@njit(**OPTIONS)
def information(
    points: Floats, terms: Floats, table: Floats, scale: float, stray: float, even: float
) -> tuple[Floats, Floats, Floats]:
    """What the points of each stretch between two nodes say of the terms there.

    Weighted normal equations in units of the noise scale: matrices (nodes - 1, 6, 6), right sides
    (nodes - 1, 6), and the sums (4,) over all points of 1, weight, psi^2 and psi'. stray: as `mixture` has
    it; even: as in `noise_bias`. Derivatives are taken at the point's own y and the stretch's middle.
    """
    own = split(table)
    stretches = terms.shape[0] - 1
    matrix, right = np.zeros((stretches, TERMS, TERMS)), np.zeros((stretches, TERMS))
    sums = np.zeros(4)
    row, turn = np.empty(TERMS), np.empty(TERMS)
    for i in range(points.shape[0]):
        y = points[i, 1]
        j, there = terms_at(terms, points[i, 0])
        h, w = there[4], there[5]
        base, f, rate, eta, slope, bow = surface_at(y, there, own)
        inverse = 1.0 / math.sqrt(1.0 + slope * slope)
        r = (points[i, 2] - base - h * f) * inverse / scale - noise_bias(scale, bow, inverse, even)
        weight = share_of_surface(r, inverse, stray)
        sums[0] += 1.0
        sums[1] += weight
        sums[2] += weight * weight * r * r
        sums[3] += weight - weight * (1.0 - weight) * r * r
        # The likelihood of a height at its y also changes with the slope, by which distances are shortened.
        curl = (r * r - 1.0) * slope * inverse * inverse
        bow -= 2.0 * there[2]
        turn[A], turn[B], turn[C] = 0.0, curl, 2.0 * y * curl
        turn[E], turn[H], turn[W] = -bow * curl, rate * curl, -(h * rate / w + bow * eta) * curl
        inverse /= scale
        row[A], row[B], row[C] = inverse, y * inverse, y * y * inverse
        row[E], row[H], row[W] = -h * rate * inverse, f * inverse, -h * rate * eta * inverse
        for p in range(TERMS):
            right[j, p] += weight * (r * row[p] + turn[p])
            for q in range(p + 1):
                matrix[j, p, q] += weight * row[p] * row[q]
    for j in range(stretches):
        for p in range(TERMS):
            for q in range(p):
                matrix[j, q, p] = matrix[j, p, q]
    return matrix, right, sums
