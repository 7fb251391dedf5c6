"""The section that all points of a ridge have in common: a free spline, symmetric or not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ridgefeature.basis import basis_matrix
from ridgefeature.kernels.section_sums import section_sums
from ridgefeature.kernels.strip import A, B, C, H, W
from ridgefeature.section import Section

Array = NDArray[np.float64]

SPANS = (14, 28)
"""Spans of the free spline, over WIDER widths."""
WIDER = 1.25
FREE = "free"
_FOOT = 0.012
"""Height at which a section begins, in apex heights."""
_ROUNDS = 8
_LEAST_SPANS = 20


@dataclass(frozen=True, eq=False)
class FreeSection:
    """A free section as fitted, and how much better it is than the one before."""

    found: Array
    """(spans + 6,) its coefficients in apex heights of the section before, and changes of the base."""
    wider: float
    """What it spans, in widths."""
    gain: float
    """Twice the log likelihood ratio against the section before."""
    freedom: float
    """Effective number of coefficients."""

    def applied(self, terms: Array) -> tuple[Section, Array]:
        """The section, and a ridge's terms (n, 6) in its own widths and apex heights."""
        raised, base = self.found[3:-6], self.found[-3:]
        section = Section(raised, FREE)
        new = terms.copy()
        new[:, [A, B, C]] += base
        new[:, W] *= self.wider
        new[:, H] *= float(raised.max() / section.coefficients.max())
        return section, new


def free_section(
    points: Array,
    terms: Array,
    section: Section,
    noise: tuple[float, float, float],
    spans: int,
    wider: float = WIDER,
) -> FreeSection | None:
    """The spline of so many spans that fits the points best, as smooth as they ask for; None if it is none.

    points (m, 3) in path coordinates and terms (n, 6) as in kernels.strip; noise: scale, strays' density and
    evenness. It spans `wider` widths: where its feet are `trimmed` tells once it is final.
    """
    matrix, right = section_sums(points, terms, section.table, *noise, spans, wider)
    told = np.diagonal(matrix)
    if not (np.isfinite(matrix).all() and (told[-3:] > 0).all() and (told[:-3] > 0).any()):
        return None
    found, freedom = _smoothest(matrix, right, spans)
    if not found[3:-6].max() > 0:
        return None
    return FreeSection(found, wider, _gain(matrix, right, found, section, spans, wider), freedom)


def trimmed(section: Section) -> tuple[Section, float, float]:
    """The section between its feet, their middle and their distance in widths of the section as it was."""
    eta = np.linspace(-0.5, 0.5, 2001)
    low, high = _feet(section(eta))
    middle, breadth = 0.5 * float(eta[low] + eta[high]), float(eta[high] - eta[low])
    own, spans = np.linspace(-0.5, 0.5, 401), max(round(section.spans * breadth), _LEAST_SPANS)
    basis = basis_matrix(np.arange(-3.0, spans + 4.0), 3, (own + 0.5) * spans)[:, 3:-3]
    raised = np.linalg.lstsq(basis, section(middle + breadth * own), rcond=None)[0]
    return Section(np.asarray(raised, dtype=np.float64), "learned"), middle, breadth


def _smoothest(matrix: Array, right: Array, spans: int) -> tuple[Array, float]:
    """Coefficients of largest restricted likelihood (as in ridgefeature.smoothing), effective number."""
    n = spans + 3
    d = np.zeros((n - 2, len(matrix)))
    d[:, :n] = np.diff(np.eye(n), 2, axis=0)
    penalty = d.T @ d
    # Feet: the section ends flat.
    pinned = np.zeros(len(matrix))
    pinned[[0, 1, 2, n - 3, n - 2, n - 1]] = 1e3 * np.diagonal(matrix)[:n].max()
    size = float(np.diagonal(matrix)[:n].mean())
    lam = 1e-3 * size
    ridge = np.diag(1e-9 * np.diagonal(matrix) + pinned + 1e-300)
    for _ in range(_ROUNDS):
        inverse = np.linalg.inv(matrix + lam * penalty + ridge)
        found = inverse @ right
        rough = float(((d @ found) ** 2).sum())
        free = max(n - 2 - lam * float((penalty * inverse).sum()), 1e-2)
        # Always as many rounds: stopping early would let rounding decide on the result.
        low, high = max(1e-2 * lam, 1e-9 * size), min(1e2 * lam, 1e6 * size)
        lam = float(np.clip(free / max(rough, 1e-300), low, high))
    return found, free


def _gain(matrix: Array, right: Array, found: Array, section: Section, spans: int, wider: float) -> float:
    """By how much the found coefficients are more likely than those nearest to the section before."""
    sites = np.linspace(0.0, spans, 8 * spans + 1)
    knots = np.arange(-3.0, spans + 4.0)
    shape = section((sites / spans - 0.5) * wider)
    old = np.linalg.lstsq(basis_matrix(knots, 3, sites), shape, rcond=None)[0]
    before = np.concatenate([old, np.zeros(3)])
    # The base is free either way.
    free = slice(spans + 3, None)
    before[free] = np.linalg.solve(matrix[free, free], right[free] - matrix[free, : spans + 3] @ old)
    return _loss(matrix, right, before) - _loss(matrix, right, found)


def _loss(matrix: Array, right: Array, x: Array) -> float:
    return float(x @ matrix @ x - 2.0 * right @ x)


def _feet(f: Array) -> tuple[int, int]:
    """Between which places of a sampled section it stands out, about its apex."""
    low = high = int(np.argmax(f))
    least = _FOOT * f[low]
    while low > 0 and f[low - 1] > least:
        low -= 1
    while high < len(f) - 1 and f[high + 1] > least:
        high += 1
    return low, high
