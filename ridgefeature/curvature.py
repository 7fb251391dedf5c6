"""How curved the base is under a chain of templates: found, smoothed along it, and zero unless significant."""

from __future__ import annotations

from dataclasses import dataclass, field
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from ridgefeature.improve import FEWEST_POINTS, floor, improve, loss_of
from ridgefeature.kernels.base import found_terms, smoothed
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]

_LARGEST = 0.5
"""Largest slope of the base at the outer border of a template's flanks."""
_ROUNDS = 3
_SURE = 0.1
"""Part of the allowed chance that one template alone may use up: a march asks many times."""
_KEPT = 0.6
"""What of earlier templates still counts at the next one."""
_DRIFTS = 10.0 ** np.arange(-10, 0)
"""Tried drifts of the terms: variance a length, in powers of the width."""


def terms_of(points: Array, template: Template, settings: Settings) -> tuple[Array, Array]:
    """The base's terms (3,) that the points of a template's window ask for, and their information (3, 3)."""
    if len(points) < FEWEST_POINTS:
        return template.base, np.zeros((3, 3))
    step, information, _ = found_terms(points, *template.shape, floor(template), *loss_of(settings))
    most = _LARGEST / template.half_breadth
    return np.minimum(np.maximum(template.base + step, -most), most), information


def improve_on_base(window: Window, start: Template, settings: Settings) -> Template | None:
    """The start improved on a base as curved as its window says; None where that says nothing of it."""
    fitted = start
    for _ in range(_ROUNDS):
        terms, information = terms_of(window(fitted), fitted, settings)
        if not significant(terms[None], information[None], _SURE * settings.base_chance):
            return None
        fitted = improve(window, fitted.changed(base=terms), settings)
        if fitted.status in ("failed", "no data"):
            return None
    return fitted


@dataclass(eq=False)
class Ahead:
    """What a march knows of the base ahead, from the templates behind; it forgets as it goes on."""

    settings: Settings
    information: Array = field(default_factory=lambda: np.zeros((3, 3)))
    pull: Array = field(default_factory=lambda: np.zeros(3))

    def add(self, window: Window, template: Template) -> Template:
        """Learn from a fitted template; it is returned with the terms that are now expected of the base."""
        terms, information = terms_of(window(template), template, self.settings)
        self.information = _KEPT * self.information + information
        self.pull = _KEPT * self.pull + information @ terms
        if not np.linalg.matrix_rank(self.information) == 3:
            return template
        mean = np.linalg.solve(self.information, self.pull)
        if significant(mean[None], self.information[None], _SURE * self.settings.base_chance):
            return template.changed(base=mean)
        return template.changed(base=np.zeros(3)) if template.base.any() else template


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
