"""GUESS: the first template, from the picked point alone."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.alternatives import distinct
from ridgefeature.curvature import SEEN, improve_on_base, less_noisy
from ridgefeature.grid import build_grid, nearest
from ridgefeature.improve import improve, sized
from ridgefeature.kernels.algebra import facing
from ridgefeature.kernels.evidence import explained
from ridgefeature.kernels.search import best_straight_ridge, principal_axes
from ridgefeature.section import Section, plateau
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]
_LADDER = 1.4
_FEWEST = 30
_PAST_BEST = 3
"""Widths in a row that explain far less than a smaller one did, after which no larger one is tried."""
_WIDER = 2
"""Steps of the ladder from a ball that holds more of a high ridge than of its ground to one that does not."""
_SAME_SIDE = math.cos(math.radians(30.0))
_FEWEST_TRIES = 2
_CLEAR = 100.0
"""Score of a fit that leaves no need to try further starts: residuals fall by a third over 300 points."""
_DISTINCT = 0.1
"""What one template must have of the evidence that tells a whole ridge from other surfaces."""
_AIM = 0.25
"""Standard deviation of the pick's distance from the crest, in widths."""
_ANGLES = np.arange(16) * (np.pi / 16)
_OFFSETS = np.array([-0.3, 0.0, 0.3])
_FEWEST_NORMALS = 60
_AROUND = 10
"""Points that tell the normal at each of them."""
_FLATTEST = 0.6
"""Share of the points, those with the flattest neighbourhoods, whose normals count."""
_TURNS = np.arange(16) * (np.pi / 8)
_BEFORE_HIGH = 1.1, 1.6, 2.3
"""Radii, in widths, in which a high ridge is looked for: crest and feet are further apart than its width."""
_FURTHER = np.linspace(-0.5, 0.5, 11)
_MUCH_NOISE, _MOST_NOISE = 0.35, 0.15
"""Noise, in heights, from which on a fit on steep flanks is not looked at further; is none."""
_STEEP = 0.4
"""Height, in widths, from which on flanks are steep."""
_MANY_TRIED = 0.6
"""How well it explains its window counts by that much less."""
_OF_EACH, _HIGH_TRIES = 6, 24
"""Starts kept of one radius, and in all."""
_Best = tuple[bool, float, Template]
"""Whether neither a smooth surface nor an edge explains the window of a fit too, how well it does, and it."""


@dataclass(frozen=True)
class Hints:
    """What the user may say of the ridge at the pick; what is None the program finds.

    direction (3,): unit vector in the frame of the scan; kind: ridge, groove or auto.
    """

    direction: Array | None = None
    width: float | None = None
    height: float | None = None
    kind: str = "ridge"


@dataclass(frozen=True)
class _Start:
    """A straight ridge of one width, in a frame (columns) about the pick, and how much it explains.

    found (7,) is that of kernels.search.best_straight_ridge.
    """

    score: float
    width: float
    frame: Array
    found: Array


def _start(points: Array, frame: Array, width: float, hints: Hints, section: Section) -> _Start | None:
    """The best straight ridge of one width through points (n, 3) about the pick; None if there is none."""
    angles = _ANGLES
    if hints.direction is not None:
        d = hints.direction @ frame
        angles = np.arctan2(d[1], d[0]) + np.radians([-10.0, 0.0, 10.0])
    found = best_straight_ridge(points @ frame, width, angles, _OFFSETS, section.table)
    if found[0] <= 0:
        return None
    return _Start(len(points) * -math.log(max(1.0 - found[0], 1e-6)), width, frame, found)


def _template(start: _Start, pick: Array, hints: Hints, section: Section, settings: Settings) -> Template:
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


def _starts(window: Window, pick: Array, extent: float, hints: Hints, section: Section) -> list[_Start]:
    """Straight ridges of the widths of a geometric ladder, the best first.

    Seen in the frame of the points about the pick, and in that of more of them where this one is turned: of a
    ridge as high as wide the near ones hardly tell which way is up.
    """
    radius, last = 3.0 * window.spacing, extent / 2.7
    if hints.width is not None:
        radius = last = 1.1 * hints.width
    starts: list[_Start] = []
    seen: list[tuple[Array, Array, float]] = []
    falling = 0
    while radius <= _LADDER**_WIDER * last * (1 + 1e-9) and falling < _PAST_BEST:
        points = window.around(pick, radius, seen[-1][1] if seen else np.eye(3))
        if len(points) >= _FEWEST:
            seen.append((points, principal_axes(points), radius / 1.1))
            found = _start(*seen[-1], hints, section) if radius <= last * (1 + 1e-9) else None
            if found is not None:
                falling = falling + 1 if _falls(found, starts) else 0
            starts += [s for s in (found, _turned(seen, hints, section)) if s is not None]
        radius *= _LADDER
    return sorted(starts, key=lambda start: -start.score)


def _normals(points: Array) -> Array:
    """Unit normals (m, 3), either way round, at those of points (n, 3) about which they lie flattest."""
    near = nearest(build_grid(points), points, _AROUND)[1]
    near = near - near.mean(axis=1, keepdims=True)
    extents, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", near, near))
    flat = extents[:, 0] / extents.sum(axis=1)
    return np.asarray(axes[flat <= np.quantile(flat, _FLATTEST), :, 0])


