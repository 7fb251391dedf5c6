"""Where a ridge ends: the change point of its last template, as the templates before it let expect it."""

from __future__ import annotations

import math
import statistics
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.improve import FEWEST_POINTS, loss_of
from ridgefeature.kernels import chain
from ridgefeature.march import GOES_ON, Track, reverse
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]
_BEFORE_END = 4
"""Templates before the last one that tell what to expect of it."""
_BEYOND_CHANCE = 2.0
"""Evidence, in parts of what is needed to go on, above which a template lies on the ridge beyond doubt."""


def trends(templates: list[Template], closed: bool = False) -> list[Template]:
    """Each template with the path's curvature and the slopes of height and width that its neighbours show.

    closed: the first follows the last.
    """
    if closed:
        return trends([templates[-1], *templates, templates[0]])[1:-1]
    rows = chain.trends(
        np.array([t.position for t in templates]),
        np.array([t.rotation for t in templates]),
        np.array([(t.height, t.width) for t in templates]),
        np.array([t.half_breadth for t in templates]),
    )
    return [t.changed(trend=row) for t, row in zip(templates, rows, strict=True)]


def _change_point(window: Window, template: Template, reach: float, settings: Settings) -> float | None:
    """Where along x, from its start to `reach`, the ridge ends; None if there are too few points."""
    points = window(template, 1.0, 2 * reach / template.length)
    if len(points) < FEWEST_POINTS:
        return None
    # Far ahead the slopes are extrapolation: neither height nor width may change by more than a third.
    bend, rise, widening = template.trend
    most, widest = 0.3 * abs(template.height) / reach, 0.3 * template.width / reach
    trend = np.array([bend, min(max(rise, -most), most), min(max(widening, -widest), widest)])
    # Errors of the extrapolation must not count as noise.
    scale = max(template.scale, 0.1 * abs(template.height))
    end = chain.change_point(
        points,
        template.height,
        template.width,
        trend,
        template.section.table,
        scale,
        *loss_of(settings),
    )
    return max(float(end), -0.5 * template.length)


def _trim_end(window: Window, templates: list[Template], settings: Settings) -> list[Template]:
    """Templates whose last one ends where the ridge does: shortened, lengthened or dropped."""
    templates = [*templates[:-2], *trends(templates[-3:])[-2:]]
    while True:
        last = templates[-1]
        model = _as_expected(templates, settings)
        end = _change_point(window, model, 1.5 * last.length, settings)
        if end is None:
            return templates
        end += float(last.rotation[:, 0] @ (model.position - last.position))
        rest = end + 0.5 * last.length
        if rest >= 0.45 * last.length or len(templates) == 1:
            end = max(end, 0.0) if len(templates) == 1 else min(end, last.length)
            return [*templates[:-1], _relength(last, -0.5 * last.length, end)]
        templates = templates[:-1]


def _as_expected(templates: list[Template], settings: Settings) -> Template:
    """The last template as those before it let expect it.

    A template that lies half beyond the end is fitted too low or too narrow, and too steep: such a ridge
    looks as if it went on for ever. So its height and width are those expected where these are more. One that
    hardly stands out may lie on noise alone: it is put where the path leads.
    """
    last, inner = templates[-1], templates[-1 - _BEFORE_END : -1]
    if not inner:
        return last
    places = np.array([t.position for t in (*inner, last)])
    height, rise = _extrapolated(places, [t.height for t in inner])
    width, widening = _extrapolated(places, [t.width for t in inner])
    model = last.changed(
        height=height if abs(height) > abs(last.height) else last.height,
        width=max(width, last.width),
        trend=np.array([last.trend[0], rise, widening]),
        scale=statistics.median([t.scale for t in (*inner, last)]),
    )
    if last.evidence > _BEYOND_CHANCE * settings.going_on:
        return model
    frames = np.array([t.rotation for t in inner[-3:]])
    found = chain.starts(places[:-1][-3:], frames, inner[-1].length, last.length)
    trend = np.array([0.0, rise, widening])
    return model.changed(position=found[0][0], rotation=found[1][0], trend=trend)


def _extrapolated(places: Array, values: list[float]) -> tuple[float, float]:
    """Values at all places (n, 3) but the last as a straight line continues them to the last; its slope.

    The value changes by less than a third of the last one.
    """
    before = [0.0]
    for a, b in zip(places[-2::-1], places[:0:-1], strict=True):
        before.append(before[-1] - math.dist(a, b))
    at = before[:0:-1]
    middle, mean = sum(at) / len(at), sum(values) / len(at)
    square = sum((x - middle) ** 2 for x in at)
    slope = sum((x - middle) * v for x, v in zip(at, values, strict=True)) / square if square > 0 else 0.0
    most = 0.3 * abs(values[-1])
    return values[-1] + min(max(mean - slope * middle - values[-1], -most), most), slope


def _relength(template: Template, low: float, high: float) -> Template:
    """The patch from x = low to x = high of the template's own frame, on its bent path."""
    return template.slid(0.5 * (low + high)).changed(length=float(high - low))


def place_ends(window: Window, track: Track, settings: Settings) -> Track:
    """The track with its end templates cut to where the ridge ends, unless it goes on beyond the march.

    A ring has no ends.
    """
    if track.closed:
        return track
    templates = list(track.templates)
    if not track.stop[1].startswith(GOES_ON):
        templates = _trim_end(window, templates, settings)
    if not track.stop[0].startswith(GOES_ON):
        turned = [reverse(t) for t in reversed(templates)]
        forth = dict(zip(map(id, turned), reversed(templates), strict=True))
        backwards = _trim_end(window, turned, settings)
        templates = [forth.get(id(t)) or reverse(t) for t in reversed(backwards)]
    return replace(track, templates=tuple(templates))
