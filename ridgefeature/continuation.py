"""How a ridge may go on from its last template: straight on, over others that cross it, behind a corner; and
what is no continuation."""

from __future__ import annotations

import math
import statistics

import numpy as np

from ridgefeature.curvature import starts_on_base
from ridgefeature.improve import FEWEST_POINTS, improve, sized, start_loss
from ridgefeature.kernels.base import seen_from
from ridgefeature.neighbours import LEAST_ADVANCE, advances
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

FLAT = "no ridge: the data agree with a flat base"
_MISFIT, _LEAST_MISFIT = 2.0, 0.1
"""A fit whose noise is this many times the least of the last five, and this part of its height, has met
something else."""
_STEPS_ACROSS = (0.4, 0.55, 0.7, 0.85, 1.0)
"""How far beyond a place where ridges meet this one is looked for, in parts of how far to look ahead."""
_SHARPEST = (-60.0, 60.0, -90.0, 90.0)
_CORNERS = (-30.0, 30.0, *_SHARPEST)
_CORNERS_TRIED = 3
_WITHIN = 0.5
"""Lengths before the end of a template from which on it may lie in a bend."""
_WORSE_WITHIN = 1.6
"""Most noise behind such a bend, in the least of the last five: beside an end may lie another ridge."""
_CORNER_RADIUS = 0.5
_ABOUT_STRAIGHT = (-30.0, 30.0)
_WORSE_ACROSS = (3.0, 1.5)
"""Most noise of a template beyond a crossing, straight on and in a bend, in the least of the last five."""
_MISSES = 0.02
"""Noise in heights that any of them may have: so much a section misses the points by."""
_BEYOND_EVIDENCE = 0.3
"""Least evidence of a template behind a bend or crossing, in parts of that of the one before."""
USUAL = 5
_OUTGROWN, OUTGROWN_IF_MISFIT = 2.5, 1.8
"""Width of a template, in parts of the median of the last five, that is another ridge's; and of one that fits
much worse than these."""
_RISEN, _FEW = 1.5, 3
"""Height of a template, in the same part, from which on it is asked whether it is one of a ridge at all; how
many tell what was usual."""
_FEWER, _NOISY = 0.75, 1.2
"""Points of a template, in usual ones, below which their density is looked at; noise beyond a gap, in that
usual, above which it is."""
_SPARSE = 0.35, 0.42
"""Density of strays alone, in that of the last templates: of few points, of noisy ones."""
_LARGEST_TURN = np.radians(60.0)


def append(chain: list[Template], settings: Settings, longest: bool = False) -> list[Template]:
    """Starts of the next template, one for each way the ridge may go on.

    The first row lies on the last row of the last template of the chain; width and height are kept; the base
    is that of the last three together. The ridge goes on turning as the last three centres do, or straight
    on, along the chord of the last two centres or along the last template's own direction, whatever the data
    then favour: a chord is known better, but lags at a kink.
    """
    last, near = chain[-1], chain[-3:]
    length = sized(last, settings).length
    if longest:
        length = settings.longest * settings.length * last.width
    positions = np.array([t.position for t in near])
    frames = np.array([t.rotation for t in near])
    start = last.changed(
        length=length,
        flank=settings.flank * last.width,
        trend=np.zeros(3),
        std=None,
        evidence=0.0,
        status="start",
    )
    found = starts_on_base(last, positions, frames, length)
    return [start.changed(position=p, rotation=axes, base=base) for p, axes, base in zip(*found, strict=True)]


def reject(fitted: Template, start: Template, settings: Settings, gap: bool = False) -> str:
    """Why a fitted template is no continuation of its start, beyond a gap or not; empty if it is one."""
    if fitted.points < FEWEST_POINTS or fitted.status == "no data":
        return "the data end here"
    if fitted.evidence < settings.going_on:
        return FLAT
    if fitted.height * start.height <= 0 or abs(fitted.height) > 2.5 * abs(start.height):
        return "no ridge: the height jumped"
    if gap and (fitted.evidence < settings.evidence or not 0.5 < fitted.height / start.height < 2.0):
        return "no ridge: what follows the gap is another one"
    if not 0.55 < fitted.width / start.width < 1.8:
        return "no ridge: the width jumped"
    local = start.rotation.T @ (fitted.position - start.position)
    if local[0] < (LEAST_ADVANCE - 1.0) * start.length:
        return "no ridge: it turned back"
    if abs(local[1]) > 0.5 * start.width or abs(local[2]) > 0.5 * start.width + abs(start.height):
        return "no ridge: the spine jumped"
    if fitted.rotation[:, 0] @ start.rotation[:, 0] < np.cos(_LARGEST_TURN):
        return "no ridge: the direction jumped"
    if fitted.rotation[:, 2] @ start.rotation[:, 2] < np.cos(_LARGEST_TURN):
        return "no ridge: the base tipped"
    return ""


def outgrown(fitted: Template, chain: list[Template], most: float = _OUTGROWN) -> str:
    """Why a template is no part of a ridge as the last ones show it: another, wider rise under it."""
    usual = statistics.median(t.width for t in chain[-USUAL:])
    return "no ridge: the width grew" if fitted.width > most * usual else ""


def sparse(full: Window, fitted: Template, chain: list[Template], gap: bool = False) -> str:
    """Why a template lies on strays alone: beyond the border of the data there are far fewer points.

    gap: it lies beyond a gap. Strays give themselves away by their noise there.
    """
    known = [t for t in chain if t.evidence > 0.0][-USUAL:]
    if not known:
        return ""
    noisy = gap and fitted.scale > _NOISY * statistics.median(t.scale for t in known)
    if not noisy and fitted.points >= _FEWER * statistics.median(t.points for t in known):
        return ""
    # The least of the last five: a scan is not everywhere as dense.
    least = min(_density(full, t) for t in known)
    return "the data end here" if _density(full, fitted) < _SPARSE[noisy] * least else ""


