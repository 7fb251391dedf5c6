"""After the march: refit every template knowing its neighbours, and let its ends stand or fall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.continuation import FLAT, append, met
from ridgefeature.curvature import Found, curved, joined, terms_of
from ridgefeature.ends import place_ends, trends
from ridgefeature.improve import Limits, judge, limits_of, refine
from ridgefeature.kernels import appraise
from ridgefeature.march import RAN_BACK, Track, reverse
from ridgefeature.neighbours import FEWEST, advances, between, follows, tipped
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]

_BINS = 16
_SAME_LENGTH = 0.15
_CLOSE = 1.5
"""Distance of the neighbours of a template, in their mean lengths, up to which they do without it."""
_BASE_ROUNDS = 4
_SETTLED = 0.1
"""Change in standard deviations from round to round below which a base counts as found."""


def _near(templates: list[Template], i: int, closed: bool) -> list[Template]:
    """The neighbours of the i-th template, the one before it first."""
    n = len(templates)
    return [templates[k % n] for k in (i - 1, i + 1) if closed or 0 <= k < n]


def _expected(templates: list[Template], i: int, closed: bool, settings: Settings) -> Limits:
    """Limits of the i-th template about the mean of its neighbours."""
    near = _near(templates, i, closed) or [templates[i]]
    height = sum(t.height for t in near) / len(near)
    width = sum(t.width for t in near) / len(near)
    return limits_of(height, width, settings)


def settle(window: Window, track: Track, settings: Settings) -> Track:
    """Refit every template with the trend of its neighbours; none is left where it does not advance."""
    known = trends(list(track.templates), track.closed)
    settings = settings.marching()
    bins = np.zeros((2, _BINS))
    judged: list[Template] = []
    told: dict[int, Found] = {}
    for i in range(len(known)):
        new, points = _refit(window, known, i, track.closed, settings)
        appraise.add_misfit(bins, points, *new.shape, misfit_scale(new))
        if not settings.flat:
            told[id(new)] = terms_of(points, new, settings)
        judged.append(new)
    mended = mend(window, known, judged, track.closed, settings)
    if not track.closed:
        # What went on beyond the ridge's end tells nothing of the base under it.
        mended = _standing(mended, settings)
    if track.closed and len(mended) < FEWEST:
        track = replace(track, closed=False, stop=(FLAT, FLAT))
    if settings.flat:
        return replace(track, templates=tuple(mended), misfit=bins)
    base = [told.get(id(t)) or terms_of(window(t), t, settings) for t in mended]
    return replace(track, templates=tuple(mended), misfit=bins, base=joined(base))


def settle_base(window: Window, track: Track, settings: Settings) -> Track:
    """The settled track settled again on a curved base, where it is one beyond chance, until that stays."""
    for _ in range(0 if settings.flat else _BASE_ROUNDS):
        before = track.templates
        if track.base is not None and track.base.significant(settings.base_chance):
            known = curved(before, track.base)
        elif any(t.curved for t in before):
            known = tuple(t.changed(base=np.zeros(3), base_std=np.zeros(3)) for t in before)
        else:
            break
        track = settle(window, replace(track, templates=known), settings)
        if _alike(before, track.templates):
            break
    return track


def _alike(before: tuple[Template, ...], after: tuple[Template, ...]) -> bool:
    """Whether height and width of all templates changed by less than a part of their standard deviation."""
    return len(before) == len(after) and all(
        b.std is not None
        and abs(a.height - b.height) < _SETTLED * b.std[6]
        and abs(a.width - b.width) < _SETTLED * b.std[7]
        for a, b in zip(before, after, strict=True)
    )


def _refit(
    window: Window, known: list[Template], i: int, closed: bool, settings: Settings
) -> tuple[Template, Array]:
    """The i-th template refitted and judged, as it was where the fit failed; and the points in its window."""
    new = refine(window, known[i], _expected(known, i, closed, settings), settings)
    if new.status in ("failed", "no data"):
        new = known[i]
    points = window(new)
    return judge(points, new, settings), points


def mend(
    window: Window, before: list[Template], after: list[Template], closed: bool, settings: Settings
) -> list[Template]:
    """Settled templates, those that went astray refitted from where their neighbours lead.

    before: the same templates before settling. Of two that do not follow each other the one astray is that
    which moved more. A template that does not advance even then is interpolated, at an end dropped; one whose
    base tips over is kept unless another fit agrees with its neighbours.
    """
    templates, moved = list(after), [_moved(a, b) for a, b in zip(before, after, strict=True)]
    i = 0 if closed else 1
    while i < len(templates) and len(templates) > 1:
        j = i if moved[i] >= moved[i - 1] else (i - 1) % len(templates)
        if advances(templates[i - 1], templates[i]):
            i += 1
            continue
        new = _led(window, templates, j, closed, settings)
        if new is None:
            del templates[j], moved[j]
            i = max(i - 1, 0 if closed else 1)
            continue
        templates[j], moved[j] = new, -1.0
        i += 1
    return _levelled(window, templates, closed, settings)


def _levelled(window: Window, templates: list[Template], closed: bool, settings: Settings) -> list[Template]:
    """The templates, those whose base tips over refitted on that of their neighbours where it fits better."""
    n = len(templates)
    for i, template in enumerate(templates):
        near = _near(templates, i, closed)
        if len(near) == 1 and n > 2:
            near.append(templates[2 if i == 0 else n - 3])
        if len(near) < 2 or not tipped(template, near):
            continue
        if closed or 0 < i < n - 1:
            start = between(near[0], near[1])
        else:
            step = float(near[0].rotation[:, 0] @ (template.apex - near[0].apex))
            start = near[0].changed(trend=near[0].trend * np.array([1.0, 0.0, 0.0])).slid(step)
        new = _fitted(window, start.changed(length=template.length), settings)
        if new is None or new.evidence < template.evidence or tipped(new, near):
            continue
        chain = [*templates[:i], new, *templates[i + 1 :]]
        if follows(chain, i, closed):
            templates = chain
    return templates


def _fitted(window: Window, start: Template, settings: Settings) -> Template | None:
    """The template fitted from a start that neighbours lead to; None where there is no ridge."""
    new = refine(window, start, limits_of(start.height, start.width, settings), settings)
    if new.status in ("failed", "no data") or new.evidence < settings.going_on:
        return None
    return judge(window(new), new, settings)


def _moved(before: Template, after: Template) -> float:
    """How far a template went along the ridge, in its lengths, told by its crest."""
    x = before.rotation[:, 0] + after.rotation[:, 0]
    return abs(float((after.apex - before.apex) @ x)) / float(np.linalg.norm(x)) / before.length


def _led(
    window: Window, templates: list[Template], i: int, closed: bool, settings: Settings
) -> Template | None:
    """The i-th template fitted from where its neighbours lead, or else interpolated.

    None where it is not needed or not known: at an end, and where its neighbours follow each other closely.
    """
    near = _near(templates, i, closed)
    if len(near) < 2 or near[0] is near[1]:
        return None
    apart = float(np.linalg.norm(near[1].position - near[0].position))
    if apart < _CLOSE * 0.5 * (near[0].length + near[1].length):
        return None
    start = between(near[0], near[1])
    fitted = _fitted(window, start.changed(length=templates[i].length), settings)
    if fitted is not None and advances(near[0], fitted) and advances(fitted, near[1]):
        return fitted
    return start


def misfit_scale(template: Template) -> float:
    """Unit of the residuals that tell a wrong section: the noise, at least two per cent of the height."""
    return max(template.scale, 0.02 * abs(template.height), 1e-300)


def finish_ends(window: Window, track: Track, settings: Settings) -> Track:
    """The settled track without end templates that are no ridge, its ends placed again.

    An end template whose length changed much is refitted; one that dropped out is not replaced. A ring has
    no ends.
    """
    if track.closed:
        return track
    templates = _standing(list(track.templates), settings)
    stop = _still_back(templates, track.stop, settings)
    placed = list(place_ends(window, Track(tuple(templates), stop), settings).templates)
    for i, before in ((0, templates[0]), (-1, templates[-1])):
        if abs(placed[i].length / before.length - 1) > _SAME_LENGTH:
            placed[i], _ = _refit(window, placed, i % len(placed), False, settings.marching())
    if len(placed) > 2:
        placed = _following(placed)
    return replace(track, templates=tuple(placed), stop=stop)


def _still_back(templates: list[Template], stop: tuple[str, str], settings: Settings) -> tuple[str, str]:
    """Why both ends stopped; one that ran back into the ridge did not if what lay there dropped out."""
    reasons = list(stop)
    for i in (0, 1):
        if reasons[i] != RAN_BACK:
            continue
        chain = templates if i else [reverse(t) for t in reversed(templates)]
        ahead = append(chain, settings)[0]
        if all(met(ahead.slid(x * ahead.length), chain[:-2]) < 0 for x in (0.0, 1.0)):
            reasons[i] = FLAT
    return reasons[0], reasons[1]


def _following(templates: list[Template]) -> list[Template]:
    """The templates without end ones that turned back onto their neighbours when they were refitted."""
    first = 0 if advances(templates[0], templates[1]) else 1
    last = len(templates) if advances(templates[-2], templates[-1]) else -1
    return templates[first:last]


def _standing(templates: list[Template], settings: Settings) -> list[Template]:
    """The templates without end ones that are no ridge; one of them at least."""
    standing = [i for i, template in enumerate(templates) if _stands(template, settings)]
    return templates[standing[0] : standing[-1] + 1] if standing else templates[:1]


def _stands(template: Template, settings: Settings) -> bool:
    return (
        template.evidence >= settings.going_on
        and template.status != "no data"
        and bool(template.std is not None and np.isfinite(template.std).all())
    )
