"""The march: APPEND template after template in both directions from the first, and say why each end stopped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.improve import FEWEST_POINTS, improve
from ridgefeature.kernels.residual import rotation_of
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]
Progress = Callable[[Template], None]

INTERRUPTED = "interrupted"
_LARGEST_TURN = np.radians(60.0)


@dataclass(frozen=True, eq=False)
class Track:
    """Templates in order along the ridge, and why each end stopped."""

    templates: tuple[Template, ...]
    stop: tuple[str, str]


def reverse(template: Template) -> Template:
    """The same patch, seen by someone who walks the other way."""
    return replace(
        template,
        rotation=template.rotation * np.array([-1.0, -1.0, 1.0]),
        trend=-template.trend,
    )


def turn_between(first: Template, second: Template) -> Array:
    """Rotation vector, in the first frame, that takes the first frame to the second."""
    r = first.rotation.T @ second.rotation
    axis = 0.5 * np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    sine = np.linalg.norm(axis)
    angle = np.arctan2(sine, 0.5 * (np.trace(r) - 1))
    return axis * (angle / sine if sine > 1e-12 else 1.0)


def _rotation(vector: Array) -> Array:
    return rotation_of(vector)[0]


def append(last: Template, before: Template | None, settings: Settings) -> Template:
    """Start of the next template: its first row lies on the last row of `last`.

    It keeps width and height and goes on turning as the two templates before it did.
    """
    length = settings.length * last.width
    rotation, joint = last.rotation, last.end
    if before is not None:
        turn = turn_between(before, last)
        step = np.linalg.norm(last.position - before.position)
        share = min(0.5 * (last.length + length) / step, 1.2) if step > 0 else 0.0
        turn = turn * share
        size = np.linalg.norm(turn)
        if size > 0.5:
            turn *= 0.5 / size
        joint = last.position + 0.5 * last.length * (last.rotation @ _rotation(0.25 * turn))[:, 0]
        rotation = last.rotation @ _rotation(turn)
    return replace(
        last, position=joint + 0.5 * length * rotation[:, 0], rotation=rotation, length=length,
        flank=settings.flank * last.width, trend=np.zeros(3), std=None, evidence=0.0, status="start",
    )


def _reject(fitted: Template, start: Template, settings: Settings) -> str:
    """Why a fitted template is no continuation of its start; empty if it is one."""
    if fitted.points < FEWEST_POINTS or fitted.status == "no data":
        return "the data end here"
    if fitted.evidence < settings.evidence:
        return "no ridge: the data agree with a flat base"
    if fitted.height * start.height <= 0 or abs(fitted.height) > 2.5 * abs(start.height):
        return "no ridge: the height jumped"
    if not 0.55 < fitted.width / start.width < 1.8:
        return "no ridge: the width jumped"
    local = start.rotation.T @ (fitted.position - start.position)
    if abs(local[1]) > 0.5 * start.width or abs(local[2]) > 0.5 * start.width + abs(start.height):
        return "no ridge: the spine jumped"
    if fitted.rotation[:, 0] @ start.rotation[:, 0] < np.cos(_LARGEST_TURN):
        return "no ridge: the direction jumped"
    if fitted.rotation[:, 2] @ start.rotation[:, 2] < np.cos(_LARGEST_TURN):
        return "no ridge: the base tipped"
    return ""


def _meets(template: Template, others: list[Template]) -> bool:
    """Whether a template lies on one of the others."""
    for other in others:
        local = other.rotation.T @ (template.position - other.position)
        if abs(local[0]) < 0.5 * other.length and abs(local[1]) < 0.5 * other.width and abs(local[2]) < other.width:
            return True
    return False


def _fit_next(rough: Window, full: Window, start: Template, settings: Settings) -> tuple[Template, str]:
    """The next template and why it is none; a rejected one is tried again with all points of its window."""
    fitted = improve(rough, start, settings)
    why = _reject(fitted, start, settings)
    if why and fitted.points >= FEWEST_POINTS:
        again = improve(full, start, settings)
        why_again = _reject(again, start, settings)
        if not why_again:
            return again, ""
    return fitted, why


def march_one_way(rough: Window, full: Window, chain: list[Template], found: list[Template], settings: Settings,
                  progress: Progress | None = None) -> str:
    """Append the templates that follow `chain` to `found`, and tell why the march stopped.

    chain: what is known so far, in the direction of the march; not changed.
    """
    last, before = chain[-1], chain[-2] if len(chain) > 1 else None
    reason, pending = "", 0
    while len(chain) + len(found) < settings.max_templates:
        start = append(last, before, settings)
        fitted, why = _fit_next(rough, full, start, settings)
        if why:
            reason, pending = reason or why, pending + 1
            if pending > settings.look_ahead:
                return reason
            before, last = None, start
            continue
        if _meets(fitted, [*chain, *found][:-2]):
            return "it ran back into itself"
        reason, pending = "", 0
        found.append(fitted)
        last, before = fitted, last
        if progress is not None:
            progress(fitted)
    return f"max_templates ({settings.max_templates}) reached"


def march(rough: Window, full: Window, first: Template, settings: Settings, progress: Progress | None = None) -> Track:
    """March both ways from the first template; an interrupt ends it and keeps what is there."""
    settings = replace(
        settings, width_change=settings.march_width_change, height_change=settings.march_height_change
    )
    ahead: list[Template] = []
    back: list[Template] = []
    why_ahead = why_back = INTERRUPTED
    try:
        if progress is not None:
            progress(first)
        why_ahead = march_one_way(rough, full, [first], ahead, settings, progress)
        known = [reverse(t) for t in [*reversed(ahead), first]]
        why_back = march_one_way(rough, full, known, back, settings, progress)
    except KeyboardInterrupt:
        pass
    return Track((*(reverse(t) for t in reversed(back)), first, *ahead), (why_back, why_ahead))
