"""The section that all points of a ridge have in common: a free spline, symmetric or not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ridgefeature.basis import basis_matrix
from ridgefeature.kernels.section_sums import cell_sums, spline_sums
from ridgefeature.kernels.strip import A, B, C, E, H, W
from ridgefeature.one_hump import one_hump, symmetric_hump
from ridgefeature.section import Section
from ridgefeature.smearing import Smeared, likelihood_section_scores

Array = NDArray[np.float64]

SPANS = 40
"""Of the free spline, over WIDER widths."""
WIDER = 1.25
Told = Callable[[int, float], tuple[Array, Array]]
"""Normal equations of a section of so many spans over so many widths, and of changes of the base."""
FREE = "free"
LEARNED = "learned"
_LOW = (0.04, 0.1, 0.25)
"""Heights whose places tell where the feet are."""
_ROOTS = np.array(_LOW) ** (1.0 / np.linspace(2.0, 3.0, 21)[:, None])
_ROUNDS, _LEAST_SPANS = 8, 20
_AT_KNOT = np.array([1.0, 4.0, 1.0]) / 6.0
"""Of three coefficients, in the height at the middle one's knot."""
_HIGH = 0.9
"""Height above which knots are on the top."""


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
    shift: float = 0.0
    """How far it lies to the left, in widths of the section before."""

    def applied(self, terms: Array, name: str = FREE) -> tuple[Section, Array]:
        """The section under this name, and a ridge's terms (n, 6) in its own widths and apex heights."""
        raised, base = self.found[3:-6], self.found[-3:]
        section = Section(raised, name)
        new = terms.copy()
        new[:, [A, B, C]] += base
        new[:, E] += self.shift * new[:, W]
        new[:, W] *= self.wider
        new[:, H] *= float(raised.max() / section.coefficients.max())
        return section, new


def free_section(
    told: Told,
    section: Section,
    spans: int,
    price: float,
    wider: float = WIDER,
    split: bool = False,
) -> FreeSection | None:
    """The spline of so many spans that fits the points best, as smooth as they ask for; None if it is none.

    told: what points say of it (`by_means`, `by_likelihood`); section: the one before; price: of a
    coefficient, in twice the log likelihood ratio. It spans `wider` widths: where its feet are `trimmed`
    tells once it is final. split: its top is as smooth as the points ask for there: as rough as steep flanks
    it would rise to a spike where one hump is asked for.
    """
    matrix, right = told(spans, wider)
    known = np.diagonal(matrix)
    if not (np.isfinite(matrix).all() and (known[-3:] > 0).all() and (known[:-3] > 0).any()):
        return None
    top = top_knots(section, spans, wider) if split else None
    found, freedom, inverse = smoothest_section(matrix, right, spans, top)
    if not found[3:-6].max() > 0:
        return None
    cost = 0.5 * price * freedom
    found, shift, part = _humped(found, inverse, spans, cost)
    if not np.convolve(found[3:-6], _AT_KNOT).max() > 0:
        return None
    gain = _gain(matrix, right, found, section, spans, wider)
    return FreeSection(found, wider, gain, part * freedom, shift * wider / spans)


def by_means(points: Array, terms: Array, seen: Smeared, noise: tuple[float, float]) -> Told:
    """What points say of a section by their mean heights.

    points (m, 3) in path coordinates and terms (n, 6) as in kernels.strip; seen: the section as it is,
    smeared; noise: scale and strays' density.
    """
    sums, base_matrix, base_right = cell_sums(points, terms, seen.told, *noise)
    return lambda spans, wider: spline_sums(sums, seen.basis(spans, wider), base_matrix, base_right)


def by_likelihood(
    points: Array, terms: Array, section: Section, noise: tuple[float, float, float, float]
) -> Told:
    """The same by their likelihood itself; noise: as `smearing.log_likelihood` has it."""

    def told(spans: int, wider: float) -> tuple[Array, Array]:
        matrix, right = likelihood_section_scores(points, terms, section, *noise, spans, wider)
        sites, nearest = nearest_spline(spans)
        old = nearest @ section((sites - 0.5) * wider)
        return matrix, right + matrix[:, : spans + 3] @ old

    return told


def trimmed(section: Section) -> tuple[Section, float, float]:
    """The section between its feet, their middle and their distance in widths of the section as it was."""
    low, high = _feet(section)
    middle, breadth = 0.5 * (low + high), high - low
    own, spans = np.linspace(-0.5, 0.5, 401), max(round(section.spans * breadth), _LEAST_SPANS)
    basis = basis_matrix(np.arange(-3.0, spans + 4.0), 3, (own + 0.5) * spans)[:, 3:-3]
    raised = np.asarray(np.linalg.lstsq(basis, section(middle + breadth * own), rcond=None)[0])
    # At vertical flanks the nearest spline would swing.
    raised = one_hump(raised, np.asarray(np.linalg.qr(basis)[1]))[0]
    return Section(raised, LEARNED), middle, breadth


def top_knots(section: Section, spans: int, wider: float) -> NDArray[np.bool_]:
    """Which knots (spans + 1,) of a spline over `wider` widths lie on the top of a section."""
    high = np.flatnonzero(section((np.arange(spans + 1) / spans - 0.5) * wider) > _HIGH)
    top = np.zeros(spans + 1, dtype=np.bool_)
    top[high[0] + 1 : high[-1]] = True
    return top


