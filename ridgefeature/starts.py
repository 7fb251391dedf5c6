"""Where GUESS starts: straight ridges through the points about the pick."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ridgefeature.grid import build_grid, nearest
from ridgefeature.kernels.algebra import facing
from ridgefeature.kernels.search import best_straight_ridge, principal_axes
from ridgefeature.section import Section
from ridgefeature.window import Window

Array = NDArray[np.float64]
LADDER = 1.4
_FEWEST = 30
_PAST_BEST = 3
"""Widths in a row that explain far less than a smaller one did, after which no larger one is tried."""
_WIDER = 2
"""Steps of the ladder from a ball that holds more of a high ridge than of its ground to one that does not."""
_SAME_SIDE = math.cos(math.radians(30.0))
CLEAR = 100.0
"""Score of a fit that leaves no need to try further starts: residuals fall by a third over 300 points."""
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
_OF_EACH, _HIGH_TRIES = 6, 24
"""Starts kept of one radius, and in all."""


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
class Start:
    """A straight ridge of one width, in a frame (columns) about the pick, and how much it explains.

    found (7,) is that of kernels.search.best_straight_ridge.
    """

    score: float
    width: float
    frame: Array
    found: Array


def _start(points: Array, frame: Array, width: float, hints: Hints, section: Section) -> Start | None:
    """The best straight ridge of one width through points (n, 3) about the pick; None if there is none."""
    angles = _ANGLES
    if hints.direction is not None:
        d = hints.direction @ frame
        angles = np.arctan2(d[1], d[0]) + np.radians([-10.0, 0.0, 10.0])
    found = best_straight_ridge(points @ frame, width, angles, _OFFSETS, section.table)
    if found[0] <= 0:
        return None
    return Start(len(points) * -math.log(max(1.0 - found[0], 1e-6)), width, frame, found)


def starts_about(window: Window, pick: Array, extent: float, hints: Hints, section: Section) -> list[Start]:
    """Straight ridges of the widths of a geometric ladder, the best first.

    Seen in the frame of the points about the pick, and in that of more of them where this one is turned: of a
    ridge as high as wide the near ones hardly tell which way is up.
    """
    radius, last = 3.0 * window.spacing, extent / 2.7
    if hints.width is not None:
        radius = last = 1.1 * hints.width
    starts: list[Start] = []
    seen: list[tuple[Array, Array, float]] = []
    falling = 0
    while radius <= LADDER**_WIDER * last * (1 + 1e-9) and falling < _PAST_BEST:
        points = window.around(pick, radius, seen[-1][1] if seen else np.eye(3))
        if len(points) >= _FEWEST:
            seen.append((points, principal_axes(points), radius / 1.1))
            found = _start(*seen[-1], hints, section) if radius <= last * (1 + 1e-9) else None
            if found is not None:
                falling = falling + 1 if _falls(found, starts) else 0
            starts += [s for s in (found, _turned(seen, hints, section)) if s is not None]
        radius *= LADDER
    return sorted(starts, key=lambda start: -start.score)


def _normals(points: Array) -> Array:
    """Unit normals (m, 3), either way round, at those of points (n, 3) about which they lie flattest."""
    near = nearest(build_grid(points), points, _AROUND)[1]
    near = near - near.mean(axis=1, keepdims=True)
    extents, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", near, near))
    flat = extents[:, 0] / np.maximum(extents.sum(axis=1), 1e-300)
    return np.asarray(axes[flat <= np.quantile(flat, _FLATTEST), :, 0])


def high_starts(window: Window, pick: Array, extent: float, hints: Hints, section: Section) -> list[Start]:
    """Straight ridges on flanks so steep that their points do not tell the base's normal, the best first.

    A straight ridge runs along what all normals of its surface are square to. In the plane across it
    every way up is tried.
    """
    radius, last = 3.0 * window.spacing, extent / 2.7
    if hints.width is not None:
        radius, last = 1.6 * hints.width, 1.6 * hints.width
    starts: list[Start] = []
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
        radius *= LADDER
    return sorted(starts, key=lambda start: -start.score)[:_HIGH_TRIES]


def _high_start(points: Array, frame: Array, widths: list[float], section: Section) -> Start | None:
    """The best ridge of these widths along a frame's first axis, upwards; None if there is none."""
    tried = [
        (best_straight_ridge(points @ frame, w, np.zeros(1), _FURTHER, section.table), w) for w in widths
    ]
    found, width = max(tried, key=lambda best: float(best[0][0]) if best[0][3] > 0 else 0.0)
    if found[0] <= 0 or found[3] <= 0:
        return None
    return Start(len(points) * -math.log(max(1.0 - found[0], 1e-6)), width, frame, found)


def _falls(start: Start, others: list[Start]) -> bool:
    """Whether a start explains far less than the best of others did, seen from the same side."""
    if not others:
        return False
    best = max(others, key=lambda s: s.score)
    return best.score > CLEAR and start.score < 0.4 * best.score and _same_side(start.frame, best.frame)


def _same_side(one: Array, other: Array) -> bool:
    return abs(float(one[:, 2] @ other[:, 2])) > _SAME_SIDE


def _turned(seen: list[tuple[Array, Array, float]], hints: Hints, section: Section) -> Start | None:
    """A straight ridge of a smaller width in the frame of the most points seen, where its own is turned."""
    if len(seen) <= _WIDER:
        return None
    points, own, width = seen[-1 - _WIDER]
    frame = seen[-1][1]
    return None if _same_side(own, frame) else _start(points, frame, width, hints, section)
