"""B-spline basis functions on any knots, vectorised in numpy.

Source: Piegl and Tiller, The NURBS Book, chapters 2 and 9; the recursion is Cox and de Boor's.
No compiled code here: what a CAD script imports must stay light and survive a module reload.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def clamped_knots(breaks: ArrayLike, degree: int) -> Floats:
    """Knots (n_breaks + 2 degree,) with simple interior knots and each end repeated degree + 1 times.

    `breaks` (n_breaks,) ascend strictly, at least two. Raises ValueError otherwise.
    """
    b = np.asarray(breaks, dtype=np.float64)
    _check_degree(degree)
    if b.ndim != 1 or b.size < 2 or not np.all(np.diff(b) > 0) or not np.all(np.isfinite(b)):
        raise ValueError(
            f"expected two or more finite breaks, strictly ascending, got {_brief(b)}; sort them"
        )
    return np.concatenate([np.full(degree, b[0]), b, np.full(degree, b[-1])])


def greville(knots: ArrayLike, degree: int) -> Floats:
    """Greville abscissae (n_poles,): the mean of `degree` consecutive knots for each pole."""
    k, _ = checked_knots(knots, degree)
    n = k.size - degree - 1
    means = np.add.reduce([k[i : n + i] for i in range(1, degree + 1)]) / degree
    return np.clip(means, k[degree], k[n])  # a mean of equal knots may round outwards


def basis_matrix(knots: ArrayLike, degree: int, at: ArrayLike, derivative: int = 0) -> Floats:
    """Values, or derivatives of the given order, of all basis functions: (len(at), n_poles), dense.

    `at` (m,) lies in the domain [knots[degree], knots[n_poles]], else ValueError; a NaN gives NaN in its row.
    """
    k, _ = checked_knots(knots, degree)
    t = np.atleast_1d(np.asarray(at, dtype=np.float64))
    if t.ndim != 1:
        raise ValueError(f"expected parameters of shape (m,), got {t.shape}; pass at.ravel()")
    return Places.at(k, degree, t, derivative).matrix(k.size - degree - 1)


def interpolate(knots: ArrayLike, degree: int, values: ArrayLike) -> Floats:
    """Poles (n_poles, ...) of the spline that takes `values` (n_poles, ...) at the Greville abscissae.

    A linear map of the values; polynomials up to the degree are reproduced. Raises ValueError when the
    number of values is not the number of poles.
    """
    sites = greville(knots, degree)
    v = np.asarray(values, dtype=np.float64)
    if v.ndim == 0 or v.shape[0] != sites.size:
        raise ValueError(
            f"expected {sites.size} values, one for each Greville abscissa, got shape {v.shape}; "
            "sample at greville(knots, degree)"
        )
    return solved(basis_matrix(knots, degree, sites), v.reshape(sites.size, -1)).reshape(v.shape)


def solved(matrix: Floats, values: Floats) -> Floats:
    """Poles (n, d) for values (n, d) at places, of which the matrix (n, n) has the basis functions."""
    return np.asarray(np.linalg.solve(matrix, values), dtype=np.float64)


def local_basis(
    knots: Floats, degree: int, at: Floats, derivative: int = 0
) -> tuple[NDArray[np.intp], Floats]:
    """The degree + 1 basis functions that do not vanish at each parameter.

    `knots` as checked_knots returns them, `at` (m,). Returns (first, values): index of the first of them
    (m,), values (m, degree + 1). ValueError outside the domain; NaN in, NaN out.
    """
    if derivative < 0:
        raise ValueError(f"expected a derivative order of 0 or more, got {derivative}")
    t, nan = _inside(knots, degree, at)
    n = knots.size - degree - 1
    last = knots.searchsorted(knots[n], side="left") - 1  # the last span that is not empty
    span = np.minimum(knots.searchsorted(t, side="right") - 1, last)
    near = knots[span + np.arange(1 - degree, degree + 1)[:, None]]
    behind, ahead = t - near[:degree], near[degree:] - t
    values = np.full((1, t.size), 1.0 if derivative <= degree else 0.0)
    for q in range(1, degree + 1):
        # these differences contain the span, so they are never zero
        share = values / (near[degree : degree + q] - near[degree - q : degree])
        values = np.zeros((q + 1, t.size))
        if q > degree - derivative:  # the topmost steps of the recursion differentiate
            values[1:] = q * share
            values[:-1] -= q * share
        else:
            values[1:] = behind[degree - q :] * share
            values[:-1] += ahead[:q] * share
    if nan is not None:
        values[:, nan] = np.nan
    return span - degree, np.ascontiguousarray(values.T)


@dataclass(frozen=True, eq=False)
class Places:
    """Parameters (m,) at which curves of the same knots are evaluated, again and again.

    near: the poles that bear on each, basis: how much; (m, degree + 1).
    """

    near: NDArray[np.intp]
    basis: Floats

    @staticmethod
    def at(knots: Floats, degree: int, t: Floats, derivative: int = 0) -> Places:
        """Parameters t (m,) on knots as checked_knots returns them; see local_basis."""
        first, basis = local_basis(knots, degree, t, derivative)
        return Places(first[:, None] + np.arange(degree + 1), basis)

    def matrix(self, n: int) -> Floats:
        """(m, n) basis functions of all n poles, dense."""
        matrix = np.zeros((len(self.near), n))
        np.put_along_axis(matrix, self.near, self.basis, axis=1)
        return matrix

    def __call__(self, poles: Floats) -> Floats:
        """Points (m, d) of the curve with these poles (n, d)."""
        return np.einsum("mi,mid->md", self.basis, poles[self.near])


def checked_knots(knots: ArrayLike, degree: int, n_poles: int | None = None) -> tuple[Floats, int]:
    """Knots as a read-only float64 copy, and the number of poles; ValueError when they do not fit."""
    _check_degree(degree)
    k = np.asarray(knots, dtype=np.float64)
    if k.ndim != 1 or k.size < 2 * (degree + 1):
        raise ValueError(
            f"expected at least {2 * (degree + 1)} knots for degree {degree}, got shape {k.shape}"
        )
    n = k.size - degree - 1
    if n_poles is not None and n != n_poles:
        raise ValueError(
            f"expected {n_poles + degree + 1} knots for {n_poles} poles of degree {degree}, got {k.size}; "
            "write repeated knots out, n_knots = n_poles + degree + 1"
        )
    return _ascending(k.tobytes(), int(degree)), n


@lru_cache(64)  # many curves and surfaces have the same
def _ascending(knots: bytes, degree: int) -> Floats:
    """Read-only knots from their bytes, checked to ascend without too many repeats."""
    k = np.frombuffer(knots)
    if not (k[1:] >= k[:-1]).all() or not np.isfinite(k[[0, -1]]).all():
        raise ValueError(f"expected finite knots in ascending order, got {_brief(k)}; sort them")
    if (k[degree + 1 :] <= k[: -degree - 1]).any():
        raise ValueError(f"expected no knot more than {degree + 1} times, got {_brief(k)}; drop repeats")
    return k


def _inside(knots: Floats, degree: int, at: Floats) -> tuple[Floats, NDArray[np.bool_] | None]:
    """Parameters clipped to the domain by no more than rounding, and which of them were NaN, None if none."""
    low, high = knots[degree], knots[knots.size - degree - 1]
    slack = 1e-12 * max(high - low, abs(low), abs(high))
    if at.size and at.min() >= low - slack and at.max() <= high + slack:  # not for NaN
        return at.clip(low, high), None
    nan = np.isnan(at)
    outside = (at < low - slack) | (at > high + slack)
    if outside.any():
        raise ValueError(
            f"expected parameters from {low:g} to {high:g}, got {at[outside][0]:.12g}; stay within the domain"
        )
    return np.where(nan, low, np.clip(at, low, high)), nan


def _check_degree(degree: int) -> None:
    if not isinstance(degree, (int, np.integer)) or degree < 1:
        raise ValueError(f"expected a degree of 1 or more, got {degree!r}")


def _brief(a: Floats) -> str:
    text = np.array2string(a, threshold=8, edgeitems=3, precision=4)
    return f"{' '.join(text.split())} of shape {a.shape}"


def periodic_interpolation(sites: Floats) -> tuple[Floats, Floats]:
    """The cubic spline through values at sites (n,) ascending, n >= 4, the last of which is the first again.

    Its knots, and the linear map (n + 2, n) from values to poles: C2 over the seam, as everywhere.
    """
    knots = np.concatenate([np.full(4, sites[0]), sites[1:-1], np.full(4, sites[-1])])
    ends = [basis_matrix(knots, 3, sites[[0, -1]], order) for order in (1, 2)]
    # divided by their size, derivatives condition the matrix no worse than values do
    seam = [(e[0] - e[1]) / np.abs(e).max() for e in ends]
    matrix = np.vstack([basis_matrix(knots, 3, sites), *seam])
    return knots, np.asarray(np.linalg.inv(matrix)[:, : len(sites)], dtype=np.float64)