def smoothest_section(
    matrix: Array, right: Array, spans: int, top: NDArray[np.bool_] | None = None
) -> tuple[Array, float, Array]:
    """Coefficients of largest restricted likelihood (as in ridgefeature.smoothing), effective number and
    covariance.

    top (spans + 1,): which knots are on the top: as smooth by itself, not as rough as steep flanks ask for.
    """
    n = spans + 3
    d = np.zeros((n - 2, len(matrix)))
    d[:, :n] = np.diff(np.eye(n), 2, axis=0)
    parts = [d] if top is None or top.all() or not top.any() else [d[~top], d[top]]
    penalties = np.array([part.T @ part for part in parts])
    # Feet: the section ends flat.
    pinned = np.zeros(len(matrix))
    pinned[[0, 1, 2, n - 3, n - 2, n - 1]] = 1e3 * np.diagonal(matrix)[:n].max()
    size = float(np.diagonal(matrix)[:n].mean())
    lam = np.full(len(parts), 1e-3 * size)
    known = matrix + np.diag(1e-9 * np.diagonal(matrix) + pinned + 1e-300)
    for _ in range(_ROUNDS):
        whole = known.copy()
        for weight, penalty in zip(lam, penalties, strict=True):
            whole += weight * penalty
        inverse = np.asarray(np.linalg.inv(whole), dtype=np.float64)
        found = inverse @ right
        rough = np.array([((part @ found) ** 2).sum() for part in parts])
        tied = lam * [np.vdot(penalty, inverse) for penalty in penalties]
        free = np.maximum([len(part) for part in parts] - tied, 1e-2)
        # Always as many rounds: stopping early would let rounding decide on the result.
        low, high = np.maximum(1e-2 * lam, 1e-9 * size), np.minimum(1e2 * lam, 1e6 * size)
        lam = np.clip(free / np.maximum(rough, 1e-300), low, high)
    return found, float(free.sum()), inverse


def _humped(found: Array, inverse: Array, spans: int, price: float) -> tuple[Array, float, float]:
    """The coefficients that rise to an apex and fall from it, symmetric unless that costs too much.

    found, inverse: coefficients without this condition, and their covariance; price: what a symmetric one may
    cost, in twice the log likelihood ratio. Noise makes bumps, and the highest would pass for the apex; so
    would horns at flanks steeper than any section. Also by how many knots the symmetric one is moved, and
    what part of the coefficients are free.
    """
    inner = found[3:spans]
    # Given the inner ones the others follow.
    precision = np.linalg.inv(inverse[3:spans, 3:spans])
    root = np.asarray(np.linalg.cholesky(0.5 * (precision + precision.T)).T, dtype=np.float64)
    one, shift, cost = symmetric_hump(inner, root)
    part = 0.5
    if cost > price:
        free, least = one_hump(inner, root)
        if cost - least > price:
            one, shift, part = free, 0.0, 1.0
    out = found.copy()
    out[3:spans] = one
    rest = np.r_[spans + 3 : len(found)]
    out[rest] += inverse[rest, 3:spans] @ precision @ (one - inner)
    return out, shift, part


def _gain(matrix: Array, right: Array, found: Array, section: Section, spans: int, wider: float) -> float:
    """By how much the found coefficients are more likely than those nearest to the section before."""
    sites, nearest = nearest_spline(spans)
    old = nearest @ section((sites - 0.5) * wider)
    before = np.concatenate([old, np.zeros(3)])
    # The base is free either way.
    free = slice(spans + 3, None)
    before[free] = np.linalg.solve(matrix[free, free], right[free] - matrix[free, : spans + 3] @ old)
    return _loss(matrix, right, before) - _loss(matrix, right, found)


@lru_cache(maxsize=8)
def nearest_spline(spans: int) -> tuple[Array, Array]:
    """Sites (m,) from 0 to 1; the map (spans + 3, m) from values there to the nearest spline's poles."""
    sites = np.linspace(0.0, 1.0, 8 * spans + 1)
    basis = basis_matrix(np.arange(-3.0, spans + 4.0), 3, spans * sites)
    return sites, np.asarray(np.linalg.pinv(basis), dtype=np.float64)


def _loss(matrix: Array, right: Array, x: Array) -> float:
    return float(x @ matrix @ x - 2.0 * right @ x)


def _feet(section: Section) -> tuple[float, float]:
    """Between which places a section stands out, about its apex.

    Places of three low heights tell which power of the distance from the foot it rises with, from a parabola
    as of a cosine to a cubic as of a B-spline, and so where it begins.
    """
    eta = np.linspace(-0.5, 0.5, 2001)
    f = section(eta)
    top = int(np.argmax(f))
    sides = np.array(
        [
            [int(np.argmax(heights < level * f[top])) or len(heights) - 1 for level in _LOW]
            for heights in (f[top:], f[top::-1])
        ]
    )
    # Between the outer two heights by that between the inner two.
    found = (sides[:, 1] - sides[:, 2]).sum() / max((sides[:, 0] - sides[:, 1]).sum(), 1)
    ratios = (_ROOTS[:, 2] - _ROOTS[:, 1]) / (_ROOTS[:, 1] - _ROOTS[:, 0])
    outer, _, inner = _ROOTS[np.argmin(np.abs(ratios - found))]
    reach = (sides[:, 0] + (sides[:, 0] - sides[:, 2]) * outer / (inner - outer)) * (eta[1] - eta[0])
    return max(float(eta[top] - reach[1]), -0.5), min(float(eta[top] + reach[0]), 0.5)
