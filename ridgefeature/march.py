"""The march: APPEND template after template, both ways from the first, and say why each end stopped."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ridgefeature.alternatives import distinct
from ridgefeature.continuation import (
    FLAT,
    OUTGROWN_IF_MISFIT,
    across,
    append,
    met,
    misfits,
    outgrown,
    reject,
    risen,
    round_corner,
    sparse,
)
from ridgefeature.curvature import Ahead, Found
from ridgefeature.improve import improve, start_loss
from ridgefeature.neighbours import comes_home
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]
Progress = Callable[[Template], None]

INTERRUPTED = "interrupted"
RAN_BACK = "it ran back into itself"
CAME_HOME = "it came back to where it began"
GOES_ON = (INTERRUPTED, RAN_BACK, CAME_HOME, "max_templates")
"""How the reasons of a march begin that stopped though the ridge goes on."""
_WEAK = 5.0
"""Evidence in parts of what is needed to go on, below which a ridge hardly stands out."""
_ALIKE = math.cos(math.radians(8.0))
_AT_LIMIT = 0.98
"""Height of a fit, in the most that it may have, from which on it may be higher."""
_POOR_START = 0.5
"""Mean loss of a start, in noise scales, above which the other starts are looked at."""
_HOPELESS = 3.0
"""Evidence below which further starts at the same place are not tried."""
_WORSE = 1.5
"""A fit whose noise is this many times that usual of the last three templates is suspect."""
_EDGE = 10.0
"""Evidence against an edge below which a template that rises high above the last ones is one."""
_FITS_NOT = 0.35
"""Noise, in heights, above which such a fit is none."""

_TURNED = np.array([-1.0, -1.0, 1.0])
"""Signs of the axes for someone who walks the other way."""


@dataclass(frozen=True, eq=False)
class Track:
    """Templates in order along the ridge, and why each end stopped."""

    templates: tuple[Template, ...]
    stop: tuple[str, str]
    misfit: Array | None = None
    """(2, m) number and sum of residuals by distance from the spine, once the track is settled."""
    closed: bool = False
    """Whether the first template follows the last: a ring."""
    base: Found | None = None
    """What the windows say of the base's curvature, then."""


def reverse(template: Template) -> Template:
    """The same patch, seen by someone who walks the other way."""
    return template.changed(
        rotation=template.rotation * _TURNED,
        trend=-template.trend,
    )


def _fit_next(
    rough: Window, full: Window, chain: list[Template], gap: bool, settings: Settings
) -> tuple[Template, Template, str]:
    """Start and fit of the next template, and why it is none.

    The start that the data favour is fitted. Where that is rejected, or fits much worse than the template
    before, the other starts are tried, and last all points of the window instead of some; the best fit is
    kept. Where the ridge hardly stands out, its end is told from a template as long as may be.
    """
    found = _fit_best(rough, full, chain, append(chain, settings), gap, settings)
    found = _at_limit(rough, full, chain, found, gap, settings)
    if not found[2] and risen(found[1], chain) and distinct(rough, found[1], settings) < _EDGE:
        return (*found[:2], "no ridge: it runs into an edge")
    if not found[2] and not gap and misfits(found[1], chain):
        other = across(rough, chain, settings) or round_corner(rough, chain, settings)
        if other is not None:
            return other
        if found[1].scale > _FITS_NOT * abs(found[1].height):
            return (*found[:2], "no ridge: what follows has another section")
        return (*found[:2], outgrown(found[1], chain, OUTGROWN_IF_MISFIT))
    if found[2] and not gap and chain[-1].evidence > _WEAK * settings.going_on:
        return round_corner(rough, chain, settings, found[2].startswith(FLAT)) or found
    if not found[2].startswith(FLAT):
        return found
    for known in (chain, _without_last(chain, settings)):
        longer = _fit_best(rough, full, known, append(known, settings, longest=True), gap, settings)
        if not longer[2]:
            return longer
    return found


def _at_limit(
    rough: Window,
    full: Window,
    chain: list[Template],
    found: tuple[Template, Template, str],
    gap: bool,
    settings: Settings,
) -> tuple[Template, Template, str]:
    """A fit that was no ridge as high as it may be, tried from there: ends that fade rise in no time."""
    start, fitted, why = found
    if not why or abs(fitted.height) < _AT_LIMIT * settings.height_change * abs(start.height):
        return found
    again = _fit_best(rough, full, chain, [start.changed(height=fitted.height)], gap, settings)
    return found if again[2] else again


