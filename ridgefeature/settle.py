"""After the march: refit every template knowing its neighbours, and let its ends stand or fall."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.curvature import Found, curved, terms_of
from ridgefeature.ends import place_ends, trends
from ridgefeature.improve import Limits, judge, limits_of, refine
from ridgefeature.kernels import appraise
from ridgefeature.march import Track
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]

_BINS = 16
_SAME_LENGTH = 0.15
_BASE_ROUNDS = 4
_SETTLED = 0.1
"""Change in standard deviations from round to round below which a base counts as found."""


def _expected(templates: list[Template], i: int, settings: Settings) -> Limits:
    """Limits of the i-th template about the mean of its neighbours."""
    near = [templates[k] for k in (i - 1, i + 1) if 0 <= k < len(templates)] or [templates[i]]
    height = sum(t.height for t in near) / len(near)
    width = sum(t.width for t in near) / len(near)
    return limits_of(height, width, settings)


def settle(window: Window, track: Track, settings: Settings) -> Track:
    """Refit every template with the trend of its neighbours."""
    known = trends(list(track.templates))
    settings = settings.marching()
    bins = np.zeros((2, _BINS))
    judged = []
    base = Found(np.zeros((len(known), 3)), np.zeros((len(known), 3, 3)), np.zeros(len(known)))
    for i in range(len(known)):
        new, points = _refit(window, known, i, settings)
        appraise.add_misfit(bins, points, *new.shape, misfit_scale(new))
        one = terms_of(points, new, settings)
        base.terms[i], base.information[i], base.points[i] = one.terms[0], one.information[0], one.points[0]
        judged.append(new)
    return Track(tuple(judged), track.stop, bins, base)


def settle_base(window: Window, track: Track, settings: Settings) -> Track:
    """The settled track settled again on a curved base, where it is one beyond chance, until that stays."""
    for _ in range(_BASE_ROUNDS):
        before = track.templates
        if track.base is not None and track.base.significant(settings.base_chance):
            known = curved(before, track.base)
        elif any(t.base.any() for t in before):
            known = tuple(t.changed(base=np.zeros(3), base_std=np.zeros(3)) for t in before)
        else:
            break
        track = settle(window, Track(known, track.stop), settings)
        if _alike(before, track.templates):
            break
    return track


def _alike(before: tuple[Template, ...], after: tuple[Template, ...]) -> bool:
    """Whether height and width of all templates changed by less than a part of their standard deviation."""
    return all(
        b.std is not None
        and abs(a.height - b.height) < _SETTLED * b.std[6]
        and abs(a.width - b.width) < _SETTLED * b.std[7]
        for a, b in zip(before, after, strict=True)
    )


def _refit(window: Window, known: list[Template], i: int, settings: Settings) -> tuple[Template, Array]:
    """The i-th template refitted and judged, as it was where the fit failed; and the points in its window."""
    new = refine(window, known[i], _expected(known, i, settings), settings)
    if new.status in ("failed", "no data"):
        new = known[i]
    points = window(new)
    return judge(points, new, settings), points


def misfit_scale(template: Template) -> float:
    """Unit of the residuals that tell a wrong section: the noise, at least two per cent of the height."""
    return max(template.scale, 0.02 * abs(template.height), 1e-300)


def finish_ends(window: Window, track: Track, settings: Settings) -> Track:
    """The settled track without end templates that are no ridge, its ends placed again.

    An end template whose length changed much is refitted; one that dropped out is not replaced.
    """
    templates = list(track.templates)
    while len(templates) > 1 and not _stands(templates[-1], settings):
        templates.pop()
    while len(templates) > 1 and not _stands(templates[0], settings):
        templates.pop(0)
    placed = list(place_ends(window, Track(tuple(templates), track.stop), settings).templates)
    for i, before in ((0, templates[0]), (-1, templates[-1])):
        if abs(placed[i].length / before.length - 1) > _SAME_LENGTH:
            placed[i], _ = _refit(window, placed, i % len(placed), settings.marching())
    return Track(tuple(placed), track.stop, track.misfit)


def _stands(template: Template, settings: Settings) -> bool:
    return (
        template.evidence >= settings.going_on
        and template.status != "no data"
        and bool(template.std is not None and np.isfinite(template.std).all())
    )
