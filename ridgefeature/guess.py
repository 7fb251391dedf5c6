"""GUESS: the first template, from the picked point alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ridgefeature.alternatives import distinct
from ridgefeature.curvature import SEEN, improve_on_base, less_noisy
from ridgefeature.improve import improve, sized
from ridgefeature.kernels.algebra import facing
from ridgefeature.kernels.evidence import explained
from ridgefeature.kernels.search import best_straight_ridge, principal_axes
from ridgefeature.section import Section
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
    neither a smooth surface nor an edge explains as well, if there are any. aimed: of ridges side by side the
    one nearer to the pick counts more. `extent`, about the diameter of the scan, bounds the widths. A hinted
    direction (to 10 degrees) and width leave less to try.
    """
    best: tuple[bool, float, Template] | None = None
    for tried, start in enumerate(_starts(window, pick, extent, hints, section)):
        if tried >= _FEWEST_TRIES and best is not None and best[0] and best[1] > _CLEAR:
            break
        fitted = _fitted(window, _template(start, pick, hints, section, settings), pick, settings)
        score = _score(window, fitted, pick, aimed)
        if score <= 0 or fitted.width > settings.widest * extent:
            continue
        if best is not None and best[0] and score <= best[1]:
            continue
        clear = distinct(window, fitted, settings) >= _DISTINCT * settings.distinct
        if best is None or (clear, score) > best[:2]:
            best = clear, score, fitted
    if best is None:
        return None
    # The length still is that of the start's width, so window and fit get one more round together.
    return _fitted(window, sized(best[2], settings), pick, settings)


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
