"""How curved the base is under a chain of templates: found, smoothed along it, zero unless significant."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import pairwise
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from ridgefeature.improve import floor, improve, loss_of
from ridgefeature.kernels import chain
from ridgefeature.kernels.base import flattened, seen_from, standing, turning
from ridgefeature.kernels.base_terms import FREE, found_terms, smoothed, softened, summed
from ridgefeature.medians import median
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]

_LARGEST = 0.5
"""Slope of the base at the outer border of a template's flanks beyond which it is something else."""
_ROUNDS = 3
_PART = 0.1
"""Part of the allowed chance that one template alone may use up: a march asks many times."""
_SURE_OF_SCALE = 0.37
"""Efficiency of the median absolute deviation: degrees of freedom of the scale a point."""
_UNTOLD = 0.015
"""Curvature in reciprocal widths that a template may see where its path bends or its sizes change."""
SEEN = 0.5
"""Points that a fit on a curved base must see, in those on a flat one: it fits few of them easily."""
_KEPT = 0.6
"""What of earlier templates still counts at the next one."""
_DRIFTS = 10.0 ** np.arange(-10, 0)
"""Tried drifts of the terms: variance a length, in powers of the width."""


@dataclass(frozen=True, eq=False)
class Found:
    """What n windows say of the base under them: terms (n, 3), their information (n, 3, 3), and how many
    points (n,) told it. The information is zero where a window does not tell."""

    terms: Array
    information: Array
    points: Array

    @cached_property
    def _summed(self) -> tuple[Array, float, float, int]:
        known = _SURE_OF_SCALE * np.maximum(self.points - FREE, 1.0)
        return summed(self.terms, self.information, known)

    @property
    def mean(self) -> Array:
        """(3,) weighted by information; zeros where that is not enough."""
        return self._summed[0]

    def seen_from(self, axes: Array) -> Found:
        """The same in a frame whose axes (3, 3), columns, are given in its own."""
        yaw = float(np.arctan2(axes[1, 0], axes[0, 0]))
        there, back = turning(yaw), turning(-yaw)
        return Found(self.terms @ there.T, back.T @ self.information @ back, self.points)

    def significant(self, chance: float) -> bool:
        """Whether the terms differ from zero by more than chance: their mean, or all together.

        Two likelihood ratio tests that share the chance between them. The noise is known from the same
        points, so the ratios are those of Student's distribution.
        """
        if chance >= 0.5:
            return False
        _, of_mean, of_all, told = self._summed
        return told > 0 and (
            of_mean > _chi_square(3, 0.5 * chance) or of_all > _chi_square(3 * told, 0.5 * chance)
        )


def terms_of(points: Array, template: Template, settings: Settings) -> Found:
    """What the points in a template's window, in its frame, say of its base."""
    step, information, _ = found_terms(points, *template.shape, floor(template), *loss_of(settings))
    terms = template.base + step
    if np.abs(terms).max() * template.half_breadth > _LARGEST:
        terms, information = template.base, np.zeros((3, 3))
    return Found(terms[None], information[None], np.array([float(len(points))]))


_NAMES = ("terms", "information", "points")


def joined(found: list[Found]) -> Found:
    """What all of them say, in this order."""
    return Found(*(np.concatenate([getattr(f, name) for f in found]) for name in _NAMES))


def _roughly(found: Found, width: float) -> Found:
    """The same, less sure: a template alone knows no bend of its path and no slopes of height and width."""
    softer = [softened(i, (_UNTOLD / width) ** 2) for i in found.information]
    return Found(found.terms, np.array(softer), found.points)


def improve_on_base(window: Window, start: Template, settings: Settings) -> Template | None:
    """The start improved on a base as curved as its window says; None where that says nothing of it."""
    if settings.flat:
        return None
    fitted = start
    for _ in range(_ROUNDS):
        found = _roughly(terms_of(window(fitted), fitted, settings), fitted.width)
        if not found.significant(_PART * settings.base_chance):
            return None if fitted is start else fitted
        fitted = improve(window, fitted.changed(base=found.mean), settings)
        if fitted.status in ("failed", "no data"):
            return None
    return fitted


