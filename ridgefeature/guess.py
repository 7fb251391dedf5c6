"""GUESS: the first template, from the picked point alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ridgefeature.improve import improve, sized
from ridgefeature.kernels.evidence import explained
from ridgefeature.kernels.search import best_straight_ridge
from ridgefeature.section import Section
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]
_LADDER = 1.4
_FEWEST = 30
_PAST_BEST = 3
"""Widths in a row that explain far less than a smaller one did, after which no larger one is tried."""
_FEWEST_TRIES = 2
_CLEAR = 100.0
"""Score of a fit that leaves no need to try further starts: residuals fall by a third over 300 points."""
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


def _frame(points: Array) -> Array:
    """Columns: principal axes of points (n, 3), the normal last; right-handed."""
    centred = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    frame = axes[:, ::-1].copy()
    frame[:, 2] *= np.sign(np.linalg.det(frame))
    return frame


def _orient(direction: Array, normal: Array) -> Array:
    """Rotation whose x follows direction (projected) and whose z is the normal."""
    x = direction - normal * (direction @ normal)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(normal, x), normal])


def _start(
    points: Array, frame: Array, width: float, pick: Array, hints: Hints, section: Section, settings: Settings
) -> tuple[float, Template] | None:
    """The best straight ridge of one width through points (n, 3) about the pick, with its score."""
    local = points @ frame
    angles = _ANGLES
    if hints.direction is not None:
        d = hints.direction @ frame
        angles = np.arctan2(d[1], d[0]) + np.radians([-10.0, 0.0, 10.0])
    explained, angle, offset, height, a, b, c = best_straight_ridge(
        local, width, angles, _OFFSETS, section.table
    )
    if explained <= 0:
        return None
    normal = frame @ (np.array([-b, -c, 1.0]) / np.sqrt(1 + b * b + c * c))
    if (height < 0) != (hints.kind == "groove"):
        normal, height = -normal, -height
    along = frame @ np.array([np.cos(angle), np.sin(angle), 0.0])
    foot = offset * width * np.array([-np.sin(angle), np.cos(angle)])
    position = pick + frame @ np.array([foot[0], foot[1], a + b * foot[0] + c * foot[1]])
    if hints.height is not None:
        height = np.copysign(hints.height, height)
    template = Template(
        position,
        _orient(along, normal),
        width,
        float(height),
        settings.length * width,
        settings.flank * width,
        section,
    )
    return len(points) * -np.log(max(1 - explained, 1e-6)), template


def _starts(
    window: Window, pick: Array, extent: float, hints: Hints, section: Section, settings: Settings
) -> list[tuple[float, Template]]:
    """Starting templates with their scores, one for each width of a geometric ladder, the best first."""
    radius, last = 3.0 * window.spacing, extent / 2.7
    if hints.width is not None:
        radius = last = 1.1 * hints.width
    starts: list[tuple[float, Template]] = []
    frame, falling = np.eye(3), 0
    while radius <= last * (1 + 1e-9) and falling < _PAST_BEST:
        points = window.around(pick, radius, frame)
        if len(points) >= _FEWEST:
            frame = _frame(points)
            start = _start(points, frame, radius / 1.1, pick, hints, section, settings)
            if start is not None:
                most = max((score for score, _ in starts), default=0.0)
                falling = falling + 1 if most > _CLEAR and start[0] < 0.4 * most else 0
                starts.append(start)
        radius *= _LADDER
    return sorted(starts, key=lambda pair: -pair[0])


def guess(
    window: Window, pick: Array, extent: float, hints: Hints, section: Section, settings: Settings
) -> Template | None:
    """First template, already improved; None where no straight ridge explains the points about the pick.

    For every width on a geometric ladder the best direction and offset are found; these starts are improved,
    the best first and at least two, until one is clear, and the one that explains most is kept. `extent`,
    about the diameter of the scan, bounds the widths. A hinted direction (to 10 degrees) and width leave less
    to try.
    """
    best: tuple[float, Template] | None = None
    for tried, (_, start) in enumerate(_starts(window, pick, extent, hints, section, settings)):
        if tried >= _FEWEST_TRIES and best is not None and best[0] > _CLEAR:
            break
        fitted = improve(window, start, settings)
        score = _score(window, fitted, pick)
        if best is None or score > best[0]:
            best = score, fitted
    if best is None or best[0] <= 0:
        return None
    # The length still is that of the start's width, so window and fit get one more round together.
    return improve(window, sized(best[1], settings), settings)


def _score(window: Window, template: Template, pick: Array) -> float:
    """How well a template explains its window, counting 300 points at most; 0 if it misses the pick."""
    if template.status in ("failed", "no data") or template.height == 0:
        return 0.0
    local = template.rotation.T @ (pick - template.position)
    if abs(local[1]) > 0.55 * template.width:
        return 0.0
    points = window(template)
    return min(len(points), 300) * float(explained(points, *template.shape))