def _density(full: Window, template: Template) -> float:
    """Points by area of a template's window."""
    return len(full(template)) / (2.0 * template.half_breadth * template.length)


def risen(fitted: Template, chain: list[Template]) -> bool:
    """Whether a template is so much higher than the last ones that it may be the edge of the surface."""
    usual = statistics.median(abs(t.height) for t in chain[-USUAL:])
    return len(chain) >= _FEW and abs(fitted.height) > _RISEN * usual


def met(template: Template, others: list[Template]) -> int:
    """Which of the others a template lies on, the first of them; -1 for none."""
    if not others:
        return -1
    apart = np.array([other.position for other in others]) - template.position
    for i in np.flatnonzero((apart * apart).sum(axis=1) < (2 * (template.length + template.width)) ** 2):
        other = others[i]
        local = other.rotation.T @ apart[i]
        if (
            abs(local[0]) < 0.5 * other.length
            and abs(local[1]) < 0.5 * other.width
            and abs(local[2]) < other.width
        ):
            return int(i)
    return -1


def misfits(fitted: Template, chain: list[Template]) -> bool:
    """Whether a template fits much worse than the last ones: where ridges meet, or it is none any more."""
    usual = min(t.scale for t in chain[-USUAL:])
    return fitted.scale > max(_MISFIT * usual, _LEAST_MISFIT * abs(fitted.height))


def across(rough: Window, chain: list[Template], settings: Settings) -> tuple[Template, Template, str] | None:
    """The next template beyond a place where other ridges join this one: straight on, or nearly so."""
    last, straight = chain[-1], append(chain[-1:], settings)[:1]
    sure = last.scale < _LEAST_MISFIT * abs(last.height)  # a poor fit does not tell which way is straight
    bent = corners(chain, settings, _ABOUT_STRAIGHT) if sure else []
    ahead = settings.look_ahead * last.width
    for starts, worse in ((straight, _WORSE_ACROSS[0]), (bent, _WORSE_ACROSS[1])):
        beyond = [
            start.changed(position=start.position + step * ahead * start.rotation[:, 0])
            for start in starts
            for step in _STEPS_ACROSS
        ]
        found = _best_beyond(rough, chain, beyond, settings, worse)
        if found is not None:
            return found
    return None


def _best_beyond(
    rough: Window, chain: list[Template], starts: list[Template], settings: Settings, worse: float = math.inf
) -> tuple[Template, Template, str] | None:
    """The best fit from starts behind a crossing or a bend, where the ridge goes on there beyond doubt.

    worse: most noise, in the least of the last five.
    """
    last = chain[-1]
    found = [(start, improve(rough, start, settings), "") for start in starts]
    for start, fitted, why in sorted(found, key=lambda best: best[1].scale):
        # What a section misses the points by grows with the height.
        scales = (t.scale * max(fitted.height / t.height, 1.0) for t in chain[-USUAL:] if t.height)
        least = min(scales, default=math.inf)
        # By point: the last one may have been fitted to all points of its window, this one to some.
        usual = last.evidence / max(last.points, 1) * fitted.points
        if (
            fitted.evidence > max(_BEYOND_EVIDENCE * usual, settings.evidence)
            and fitted.scale < max(worse * least, _MISSES * abs(fitted.height))
            and _alike(fitted, last)
            and not reject(fitted, start, settings, gap=True)
            and met(fitted, chain[:-1]) < 0
            and advances(last, fitted)
            and not sparse(rough.source or rough, fitted, chain, gap=True)
        ):
            return start, fitted, why
    return None


def _alike(fitted: Template, last: Template) -> bool:
    """Whether width and height are those of the last template, as behind a corner or a crossing."""
    return 0.75 < fitted.width / last.width < 1.33 and 0.6 < fitted.height / last.height < 1.6


def corners(
    chain: list[Template], settings: Settings, angles: tuple[float, ...] = _CORNERS, before: float = 0.0
) -> list[Template]:
    """Starts of the next template behind a sharp bend, by angles in degrees, to either side.

    The bend is a circle about whose centre the ridge's foot turns, from the end of the last template on, or
    by `before` lengths before it.
    """
    last = chain[-1]
    straight = append(chain[-1:], settings)[0]
    along, left, up = last.rotation.T
    end = last.end - before * last.length * along
    found = []
    for angle in np.radians(angles):
        radius = _CORNER_RADIUS * last.width * np.sign(angle)
        ahead = np.cos(angle) * along + np.sin(angle) * left
        corner = end + radius * (np.sin(angle) * along + (1 - np.cos(angle)) * left)
        axes = np.column_stack([ahead, np.cos(angle) * left - np.sin(angle) * along, up])
        place, base = corner + 0.5 * straight.length * ahead, seen_from(last.base, last.rotation.T @ axes)
        found.append(straight.changed(position=place, rotation=axes, base=base))
    return found


def round_corner(
    rough: Window, chain: list[Template], settings: Settings, within: bool = False
) -> tuple[Template, Template, str] | None:
    """The next template behind a sharp bend, where the ridge goes on there beyond doubt.

    within: the last template may lie half in the bend.
    """
    scale = chain[-1].scale
    for before, angles, worse in ((0.0, _CORNERS, math.inf), (_WITHIN, _SHARPEST, _WORSE_WITHIN))[
        : 1 + within
    ]:
        starts = corners(chain, settings, angles, before)
        starts.sort(key=lambda start: start_loss(rough, start, scale))
        found = _best_beyond(rough, chain, starts[:_CORNERS_TRIED], settings, worse)
        if found is not None:
            return found
    return None
