"""What points say of a steep ridge by their likelihood itself: its derivatives with the terms and the section.

Beside a steep flank a point is high or low, and its mean height (kernels.strip) tells less than the mixture of
heights that its noise may have carried it from (as in `smeared.log_likelihood`). The information is the sum of
outer products of the derivatives (Berndt, Hall, Hall and Hausman 1974).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.residual import OPTIONS, split
from ridgefeature.kernels.smeared import crowded, section_at
from ridgefeature.kernels.strip import TERMS, A, B, C, E, H, W, terms_at

Floats = NDArray[np.float64]


@njit(**OPTIONS)
def scores(
    points: Floats,
    terms: Floats,
    table: Floats,
    even: float,
    abscissae: Floats,
    shares: Floats,
    noise: float,
    strays: float,
    span: float,
) -> tuple[Floats, Floats]:
    """Information (nodes - 1, 6, 6) and derivatives (nodes - 1, 6) of the log likelihood of each stretch.

    points (n, 3) in path coordinates and terms (nodes, 6) as in kernels.strip; the rest as for
    `smeared.log_likelihood`.
    """
    own = split(table)
    stretches = terms.shape[0] - 1
    matrix, right = np.zeros((stretches, TERMS, TERMS)), np.zeros((stretches, TERMS))
    least = strays / span
    density = (1.0 - strays) / (math.sqrt(2.0 * math.pi) * noise)
    row = np.empty(TERMS)
    for i in range(points.shape[0]):
        y = points[i, 1]
        j, (a, b, c, e, h, w) = terms_at(terms, points[i, 0])
        z = points[i, 2] - a - y * (b + c * y)
        d = d_e = d_h = d_w = n = n_z = n_e = n_h = n_w = 0.0
        for k in range(abscissae.size):
            eta = (y - e + noise * abscissae[k]) / w
            f, slope, bow = section_at(eta, own)
            dense, steeper, taller = crowded(slope, h / w, even)
            r = (z - h * f) / noise
            near = shares[k] * math.exp(-0.5 * min(r * r, 1e3))
            # With the place on the section, and with the apex height in widths.
            crowd, more = -shares[k] * steeper * bow / w, shares[k] * taller / w
            pull = near * dense * r / noise
            d += shares[k] * dense
            d_e += crowd
            d_h += more
            d_w += crowd * eta - more * h / w
            n += near * dense
            n_z += pull
            rise = -pull * h * slope / w
            near /= shares[k]
            n_e += rise + near * crowd
            n_h += pull * f + near * more
            n_w += rise * eta + near * (crowd * eta - more * h / w)
        on = density * n / d
        share = on / (least + on)
        row[A] = share * n_z / n if n > 0.0 else 0.0
        row[B], row[C] = y * row[A], y * y * row[A]
        row[E] = share * (n_e / n - d_e / d) if n > 0.0 else 0.0
        row[H] = share * (n_h / n - d_h / d) if n > 0.0 else 0.0
        row[W] = share * (n_w / n - d_w / d) if n > 0.0 else 0.0
        for p in range(TERMS):
            right[j, p] += row[p]
            for q in range(p + 1):
                matrix[j, p, q] += row[p] * row[q]
    for j in range(stretches):
        for p in range(TERMS):
            for q in range(p):
                matrix[j, q, p] = matrix[j, p, q]
    return matrix, right
