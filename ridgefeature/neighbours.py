"""Templates next to each other: whether a chain advances, and where neighbours lead the one between them."""

from __future__ import annotations

import math
from itertools import pairwise
from statistics import median

import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import facing
from ridgefeature.template import Template

Array = NDArray[np.float64]
LEAST_ADVANCE = 0.4
"""Least distance between centres along their common direction, in parts of their mean length."""
_FACES_BACK = math.cos(math.radians(120.0))
"""Templates on both sides of a corner may turn by more than a right angle."""
_TIPPED = math.cos(math.radians(35.0))
FEWEST = 4
"""Templates of the smallest ring."""
HOME = 3
"""How many of a march's first templates it may come back to: the very first may be a poor fit."""
TYPICAL = 5
"""Templates whose medians tell what a ridge is like."""
_SAME_WAY = math.cos(math.radians(50.0))
_UNSURE = 2.0
"""Factor of the neighbours' standard deviations that an interpolated template has."""


def advances(before: Template, after: Template) -> bool:
    """Whether a template lies ahead of the one before it and does not face back."""
    x, y = before.rotation[:, 0], after.rotation[:, 0]
    if x @ y < _FACES_BACK:
        return False
    ahead = float((after.position - before.position) @ (x + y)) / float(np.linalg.norm(x + y))
    return ahead >= LEAST_ADVANCE * 0.5 * (before.length + after.length)


def follows(templates: list[Template], i: int, closed: bool) -> bool:
    """Whether the i-th template advances from the one before it and the next one from it."""
    n = len(templates)
    before = [templates[i - 1]] if i > 0 or closed else []
    after = [templates[(i + 1) % n]] if i + 1 < n or closed else []
    chain = [*before, templates[i], *after]
    return all(advances(a, b) for a, b in pairwise(chain))


def tipped(template: Template, near: list[Template]) -> bool:
    """Whether the base of a template stands at another angle than those of its neighbours, which agree."""
    up = np.array([t.rotation[:, 2] for t in near])
    agree = bool(((up @ up.T) > _TIPPED).all())
    return agree and bool((up @ template.rotation[:, 2] < _TIPPED).all())


def comes_home(template: Template, chain: list[Template], met: int) -> bool:
    """Whether a template that lies on the met-th of a chain closes it: one of its first, the same way on.

    Another ridge that crosses this one, or this one running into its own side, is no ring.
    """
    if met >= HOME or len(chain) - met < FEWEST:
        return False
    other, chord = chain[met], chain[met + 1].position - chain[met].position
    ways = (other.rotation[:, 0], chord / np.linalg.norm(chord))
    return (
        max(float(template.rotation[:, 0] @ way) for way in ways) > _SAME_WAY
        and float(template.rotation[:, 2] @ other.rotation[:, 2]) > _SAME_WAY
        and alike(template, chain[met : met + TYPICAL])
    )


def alike(template: Template, near: list[Template]) -> bool:
    """Whether height and width of a template are near the medians of others."""
    height, width = (median([getattr(t, name) for t in near]) for name in ("height", "width"))
    return 0.5 < template.height / height < 2.0 and 0.55 < template.width / width < 1.8


def between(before: Template, after: Template, share: float = 0.5) -> Template:
    """The template that two others lead to, `share` of the way from the first to the second.

    Its place is on the cubic that starts and ends along their directions (Hermite); height, width, base and
    standard deviations lie between theirs, the deviations twice as large and by half their difference more.
    """
    step = after.position - before.position
    chord = float(np.linalg.norm(step))
    s, r = share, 1.0 - share
    place = (
        r * r * (1 + 2 * s) * before.position
        + s * s * (1 + 2 * r) * after.position
        + chord * s * r * (r * before.rotation[:, 0] - s * after.rotation[:, 0])
    )
    slope = (
        6 * s * r * step
        + chord * r * (1 - 3 * s) * before.rotation[:, 0]
        + chord * s * (3 * s - 2) * after.rotation[:, 0]
    )
    normal = r * before.rotation[:, 2] + s * after.rotation[:, 2]
    normal = normal / np.linalg.norm(normal)
    sizes = {
        name: float(r * getattr(before, name) + s * getattr(after, name))
        for name in ("height", "width", "length", "flank", "scale")
    }
    return before.changed(
        position=place,
        rotation=facing(normal, slope if slope @ step > 0 else step),
        trend=r * before.trend + s * after.trend,
        std=_std_between(before, after),
        evidence=0.0,
        points=0,
        inliers=0,
        evaluations=0,
        status="interpolated",
        **sizes,
    )


def _std_between(before: Template, after: Template) -> Array | None:
    if before.std is None or after.std is None:
        return None
    std = _UNSURE * np.maximum(before.std, after.std)
    std[6] += 0.5 * abs(after.height - before.height)
    std[7] += 0.5 * abs(after.width - before.width)
    return np.asarray(std)