@dataclass(eq=False)
class Ahead:
    """What a march knows of the base ahead, from the templates behind; it forgets as it goes on."""

    settings: Settings
    found: Found = field(default_factory=lambda: Found(np.zeros((1, 3)), np.zeros((1, 3, 3)), np.zeros(1)))
    axes: Array = field(default_factory=lambda: np.eye(3))
    """In which that is told: those of the last template."""

    def add(self, window: Window, template: Template) -> Template:
        """Learn from a fitted template; it is returned with the terms that are now expected of the base."""
        if self.settings.flat:
            return template
        new = _roughly(terms_of(window(template), template, self.settings), template.width)
        turned = self.found.seen_from(self.axes.T @ template.rotation)
        old = Found(turned.terms, _KEPT * turned.information, _KEPT * turned.points)
        self.axes = template.rotation
        both = joined([old, new])
        self.found = Found(
            both.mean[None],
            both.information.sum(axis=0, keepdims=True),
            both.points.sum(keepdims=True),
        )
        if not self.found.significant(_PART * self.settings.base_chance):
            return template.changed(base=np.zeros(3)) if template.curved else template
        if template.curved:
            return template.changed(base=both.mean)
        # The first time a curved base must fit better than a flat one, and show the same ridge.
        bent = improve(window, template.changed(base=both.mean), self.settings)
        alike = 0.5 < bent.width / template.width < 2.0 and bent.points > SEEN * template.points
        return bent if alike and less_noisy(bent, template) else template


def less_noisy(bent: Template, flat: Template) -> bool:
    """Whether a template on a curved base leaves smaller residuals than one on a flat base.

    Not a larger share: a base that bends the wrong way makes a higher ridge, and more to explain.
    """
    return bent.status not in ("failed", "no data") and bent.scale < flat.scale


@lru_cache(maxsize=1024)  # a march asks for few of them, many times
def _chi_square(degrees: int, chance: float) -> float:
    """Value that chi-square of so many degrees exceeds by this chance (Wilson and Hilferty 1931)."""
    share = 2.0 / (9.0 * degrees)
    return degrees * (1.0 - share - NormalDist().inv_cdf(chance) * share**0.5) ** 3


def curved(templates: tuple[Template, ...], found: Found) -> tuple[Template, ...]:
    """The templates with the terms of their base smoothed along the chain, as much as is most likely.

    The ground does not turn with the ridge, what its section or a bend add to the terms does: they are
    smoothed in one frame that does not turn about the base's normal, or in those of the templates, where that
    is likelier.
    """
    ways = [a.rotation.T @ b.rotation for a, b in pairwise(templates)]
    yaws = np.concatenate([[0.0], np.cumsum([np.arctan2(way[1, 0], way[0, 0]) for way in ways])])
    steps = np.linalg.norm(np.diff([t.position for t in templates], axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(steps)])
    width = median([t.width for t in templates])
    tried = [_smoothed(at, found, turn, width) for turn in (yaws, 0.0 * yaws)]
    smooth, std, _ = max(tried, key=lambda fit: fit[2])
    return tuple(t.changed(base=c, base_std=d) for t, c, d in zip(templates, smooth, std, strict=True))


def _smoothed(at: Array, found: Found, yaws: Array, width: float) -> tuple[Array, Array, float]:
    """kernels.base_terms.smoothed in frames that are turned back by `yaws` (n,), with the likeliest drift:
    terms, their standard deviations, log likelihood."""
    there = np.array([turning(-yaw) for yaw in yaws])
    back = np.array([turning(yaw) for yaw in yaws])
    terms = np.einsum("nij,nj->ni", there, found.terms)
    information = np.ascontiguousarray(np.swapaxes(back, 1, 2) @ found.information @ back)
    tried = [smoothed(at, terms, information, drift / width**3) for drift in _DRIFTS]
    smooth, variance, likelihood = max(tried, key=lambda fit: fit[2])
    std = np.sqrt(np.maximum(np.einsum("nij,nj->ni", back**2, variance), 0.0))
    return np.einsum("nij,nj->ni", back, smooth), std, likelihood


def starts_on_base(
    last: Template, positions: Array, frames: Array, length: float
) -> tuple[Array, Array, Array]:
    """kernels.chain.starts, worked out as if the base was flat, and laid on it where it is curved; and its
    terms in their frames (m, 3)."""
    if not last.curved:
        found = chain.starts(positions, frames, last.length, length)
        return *found, np.zeros((len(found[0]), 3))
    own = last.rotation
    places = flattened((positions - last.position) @ own, last.base)
    turned = [own.T @ f for f in frames]
    axes = np.array([standing(p, np.eye(3), last.base)[1].T @ f for p, f in zip(places, turned, strict=True)])
    found = chain.starts(places, axes, last.length, length)
    laid = [standing(p, f, last.base) for p, f in zip(*found, strict=True)]
    base = np.array([seen_from(last.base, f) for f in found[1]])
    return np.array([last.position + own @ p for p, _ in laid]), np.array([own @ f for _, f in laid]), base
