"""Ridges made from a curvature, not registered: their path, sizes and section are known exactly."""

from __future__ import annotations

import numpy as np

from ridgefeature import Ridge, Section
from ridgefeature.section import bell


def made_ridge(
    length: float = 60.0,
    k: int = 61,
    bend: float = 0.0,
    waves: float = 1.0,
    height: float = 2.0,
    width: float = 6.0,
    border: float = 6.0,
    section: Section | None = None,
) -> Ridge:
    """A ridge in the x, y plane from the origin along x; curvature bend sin(2 pi waves s / length).

    With waves = 0 the curvature is `bend` all along. Height and width vary along by a third and a tenth.
    """
    s, fine = np.linspace(0, length, k), np.linspace(0, length, 40 * (k - 1) + 1)
    step = fine[1]
    curvature = bend * np.sin(2 * np.pi * waves * fine / length) if waves else bend + 0 * fine
    angle = simpson(curvature, step)
    points = simpson(np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1), 2 * step)
    angle, one = angle[::20], np.ones(k)
    return Ridge(
        arc_length=s,
        spine=points[::10],
        tangent=np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1),
        normal=np.tile([0.0, 0.0, 1.0], (k, 1)),
        height=height * (1 + 0.3 * np.sin(s / 9)),
        width=width * (1 + 0.1 * np.cos(s / 7)),
        height_std=0.01 * one,
        width_std=0.02 * one,
        border=border * one,
        section=section or bell(),
        templates=(),
        stop=("end of the data", "end of the data"),
    )


def simpson(values: np.ndarray, step: float) -> np.ndarray:
    pieces = step / 3 * (values[:-2:2] + 4 * values[1::2] + values[2::2])
    return np.concatenate([0 * pieces[:1], np.cumsum(pieces, axis=0)])
