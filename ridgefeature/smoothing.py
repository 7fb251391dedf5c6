"""Smooth functions along a ridge, as smooth as the data ask for: penalised splines.

Cubic splines on even knots with a penalty on differences of their coefficients (Eilers and Marx 1996), whose
weight is that of largest restricted likelihood, by Fellner's and Schall's iteration (Wood and Fasiolo 2017).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels.penalised import assembled, changed_band, local_covariances, most_likely

Floats = NDArray[np.float64]

ORDERS = (3, 2, 1, 3, 2, 2)
"""Order of the differences that are kept small, of each term: offsets follow a smooth curvature."""


@dataclass(frozen=True, eq=False)
class Smooth:
    """Coefficients (n, 6) of the splines of all terms, and the band of their covariance (6 n, 24)."""

    coefficients: Floats
    covariance: Floats
    weights: Floats
    """(6,) of the penalties."""
    freedom: float
    """How many coefficients the data tell, in all."""

    def deviations(self, first: NDArray[np.intp], basis: Floats, term: int) -> Floats:
        """Standard deviations (k,) of one term where the basis functions are `basis` (k, 4)."""
        return np.sqrt(np.maximum(self.covariances(first, basis, term, term), 0.0))

    def covariances(self, first: NDArray[np.intp], basis: Floats, one: int, other: int) -> Floats:
        """Covariances (k,) of two terms at the same place."""
        return local_covariances(self.covariance, first, basis, one, other)

    def changed(self, change: Floats) -> Smooth:
        """The same for other terms, `change` (6, 6) times these."""
        covariance = changed_band(self.covariance, np.ascontiguousarray(change))
        return Smooth(self.coefficients @ change.T, covariance, self.weights, self.freedom)


def basis_at(n: int, at: Floats) -> tuple[NDArray[np.intp], Floats]:
    """First function and values (m, 4) of n cubic splines on even knots, one a unit, at `at` (m,) in
    [0, n - 3]."""
    t = np.clip(at, 0.0, n - 3.0)
    first = np.minimum(t, n - 4.0).astype(np.intp)
    u = t - first
    v, uu = 1.0 - u, u * u
    inner = 0.5 * uu * (u - 2.0) + 2.0 / 3.0
    last = uu * u / 6.0
    before = v * v * v / 6.0
    return first, np.stack([before, inner, 1.0 - before - inner - last, last], axis=1)


def smoothest(
    matrix: Floats,
    goal: Floats,
    basis: tuple[NDArray[np.intp], Floats],
    n: int,
    wanted: Floats,
    weights: Floats,
    rounds: int,
    doubted: bool,
) -> Smooth:
    """The splines that the stretches' normal equations and the penalties ask for together.

    matrix (m, 6, 6), goal (m, 6): of m stretches, in units of the noise; basis: as `basis_at` gives it at
    their middles; n: coefficients a term. wanted (6, n): what the differences should be, by rows as long as
    there are differences. weights (6,): of the penalties, to begin with, which become likelier with each
    round. doubted: whether what the data do not tell from a straight line need not be one.
    """
    band, right = assembled(matrix, goal, *basis, n)
    found, inverse, lam, freedom = most_likely(
        band, right, np.array(ORDERS), wanted, weights, rounds, float(doubted)
    )
    return Smooth(found, inverse, lam, freedom)