def _without_last(chain: list[Template], settings: Settings) -> list[Template]:
    """The chain with its last template put where those before it lead: it may have been a bad fit."""
    if len(chain) < 3:
        return chain
    last, expected = chain[-1], append(chain[:-1], settings)[0]
    return [*chain[:-1], expected.changed(length=last.length, points=last.points, evidence=last.evidence)]


def _fit_best(
    rough: Window, full: Window, chain: list[Template], starts: list[Template], gap: bool, settings: Settings
) -> tuple[Template, Template, str]:
    """The start whose fit is best, this fit, and why it is none."""
    starts, alike = _unlike(starts)
    suspect = _WORSE * statistics.median(t.scale for t in chain[-3:])
    if len(starts) > 1 and start_loss(rough, starts[0], chain[-1].scale) > _POOR_START:
        starts.sort(key=lambda start: start_loss(rough, start, chain[-1].scale))
    best: tuple[Template, Template, str] | None = None
    tries = [*((s, rough) for s in starts), *((s, rough) for s in alike), (starts[0], full)]
    for i, (start, window) in enumerate(tries):
        if best is not None and i >= len(starts) and best[1].evidence < _HOPELESS:
            break
        fitted = improve(window, start, settings)
        why = (
            reject(fitted, start, settings, gap)
            or outgrown(fitted, chain)
            or sparse(full, fitted, chain, gap)
        )
        if best is None or (best[2] and not why) or (not why and fitted.scale < best[1].scale):
            best = start, fitted, why
        if fitted.status == "no data" or (not why and fitted.scale < suspect):
            break
    return best  # type: ignore[return-value]


def _unlike(starts: list[Template]) -> tuple[list[Template], list[Template]]:
    """The starts apart from those that face nearly as an earlier one does, and these."""
    kept: list[Template] = []
    alike: list[Template] = []
    for start in starts:
        same = any(start.rotation[:, 0] @ other.rotation[:, 0] >= _ALIKE for other in kept)
        (alike if same else kept).append(start)
    return kept, alike


def march_one_way(
    rough: Window,
    full: Window,
    known: list[Template],
    found: list[Template],
    settings: Settings,
    progress: Progress | None = None,
) -> str:
    """Append the templates that follow `known` to `found`, and tell why the march stopped.

    known: what is known so far, in the direction of the march; not changed.
    """
    chain, reason, skipped = list(known), "", 0.0
    base = Ahead(settings)
    chain[-3:] = [base.add(rough, template) for template in chain[-3:]]
    while len(known) + len(found) < settings.max_templates:
        start, fitted, why = _fit_next(rough, full, chain, skipped > 0, settings)
        if why:
            reason = reason or why
            skipped += start.length
            if skipped > settings.look_ahead * start.width:
                return reason
            chain.append(start)
            continue
        whole = [*known, *found]
        on = met(fitted, whole[:-2])
        if on >= 0:
            return CAME_HOME if comes_home(fitted, whole, on) else reason or RAN_BACK
        reason, skipped = "", 0.0
        found.append(fitted)
        chain.append(base.add(rough, fitted))
        if progress is not None:
            progress(fitted)
    return f"max_templates ({settings.max_templates}) reached"


def march(
    rough: Window, full: Window, first: Template, settings: Settings, progress: Progress | None = None
) -> Track:
    """March both ways from the first template; an interrupt ends it and keeps what is there."""
    settings = settings.marching()
    ahead: list[Template] = []
    back: list[Template] = []
    why_ahead = why_back = INTERRUPTED
    try:
        if progress is not None:
            progress(first)
        why_ahead = march_one_way(rough, full, [first], ahead, settings, progress)
        if why_ahead != CAME_HOME:
            known = [reverse(t) for t in [*reversed(ahead), first]]
            why_back = march_one_way(rough, full, known, back, settings, progress)
    except KeyboardInterrupt:
        pass
    templates = (*(reverse(t) for t in reversed(back)), first, *ahead)
    return Track(templates, (why_back, why_ahead), closed=CAME_HOME in (why_ahead, why_back))
