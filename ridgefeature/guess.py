"""GUESS: the first template, from the picked point alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.alternatives import distinct
from ridgefeature.curvature import SEEN, improve_on_base, less_noisy
from ridgefeature.improve import improve, sized
from ridgefeature.kernels.algebra import facing
from ridgefeature.kernels.evidence import explained
from ridgefeature.section import Section, plateau
from ridgefeature.settings import Settings
from ridgefeature.starts import CLEAR, Hints, Start, high_starts, starts_about
from ridgefeature.template import STEEP, Template
from ridgefeature.window import Window

Array = NDArray[np.float64]
_FEWEST_TRIES = 2
_DISTINCT = 0.1
"""What one template must have of the evidence that tells a whole ridge from other surfaces."""
_AIM = 0.25
"""Standard deviation of the pick's distance from the crest, in widths."""
_MUCH_NOISE, _MOST_NOISE = 0.35, 0.15
"""Noise, in heights, from which on a fit on steep flanks is not looked at further; is none."""
_MANY_TRIED = 0.6
"""How well it explains its window counts by that much less."""
_Best = tuple[bool, float, Template]
"""Whether neither a smooth surface nor an edge explains the window of a fit too, how well it does, and it."""


def _template(start: Start, pick: Array, hints: Hints, section: Section, settings: Settings) -> Template:
    frame, width = start.frame, start.width
    _, angle, offset, height, a, b, c = start.found
    normal = frame @ (np.array([-b, -c, 1.0]) / np.sqrt(1 + b * b + c * c))
    if (height < 0) != (hints.kind == "groove"):
        normal, height = -normal, -height
    along = frame @ np.array([np.cos(angle), np.sin(angle), 0.0])
    foot = offset * width * np.array([-np.sin(angle), np.cos(angle)])
    position = pick + frame @ np.array([foot[0], foot[1], a + b * foot[0] + c * foot[1]])
    if hints.height is not None:
        height = np.copysign(hints.height, height)
    return Template(
        position,
        facing(normal, along),
        width,
        float(height),
        settings.length * width,
        settings.flank * width,
        section,
    )


def guess(
    window: Window,
    pick: Array,
    extent: float,
    hints: Hints,
    section: Section,
    settings: Settings,
    aimed: bool = True,
    high: bool = False,
) -> Template | None:
    """First template, already improved; None where no straight ridge explains the points about the pick.

    For every width on a geometric ladder the best direction and offset are found; these starts are improved,
    the best first and at least two, until one is clear, and the one that explains most is kept: of those that
    neither a smooth surface nor an edge explains as well, if there are any. If none is clear, ridges on steep
    flanks are tried too. aimed: of ridges side by side the one nearer to the pick counts more; high: only
    those on steep flanks are tried. `extent`, about the diameter of the scan, bounds the widths. A hinted
    direction (to 10 degrees) and width leave less to try.
    """
    known = window, pick, extent, settings, aimed
    best: _Best | None = None
    starts = () if high else starts_about(window, pick, extent, hints, section)
    for tried, start in enumerate(starts):
        if tried >= _FEWEST_TRIES and _is_clear(best):
            break
        fitted = _fitted(window, _template(start, pick, hints, section, settings), pick, settings)
        best = _better(best, fitted, False, *known)
    if not _is_clear(best):
        steep = plateau() if settings.section == "auto" else section
        # Look-ups of their own: what is tried here must not change what is seen later.
        apart = replace(window, source=window.source and replace(window.source))
        for start in high_starts(apart, pick, extent, hints, steep):
            fitted = _fitted(apart, _template(start, pick, hints, steep, settings), pick, settings)
            if not 0.0 < fitted.scale < _MUCH_NOISE * abs(fitted.height):
                continue
            # Of one flank seen from below, as a ridge beside the ground, nothing is left in a longer window.
            fitted = _fitted(apart, sized(fitted, settings), pick, settings)
            if _stands_high(fitted, settings):
                best = _better(best, fitted, True, apart, *known[1:])
    if best is None:
        return None
    # The length still is that of the start's width, so window and fit get one more round together: unless the
    # ground about the longer one, taken for flat, is what it then fits.
    last = _fitted(window, sized(best[2], settings), pick, settings)
    least = _DISTINCT * settings.distinct
    lost = best[0] and distinct(window, last, settings) < least <= distinct(window, best[2], settings)
    return best[2] if lost else last


def _is_clear(best: _Best | None) -> bool:
    return best is not None and best[0] and best[1] > CLEAR


def _better(
    best: _Best | None,
    fitted: Template,
    high: bool,
    window: Window,
    pick: Array,
    extent: float,
    settings: Settings,
    aimed: bool,
) -> _Best | None:
    """The better one of the best fit so far and another.

    high: it is one on steep flanks. Many of them are tried, so one of them must be better beyond chance, and
    tell a ridge from other surfaces on its own.
    """
    score = _score(window, fitted, pick, aimed) * (_MANY_TRIED if high else 1.0)
    if score <= 0 or fitted.width > settings.widest * extent:
        return best
    if best is not None and best[0] and score <= best[1]:
        return best
    clear = distinct(window, fitted, settings) >= (1.0 if high else _DISTINCT) * settings.distinct
    if high and not clear:
        return best
    return (clear, score, fitted) if best is None or (clear, score) > best[:2] else best


def _stands_high(fitted: Template, settings: Settings) -> bool:
    """Whether a fit on steep flanks is about a ridge: an edge between planes looks like a very high one."""
    height = abs(fitted.height)
    steep = STEEP * fitted.width <= height <= settings.steepest * fitted.width
    return steep and fitted.scale < _MOST_NOISE * height


def _fitted(window: Window, start: Template, pick: Array, settings: Settings) -> Template:
    """The start improved on a flat base, or on a curved one where that is told and fits better."""
    flat = improve(window, start, settings)
    curved = improve_on_base(window, start, settings)
    if curved is None or not less_noisy(curved, flat) or _score(window, curved, pick) <= 0:
        return flat
    if curved.points < SEEN * flat.points:
        return flat
    return curved


def _score(window: Window, template: Template, pick: Array, aimed: bool = False) -> float:
    """How well a template explains its window, counting 300 points at most; 0 if it misses the pick.

    aimed: less if it lies beside the pick. Where ridges lie side by side the one that was aimed at is meant.
    """
    if template.status in ("failed", "no data") or template.height == 0:
        return 0.0
    local = template.rotation.T @ (pick - template.position)
    if abs(local[1]) > 0.55 * template.width:
        return 0.0
    points = window(template)
    near = math.exp(-0.5 * (local[1] / (_AIM * template.width)) ** 2) if aimed else 1.0
    return near * min(len(points), 300) * float(explained(points, *template.shape))
