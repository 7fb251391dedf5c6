"""How the section of a whole ridge is found together with its other terms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.free_section import (
    FREE,
    LEARNED,
    SPANS,
    WIDER,
    Told,
    by_likelihood,
    by_means,
    free_section,
    trimmed,
)
from ridgefeature.kernels.strip import E, W
from ridgefeature.named_section import best_named
from ridgefeature.noise import Noise
from ridgefeature.section import SECTIONS, Section, box
from ridgefeature.smearing import Smeared, smear

Array = NDArray[np.float64]

_PRICE = 4.0
"""Of a free section's coefficient, in twice the log likelihood ratio: chance pays so much for five of them
once in a thousand times. The logarithm of the number of points (BIC) keeps a section that is near the
ridge's, but is not it, until it spoils the height by several standard deviations."""


def told_of(points: Array, terms: Array, seen: Smeared, noise: Noise, exact: bool) -> Told:
    """What points say of the section, by their mean heights or exactly; seen: as such noise smears it."""
    if exact:
        return by_likelihood(points, terms, seen.section, noise.all)
    return by_means(points, terms, seen, noise.told)


def shaped(
    points: Array, terms: Array, seen: Smeared, noise: Noise, inflation: float, exact: bool = False
) -> tuple[Section, Array]:
    """The section and terms (n, 6), or another with a name, or a free one, where that is better beyond doubt.

    A box is never kept. points (m, 3) in path coordinates and terms as in kernels.strip; seen: the section as
    such noise smears it; inflation: variance of sums over neighbouring points, by what it would be if their
    noise was independent.
    """
    section, price = seen.section, np.log(len(points))
    wider = 1.0 if section.name == FREE else WIDER
    equations = told_of(points, terms, seen, noise, exact)(SPANS, wider)
    if section.name in SECTIONS and not exact:
        own, named = best_named(*equations, section, SPANS, wider)
        if own.loss - named.loss > inflation * price:
            return named.section, named.applied(terms)
    found = free_section(lambda *_: equations, section, SPANS, inflation * price, wider, exact)
    if found is None or (section is not box() and found.gain / inflation < _PRICE * found.freedom):
        return section, terms
    return found.applied(terms)


def between_feet(
    points: Array, terms: Array, section: Section, noise: Noise, inflation: float, exact: bool = False
) -> tuple[Section, Array]:
    """A free section and its terms between its feet, where it is fitted again; else as for `shaped`."""
    section, middle, breadth = trimmed(section)
    terms = terms.copy()
    terms[:, E] += middle * terms[:, W]
    terms[:, W] *= breadth
    seen, price = smear(section, terms, noise.blur, noise.even), inflation * np.log(len(points))
    told = told_of(points, terms, seen, noise, exact)
    found = free_section(told, section, section.spans, price, 1.0, exact)
    return (section, terms) if found is None else found.applied(terms, LEARNED)


def with_half_height_width(terms: Array, before: Section, section: Section) -> Array:
    """Terms (n, 6) of a section that is as wide at half height as the one before."""
    out = terms.copy()
    out[:, W] *= before.half_height_width / section.half_height_width
    return out
