"""Scanners whose lines have an error each: along a ridge they make its height and width less sure."""

from __future__ import annotations

import numpy as np

import ridgefeature as rf
from ridgefeature.section import bell

HEIGHT, WIDTH, NOISE, LINES = 1.0, 4.0, 0.06, 0.25


def scan(seed: int, in_common: float, along: bool = True) -> np.ndarray:
    """A straight ridge along x whose lines, along or across it, have a part of the noise in common."""
    random = np.random.default_rng(seed)
    x, y = random.uniform(-25, 25, 16_000), random.uniform(-6, 6, 16_000)
    line = np.floor((y if along else x) / LINES).astype(int)
    line -= line.min()
    own = NOISE * np.sqrt(1 - in_common**2) * random.normal(size=(x.size, 3))
    z = HEIGHT * bell()(y / WIDTH) + in_common * NOISE * random.normal(size=line.max() + 1)[line]
    return np.column_stack([x, y, z]) + own


def registered(points: np.ndarray) -> rf.Ridge:
    at = points[np.argmin(np.linalg.norm(points - (0, 0, HEIGHT), axis=1))]
    return rf.register(points, at=at)


def usual_std(in_common: float, along: bool) -> float:
    """Of the height."""
    ridges = [registered(scan(seed, in_common, along)) for seed in range(3)]
    return float(np.mean([np.median(ridge.height_std) for ridge in ridges]))


def test_bands_are_wider_than_those_of_independent_noise():
    along = usual_std(0.6, along=True)
    assert along > 1.4 * usual_std(0.0, along=True)
    assert along > 1.2 * usual_std(0.6, along=False)
