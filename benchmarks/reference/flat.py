"""Noisy surfaces without a ridge, and a place to click on each."""

from __future__ import annotations

import numpy as np

from reference.hosts import Array

SURFACES = ("plane", "sphere", "saddle", "step", "corner", "bump")
SIZE = 100.0
_CLICKS = 30.0


def ridge_free(name: str, seed: int) -> tuple[Array, Array]:
    """Points (n, 3), noisy, of a surface of SURFACES, and a click (3,) within 30 of the middle of 100.

    bump: smooth, as long as it is wide within a third. Half of the scans are grids; noise from 0.02 to 0.5 of
    a spacing of about 1.
    """
    random = np.random.default_rng([SURFACES.index(name), seed])
    spacing = float(random.uniform(0.8, 1.4))
    if random.uniform() < 0.5:
        ticks = np.arange(-SIZE / 2, SIZE / 2, spacing)
        xy = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    else:
        xy = random.uniform(-SIZE / 2, SIZE / 2, (round((SIZE / spacing) ** 2), 2))
    turn = random.uniform(0.0, np.pi)
    c, s = np.cos(turn), np.sin(turn)
    z = _elevation(name, random, c * xy[:, 0] + s * xy[:, 1], c * xy[:, 1] - s * xy[:, 0])
    points = np.column_stack([xy, z])
    points += random.normal(0.0, random.uniform(0.02, 0.5), points.shape)
    inner = np.flatnonzero(np.hypot(*points[:, :2].T) < _CLICKS)
    return points, points[int(random.choice(inner))]


def _elevation(name: str, random: np.random.Generator, x: Array, y: Array) -> Array:
    if name == "sphere":
        radius = float(random.uniform(75.0, 300.0))
        return np.asarray(np.sqrt(radius**2 - x * x - y * y) - radius)
    if name == "saddle":
        return float(random.uniform(0.001, 0.01)) * (x * x - y * y)
    if name == "step":
        return float(random.uniform(1.0, 6.0)) * np.tanh(x / random.uniform(0.2, 3.0))
    if name == "corner":
        return np.asarray(-np.abs(x) * np.tan(np.radians(random.uniform(10.0, 60.0))))
    if name == "bump":
        size = float(random.uniform(8.0, 20.0))
        return float(random.uniform(1.0, 6.0)) * np.exp(
            -((x / size) ** 2) - (y / size / random.uniform(1.0, 1.33)) ** 2
        )
    return 0.0 * x
