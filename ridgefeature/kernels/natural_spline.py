"""The natural cubic spline through values at given sites, as a matrix."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import copy_into

Floats = NDArray[np.float64]


@njit(cache=True)
def natural_spline_matrix(sites: Floats, at: Floats) -> Floats:
    """Linear map (m, n) from values at sites (n,), ascending, to the natural cubic spline at `at` (m,).

    Beyond the sites the spline goes on straight. One site: constant. (de Boor, A Practical Guide to Splines,
    ch. 4; the tridiagonal system by Thomas's algorithm.)
    """
    n, m = sites.size, at.size
    out = np.zeros((m, n))
    if n == 1:
        out[:] = 1.0
        return out
    step = sites[1:] - sites[:-1]
    second = np.zeros((n, n))
    ratio = np.zeros(n)
    for i in range(1, n - 1):
        below = step[i - 1] / 6 if i > 1 else 0.0
        pivot = (step[i - 1] + step[i]) / 3 - below * ratio[i - 1]
        ratio[i] = step[i] / 6 / pivot
        copy_into(second[i], -below * second[i - 1] / pivot)
        second[i, i - 1] += 1 / step[i - 1] / pivot
        second[i, i] -= (1 / step[i - 1] + 1 / step[i]) / pivot
        second[i, i + 1] += 1 / step[i] / pivot
    for i in range(n - 3, 0, -1):
        copy_into(second[i], second[i] - ratio[i] * second[i + 1])
    k = 0
    for row in range(m):
        x = min(max(at[row], sites[0]), sites[-1])
        k = min(max(np.searchsorted(sites, x, side="right") - 1, 0), n - 2)
        h = step[k]
        b = (x - sites[k]) / h
        a = 1 - b
        curved = (a * a * a - a) * h * h / 6 * second[k] + (b * b * b - b) * h * h / 6 * second[k + 1]
        copy_into(out[row], curved)
        out[row, k] += a
        out[row, k + 1] += b
        beyond = at[row] - x
        if beyond != 0.0:
            inner = second[1] if beyond < 0 else second[n - 2]
            copy_into(out[row], out[row] + (beyond if beyond > 0 else -beyond) * h / 6 * inner)
            out[row, k] -= beyond / h
            out[row, k + 1] += beyond / h
    return out
