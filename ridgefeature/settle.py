"""After the march: place both ends, then refit every template knowing its neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.improve import FEWEST_POINTS, Limits, judge, limits_of, loss_of, refine
from ridgefeature.kernels import appraise, chain
from ridgefeature.kernels.algebra import rotation_of
from ridgefeature.march import GOES_ON, Track, reverse
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]

_BINS = 16
_SAME_LENGTH = 0.15
_BEFORE_END = 4
"""Templates before the last one that tell what to expect of it."""


def trends(templates: list[Template]) -> list[Template]:
    """Each template with the path's curvature and the slopes of height and width that its neighbours show."""
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
        end = _change_point(window, _as_expected(templates), 1.5 * last.length, settings)
        if end is None:
            return templates
        rest = end + 0.5 * last.length
        if rest >= 0.45 * last.length or len(templates) == 1:
            end = max(end, 0.0) if len(templates) == 1 else min(end, last.length)
            return [*templates[:-1], _relength(last, -0.5 * last.length, end)]
        templates = templates[:-1]


def _as_expected(templates: list[Template]) -> Template:
    """The last template with the height and width that those before it let expect, where these are more.

    A template that lies half beyond the end is fitted too low or too narrow, and too steep: such a ridge
    looks as if it went on for ever.
    """
    last, inner = templates[-1], templates[-1 - _BEFORE_END : -1]
    if not inner:
        return last
    places = np.array([t.position for t in templates[-1 - len(inner) :]])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    sizes = np.array([(t.height, t.width) for t in inner])
    (height, width), slopes = _extrapolated(-np.cumsum(steps[::-1])[::-1], sizes)
    height = height if abs(height) > abs(last.height) else last.height
    trend = np.array([last.trend[0], *slopes])
    return last.changed(height=float(height), width=float(max(width, last.width)), trend=trend)


def _extrapolated(at: Array, sizes: Array) -> tuple[Array, Array]:
    """Heights and widths (n, 2) at distances (n,) before 0, continued by a straight line to 0; its slopes.

    They change by less than a third of the last ones.
    """
    ahead = at - at.mean()
    square = ahead @ ahead
    slopes = ahead @ sizes / square if square > 0 else np.zeros(2)
    change = sizes.mean(axis=0) - slopes * at.mean() - sizes[-1]
    return sizes[-1] + np.clip(change, -0.3 * abs(sizes[-1]), 0.3 * abs(sizes[-1])), slopes


def _relength(template: Template, low: float, high: float) -> Template:
    """The patch from x = low to x = high of the template's own frame, on its bent path."""
    middle = 0.5 * (low + high)
    bend = template.trend[0]
    turn, _ = rotation_of(np.array([0.0, 0.0, bend * middle]))
    shift = np.array([middle, 0.5 * bend * middle**2, 0.0])
    return template.changed(
        position=template.position + template.rotation @ shift,
        rotation=template.rotation @ turn,
        length=float(high - low),
        height=float(template.height + template.trend[1] * middle),
        width=float(max(template.width + template.trend[2] * middle, 0.5 * template.width)),
    )


def place_ends(window: Window, track: Track, settings: Settings) -> Track:
    """The track with its end templates cut to where the ridge ends, unless it goes on beyond the march."""
    templates = list(track.templates)
    if not track.stop[1].startswith(GOES_ON):
        templates = _trim_end(window, templates, settings)
    if not track.stop[0].startswith(GOES_ON):
        backwards = _trim_end(window, [reverse(t) for t in reversed(templates)], settings)
        templates = [reverse(t) for t in reversed(backwards)]
    return Track(tuple(templates), track.stop)


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
    for i in range(len(known)):
        new, points = _refit(window, known, i, settings)
        appraise.add_misfit(bins, points, *new.shape, misfit_scale(new))
        judged.append(new)
    return Track(tuple(judged), track.stop, bins)


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