def _high_starts(window: Window, pick: Array, extent: float, hints: Hints, section: Section) -> list[_Start]:
    """Straight ridges on flanks so steep that their points do not tell the base's normal, the best first.

    A straight ridge runs along what all normals of its surface are square to. In the plane across it
    every way up is tried.
    """
    radius, last = 3.0 * window.spacing, extent / 2.7
    if hints.width is not None:
        radius, last = 1.6 * hints.width, 1.6 * hints.width
    starts: list[_Start] = []
    frame = np.eye(3)
    while radius <= last * (1 + 1e-9):
        points = window.around(pick, radius, frame)
        if len(points) >= _FEWEST_NORMALS:
            frame = principal_axes(points)
            normals = _normals(points)
            axes = np.linalg.eigh(normals.T @ normals)[1]
            along = axes[:, 0] if hints.direction is None else hints.direction
            widths = [hints.width] if hints.width is not None else [radius / x for x in _BEFORE_HIGH]
            ups = [np.cos(turn) * axes[:, 2] + np.sin(turn) * axes[:, 1] for turn in _TURNS]
            found = [_high_start(points, facing(up, along), widths, section) for up in ups]
            starts += sorted((s for s in found if s is not None), key=lambda s: -s.score)[:_OF_EACH]
        radius *= _LADDER
    return sorted(starts, key=lambda start: -start.score)[:_HIGH_TRIES]


def _high_start(points: Array, frame: Array, widths: list[float], section: Section) -> _Start | None:
    """The best ridge of these widths along a frame's first axis, upwards; None if there is none."""
    tried = [
        (best_straight_ridge(points @ frame, w, np.zeros(1), _FURTHER, section.table), w) for w in widths
    ]
    found, width = max(tried, key=lambda best: float(best[0][0]) if best[0][3] > 0 else 0.0)
    if found[0] <= 0 or found[3] <= 0:
        return None
    return _Start(len(points) * -math.log(max(1.0 - found[0], 1e-6)), width, frame, found)


def _falls(start: _Start, others: list[_Start]) -> bool:
    """Whether a start explains far less than the best of others did, seen from the same side."""
    if not others:
        return False
    best = max(others, key=lambda s: s.score)
    return best.score > _CLEAR and start.score < 0.4 * best.score and _same_side(start.frame, best.frame)


def _same_side(one: Array, other: Array) -> bool:
    return abs(float(one[:, 2] @ other[:, 2])) > _SAME_SIDE


def _turned(seen: list[tuple[Array, Array, float]], hints: Hints, section: Section) -> _Start | None:
    """A straight ridge of a smaller width in the frame of the most points seen, where its own is turned."""
    if len(seen) <= _WIDER:
        return None
    points, own, width = seen[-1 - _WIDER]
    frame = seen[-1][1]
    return None if _same_side(own, frame) else _start(points, frame, width, hints, section)


def guess(
    window: Window,
    pick: Array,
    extent: float,
    hints: Hints,
    section: Section,
    settings: Settings,
    aimed: bool = True,
) -> Template | None:
    """First template, already improved; None where no straight ridge explains the points about the pick.

    For every width on a geometric ladder the best direction and offset are found; these starts are improved,
    the best first and at least two, until one is clear, and the one that explains most is kept: of those that
    neither a smooth surface nor an edge explains as well, if there are any. If none is clear, ridges on steep
    flanks are tried too. aimed: of ridges side by side the
    one nearer to the pick counts more. `extent`, about the diameter of the scan, bounds the widths. A hinted
    direction (to 10 degrees) and width leave less to try.
    """
    known = window, pick, extent, settings, aimed
    best: _Best | None = None
    for tried, start in enumerate(_starts(window, pick, extent, hints, section)):
        if tried >= _FEWEST_TRIES and _is_clear(best):
            break
        fitted = _fitted(window, _template(start, pick, hints, section, settings), pick, settings)
        best = _better(best, fitted, False, *known)
    if not _is_clear(best):
        steep = plateau() if settings.section == "auto" else section
        # Look-ups of their own: what is tried here must not change what is seen later.
        apart = replace(window, source=window.source and replace(window.source))
        for start in _high_starts(apart, pick, extent, hints, steep):
            fitted = _fitted(apart, _template(start, pick, hints, steep, settings), pick, settings)
            if not 0.0 < fitted.scale < _MUCH_NOISE * abs(fitted.height):
                continue
            # Of one flank seen from below, as a ridge beside the ground, nothing is left in a longer window.
            fitted = _fitted(apart, sized(fitted, settings), pick, settings)
            if _stands_high(fitted, settings):
                best = _better(best, fitted, True, apart, *known[1:])
    if best is None:
        return None
    # The length still is that of the start's width, so window and fit get one more round together.
    return _fitted(window, sized(best[2], settings), pick, settings)


def _is_clear(best: _Best | None) -> bool:
    return best is not None and best[0] and best[1] > _CLEAR


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
    steep = _STEEP * fitted.width <= height <= settings.steepest * fitted.width
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
