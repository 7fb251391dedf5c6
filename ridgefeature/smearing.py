"""What a section looks like to points as noisy as a ridge's, along the whole ridge."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels.scores import scores, section_scores
from ridgefeature.kernels.smeared import log_likelihood as kernel
from ridgefeature.kernels.smeared import smeared, smeared_basis
from ridgefeature.kernels.strip import H, W
from ridgefeature.medians import median
from ridgefeature.path_frame import NODES_A_WIDTH
from ridgefeature.section import Section

Array = NDArray[np.float64]

_CELLS = 128
"""Places a width at which a smeared section is tabulated."""
_REACH = 4.0
"""Standard deviations of the noise by which a smeared section is wider."""
_LEAST_BLUR, _MOST_BLUR = 1e-4, 0.25
"""In widths: below, nothing is seen of it; above, no section is."""
_SMOOTH, _FEW = 0.02, 5
"""Up to which blur a Gauss-Hermite quadrature of so many places is enough."""
_FINE = 0.015
"""Distance of a quadrature's places in widths, else."""
_APART, _MOST_PLACES = 1.0, 800
"""The same for a likelihood, in noise deviations up the steepest flank; but no more places than that."""


@dataclass(frozen=True, eq=False)
class Smeared:
    """A section smeared over the noise, once a width along the ridge.

    values (m, cells + 1, 6) as kernels.smeared has them, from -reach to reach; blur, steepness (m,): noise
    and apex height in widths there; even: 0 where points lie evenly over the base, 1 over the surface.
    """

    section: Section
    values: Array
    reach: float
    blur: Array
    steepness: Array
    even: float

    @property
    def told(self) -> tuple[Array, float, int]:
        """As the kernels take it."""
        return self.values, self.reach, NODES_A_WIDTH

    def basis(self, spans: int, wider: float) -> Array:
        """How what is seen at the cells' middles changes with the coefficients of a spline section.

        (m, cells, spans + 3), of so many spans over `wider` widths.
        """
        cells = self.values.shape[1] - 1
        middles = ((np.arange(cells) + 0.5) / cells * 2.0 - 1.0) * self.reach
        rule = _rule(float(self.blur.max()))
        return np.stack(
            [
                smeared_basis(self.section.table, b, k, self.even, *rule, middles, spans, wider)
                for b, k in zip(self.blur, self.steepness, strict=True)
            ]
        )


def smear(section: Section, terms: Array, noise: float, even: float) -> Smeared:
    """The section of a ridge with these terms (n, 6) at its nodes, smeared over noise of this deviation."""
    places = np.arange(0, len(terms) + NODES_A_WIDTH // 2, NODES_A_WIDTH).clip(max=len(terms) - 1)
    h, w = terms[places, H], terms[places, W]
    blur = np.clip(noise / w, _LEAST_BLUR, _MOST_BLUR)
    steepness = np.abs(h) / w
    reach = 0.5 + _REACH * float(blur.max())
    cells = 2 * int(np.ceil(reach * _CELLS))
    rule = _rule(float(blur.max()))
    values = smeared(section.table, blur, steepness, even, *rule, reach, cells, section.symmetric)
    return Smeared(section, values, reach, blur, steepness, even)


def log_likelihood(
    points: Array, terms: Array, section: Section, noise: float, even: float, strays: float, span: float
) -> float:
    """Of the heights of points (m, 3) in path coordinates where they are seen: noisy, with a share of strays
    that lie evenly over `span`."""
    nodes = np.arange(len(terms))
    a, b, c, e, h, w = (np.interp(points[:, 0], nodes, terms[:, k]) for k in range(terms.shape[1]))
    y = points[:, 1]
    own, sizes = np.column_stack([y - e, points[:, 2] - a - y * (b + c * y)]), np.column_stack([h, w])
    rule = _fine_rule(h, w, section, noise)
    return float(kernel(own, section.table, sizes, even, *rule, noise, strays, span))


def likelihood_scores(
    points: Array, terms: Array, section: Section, noise: float, even: float, strays: float, span: float
) -> tuple[Array, Array]:
    """Information (nodes - 1, 6, 6) and derivatives (nodes - 1, 6) of the same, of each stretch."""
    rule = _fine_rule(terms[:, H], terms[:, W], section, noise)
    return scores(points, terms, section.table, even, *rule, noise, strays, span)


def likelihood_section_scores(
    points: Array,
    terms: Array,
    section: Section,
    noise: float,
    even: float,
    strays: float,
    span: float,
    spans: int,
    wider: float,
) -> tuple[Array, Array]:
    """Information (spans + 6, spans + 6) and derivatives (spans + 6,) of the same with the coefficients of a
    spline section of so many spans over `wider` widths, and with changes of the base."""
    rule = _fine_rule(terms[:, H], terms[:, W], section, noise)
    return section_scores(points, terms, section.table, even, *rule, noise, strays, span, spans, wider)


def _fine_rule(h: Array, w: Array, section: Section, noise: float) -> tuple[Array, Array]:
    """Places and shares of a quadrature up the flanks of a ridge of these heights and widths."""
    blur = float(np.clip(noise / median(w), _LEAST_BLUR, _MOST_BLUR))
    steepest = float(median(np.abs(h) / w) * np.abs(section(np.linspace(-0.5, 0.5, 401), 1)).max())
    # Up a flank the places of the quadrature stand no further apart than the noise reaches.
    return _even_rule(
        blur, max(min(_FINE, _APART * blur / max(steepest, 1.0)), 2.0 * _REACH * blur / _MOST_PLACES)
    )


def _rule(blur: float) -> tuple[Array, Array]:
    """Places and shares of a quadrature over the standard normal distribution."""
    if blur <= _SMOOTH:
        return _gauss_hermite()
    return _even_rule(blur, _FINE)


@cache
def _gauss_hermite() -> tuple[Array, Array]:
    places, shares = np.polynomial.hermite.hermgauss(_FEW)
    return np.asarray(np.sqrt(2.0) * places), np.asarray(shares / np.sqrt(np.pi))


def _even_rule(blur: float, apart: float) -> tuple[Array, Array]:
    """The same with even places, so far apart in widths, for noise of this deviation in widths."""
    places = np.linspace(-_REACH, _REACH, 2 * int(np.ceil(_REACH * max(blur / apart, 2.0))) + 1)
    shares = np.exp(-0.5 * places**2)
    return places, np.asarray(shares / shares.sum())
