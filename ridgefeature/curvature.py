"""How curved the base is under a chain of templates: found, smoothed along it, and zero unless significant."""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from ridgefeature.improve import loss_of
from ridgefeature.kernels.base import found_terms, smoothed
from ridgefeature.settings import Settings
from ridgefeature.template import Template

Array = NDArray[np.float64]

_DRIFTS = 10.0 ** np.arange(-10, 0)
"""Tried drifts of the terms: variance a length, in powers of the width."""


def terms_of(points: Array, template: Template, settings: Settings) -> tuple[Array, Array]:
    """The base's terms (3,) that the points of a fitted template's window ask for, and their information."""
    step, information, _ = found_terms(points, *template.shape, template.scale, *loss_of(settings))
    return template.base + step, information


def significant(terms: Array, information: Array, chance: float) -> bool:
    """Whether terms (n, 3) differ from zero by more than chance: their mean along the chain, or all together.

    information (n, 3, 3) is that of the terms, zero where nothing is known of them. Two chi-square tests that
    share the chance between them.
    """
    if chance >= 0.5:
        return False
    whole = information.sum(axis=0)
    pull = np.einsum("nij,nj->i", information, terms)
    if not np.linalg.matrix_rank(whole) == 3:
        return False
    of_mean = float(pull @ np.linalg.solve(whole, pull))
    of_all = float(np.einsum("ni,nij,nj", terms, information, terms))
    told = int((information[:, 0, 0] > 0).sum())
    return of_mean > _chi_square(3, 0.5 * chance) or of_all > _chi_square(3 * told, 0.5 * chance)


def _chi_square(degrees: int, chance: float) -> float:
    """Value that chi-square of so many degrees exceeds by this chance (Wilson and Hilferty 1931)."""
    share = 2.0 / (9.0 * degrees)
    return degrees * (1.0 - share + NormalDist().inv_cdf(1.0 - chance) * share**0.5) ** 3


def curved(templates: tuple[Template, ...], terms: Array, information: Array) -> tuple[Template, ...]:
    """The templates with the terms of their base (n, 3) smoothed along the chain, as much as is most likely.

    information (n, 3, 3): that of the terms.
    """
    steps = np.linalg.norm(np.diff([t.position for t in templates], axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(steps)])
    width = float(np.median([t.width for t in templates]))
    tried = [smoothed(at, terms, information, drift / width**3) for drift in _DRIFTS]
    smooth, variance, _ = max(tried, key=lambda fit: fit[2])
    std = np.sqrt(np.maximum(variance, 0.0))
    return tuple(t.changed(base=c, base_std=d) for t, c, d in zip(templates, smooth, std, strict=True))
