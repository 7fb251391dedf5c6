"""Smooth functions along a ridge, as smooth as the data ask for: penalised splines.

Cubic splines on even knots with a penalty on differences of their coefficients (Eilers and Marx 1996), whose
weight is that of largest restricted likelihood, by Fellner's and Schall's iteration (Wood and Fasiolo 2017).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ridgefeature.basis import local_basis
from ridgefeature.kernels import banded
from ridgefeature.kernels.strip import TERMS, assembled

Floats = NDArray[np.float64]

ORDERS = (3, 2, 1, 3, 2, 2)
"""Order of the differences that are kept small, of each term: offsets follow a smooth curvature."""
_ROUNDS = 5
_SAME = 0.1
_LEAST_RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Smooth:
    """Coefficients (n, 6) of the splines of all terms, and the band of their covariance (6 n, 24)."""

    coefficients: Floats
    covariance: Floats
    weights: Floats
    """(6,) of the penalties."""

    def deviations(self, first: NDArray[np.intp], basis: Floats, term: int) -> Floats:
        """Standard deviations (k,) of one term where the basis functions are `basis` (k, 4)."""
        return np.sqrt(np.maximum(self.covariances(first, basis, term, term), 0.0))

    def covariances(self, first: NDArray[np.intp], basis: Floats, one: int, other: int) -> Floats:
        """Covariances (k,) of two terms at the same place."""
        total = np.zeros(len(basis))
        for k in range(4):
            for m in range(4):
                i, j = TERMS * (first + k) + one, TERMS * (first + m) + other
                high, low = np.maximum(i, j), np.minimum(i, j)
                total += basis[:, k] * basis[:, m] * self.covariance[high, high - low]
        return total

    def changed(self, change: Floats) -> Smooth:
        """The same for other terms, `change` (6, 6) times these."""
        n, m = self.covariance.shape
        covariance = np.zeros_like(self.covariance)
        blocks = np.zeros((n // TERMS, m // TERMS, TERMS, TERMS))
        for i in range(TERMS):
            for k in range(m):
                whole = np.arange(i, n, TERMS)
                other = whole - k
                ok = other >= 0
                step = (whole // TERMS - other // TERMS)[ok]
                near = step < m // TERMS
                blocks[whole[ok][near] // TERMS, step[near], i, other[ok][near] % TERMS] = self.covariance[
                    whole[ok][near], k
                ]
        # Within one place the band holds but the lower half.
        upper = np.triu_indices(TERMS, 1)
        blocks[:, 0][:, upper[0], upper[1]] = np.swapaxes(blocks[:, 0], 1, 2)[:, upper[0], upper[1]]
        blocks = np.einsum("ij,nbjk,lk->nbil", change, blocks, change)
        for i in range(TERMS):
            for k in range(m):
                whole = np.arange(i, n, TERMS)
                other = whole - k
                ok = (other >= 0) & (whole // TERMS - other // TERMS < m // TERMS)
                w, o = whole[ok], other[ok]
                covariance[w, k] = blocks[w // TERMS, w // TERMS - o // TERMS, i, o % TERMS]
        return Smooth(self.coefficients @ change.T, covariance, self.weights)


def even_knots(n: int) -> Floats:
    """Knots (n + 4,) of n cubic splines on [0, n - 3], one a unit, running on beyond both ends."""
    return np.arange(-3.0, n + 1.0)


def basis_at(n: int, at: Floats) -> tuple[NDArray[np.intp], Floats]:
    """First function and values (m, 4) of the cubic splines on even knots at `at` (m,)."""
    return local_basis(even_knots(n), 3, np.clip(at, 0.0, n - 3.0))


def differences(n: int, order: int) -> Floats:
    """(n - order, n) differences of coefficients."""
    return np.asarray(np.diff(np.eye(n), order, axis=0))


def smoothest(
    matrix: Floats,
    right: Floats,
    at: Floats,
    places: Floats,
    n: int,
    wanted: Floats,
    weights: Floats,
) -> Smooth:
    """The splines that the stretches' normal equations and the penalties ask for together.

    matrix (m, 6, 6), right (m, 6): of m stretches about the terms `at` (m, 6), in units of the noise; places
    (m,) in knots; n: coefficients a term. wanted (6, n): what the differences should be, by rows as long as
    there are differences. weights (6,): to begin with.
    """
    first, basis = basis_at(n, places)
    band, goal = assembled(matrix, right, at, first, basis, n)
    scale = band[:, 0].reshape(n, TERMS).mean(axis=0)
    penalties = [_penalty(n, k, wanted[k]) for k in range(TERMS)]
    most = 1e6 * scale / np.array([p[0][TERMS * (n // 2) + k, 0] for k, p in enumerate(penalties)])
    lam = np.minimum(weights, most)
    for _ in range(_ROUNDS):
        whole, pull = band.copy(), goal.copy()
        whole[:, 0] += np.tile(_LEAST_RIDGE * scale + 1e-300, n)
        for k, (part, towards, _) in enumerate(penalties):
            whole += lam[k] * part
            pull += lam[k] * towards
        factored, good = banded.factor(whole)
        if not good:
            lam *= 10.0
            continue
        found = banded.solve(factored, pull).reshape(n, TERMS)
        inverse = banded.inverse_band(factored)
        new = np.minimum(
            most, [_weight(lam[k], penalties[k], found[:, k], inverse, wanted[k]) for k in range(TERMS)]
        )
        done = np.abs(np.log(new / lam)).max() < _SAME
        lam = new
        if done:
            break
    return Smooth(found, inverse, lam)


def _penalty(n: int, term: int, wanted: Floats) -> tuple[Floats, Floats, Floats]:
    """Band (6 n, 24) of the penalty's matrix, its right side (6 n,), and the differences' matrix."""
    d = differences(n, ORDERS[term])
    square, pull = d.T @ d, d.T @ wanted[: len(d)]
    band, right = np.zeros((TERMS * n, 4 * TERMS)), np.zeros(TERMS * n)
    own = np.arange(n)
    right[TERMS * own + term] = pull
    for k in range(min(4, n)):
        band[TERMS * own[k:] + term, TERMS * k] = np.diagonal(square, -k)
    return band, right, d


def _weight(
    lam: float, penalty: tuple[Floats, Floats, Floats], found: Floats, inverse: Floats, wanted: Floats
) -> float:
    """The next weight of a penalty: differences left over as large as chance makes them."""
    band, _, d = penalty
    # Off-diagonal entries count twice.
    trace = float((band[:, 0] * inverse[:, 0]).sum() + 2.0 * (band[:, 1:] * inverse[:, 1:]).sum())
    rough = float(((d @ found - wanted[: len(d)]) ** 2).sum())
    free = max(len(d) - lam * trace, 1e-3)
    return float(np.clip(free / max(rough, 1e-300), 1e-3 * lam, 1e3 * lam))
