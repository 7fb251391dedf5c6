"""What the points of each short stretch of a ridge say of its terms there: weighted normal equations."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.residual import INNER, OPTIONS
from ridgefeature.kernels.strip import TERMS, Seen, seen_at, share_of_surface, terms_at

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
Row = tuple[float, float, float, float, float, float]
_TRIANGLE = TERMS * (TERMS + 1) // 2
_NOTHING = (_TRIANGLE + TERMS) * (0.0,)


@njit(**OPTIONS)
def information(
    points: Floats, terms: Floats, seen: Seen, scale: float, stray: float
) -> tuple[Floats, Floats, Floats]:
    """What the points of each stretch between two nodes say of the terms there.

    Weighted normal equations in units of the noise scale: matrices (nodes - 1, 6, 6), right sides
    (nodes - 1, 6), and the sums (4,) over all points of 1, weight, psi^2 and psi'. points, terms and seen as
    in kernels.strip; stray: as `mixture` there has it. Derivatives are taken at the point's own y and the
    stretch's middle. How much the points scatter is taken as known: then their mean alone decides, whatever
    the shape of the noise.
    """
    values, reach, stride = seen
    stretches = terms.shape[0] - 1
    matrix, right = np.zeros((stretches, TERMS, TERMS)), np.zeros((stretches, TERMS))
    total = square = slope = 0.0
    order, starts = _by_stretch(points, stretches)
    for j in range(stretches):
        # One stretch after the other: then the sums stay in registers.
        sums = _NOTHING
        for k in range(starts[j], starts[j + 1]):
            y, z, s = points[order[k], 1], points[order[k], 2], points[order[k], 0]
            _, there = terms_at(terms, s)
            h, w = there[4], there[5]
            own = values[np.int64(s / stride + 0.5)]
            r, far, f, growth, rate, bow, eta, per_scale = seen_at(y, z, there, own, reach, scale)
            weight = share_of_surface(far, per_scale * scale, stray)
            total += weight
            square += weight * weight * r * r
            slope += weight - weight * (1.0 - weight) * far * far
            blur, steep = scale / w, per_scale * h / w
            wider = -steep * (rate * eta + bow * blur * blur + growth - f)
            base = per_scale, per_scale * y, per_scale * y * y
            sums = _added(sums, (*base, -steep * rate, per_scale * growth, wider), weight, r)
        for p in range(TERMS):
            right[j, p] = sums[_TRIANGLE + p]
            for q in range(p + 1):
                matrix[j, p, q] = matrix[j, q, p] = sums[p * (p + 1) // 2 + q]
    return matrix, right, np.array([float(len(points)), total, square, slope])


@njit(**INNER)
def _by_stretch(points: Floats, stretches: int) -> tuple[Indices, Indices]:
    """The points' numbers (m,) in the order of their stretches, and where each stretch begins among them."""
    starts, order = np.zeros(stretches + 1, np.int64), np.empty(points.shape[0], np.int64)
    for i in range(points.shape[0]):
        starts[_stretch_of(points[i, 0], stretches) + 1] += 1
    for j in range(stretches):
        starts[j + 1] += starts[j]
    nexts = starts.copy()
    for i in range(points.shape[0]):
        j = _stretch_of(points[i, 0], stretches)
        order[nexts[j]] = i
        nexts[j] += 1
    return order, starts


@njit(**INNER)
def _stretch_of(s: float, stretches: int) -> int:
    """The stretch that a place between nodes is in."""
    return min(int(s), stretches - 1)


@njit(**INNER)
def _added(sums: tuple[float, ...], row: Row, weight: float, r: float) -> tuple[float, ...]:
    """Sums of products of rows with themselves, by rows of the lower triangle, then with r, and one more."""
    a, b, c, e, h, w = row
    wa, wb, wc, we, wh, ww = weight * a, weight * b, weight * c, weight * e, weight * h, weight * w
    # fmt: off
    return (
        sums[0] + wa * a,
        sums[1] + wb * a, sums[2] + wb * b,
        sums[3] + wc * a, sums[4] + wc * b, sums[5] + wc * c,
        sums[6] + we * a, sums[7] + we * b, sums[8] + we * c, sums[9] + we * e,
        sums[10] + wh * a, sums[11] + wh * b, sums[12] + wh * c, sums[13] + wh * e, sums[14] + wh * h,
        sums[15] + ww * a, sums[16] + ww * b, sums[17] + ww * c, sums[18] + ww * e, sums[19] + ww * h,
        sums[20] + ww * w,
        sums[21] + wa * r, sums[22] + wb * r, sums[23] + wc * r,
        sums[24] + we * r, sums[25] + wh * r, sums[26] + ww * r,
    )
    # fmt: on
