"""Sharp bends: the march goes round them, and only where the ridge does."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

import ridgefeature as rf
from ridgefeature.section import bell, plateau

ARM, WIDTH, HEIGHT = 45.0, 10.0, 2.0


def bent_path(angle: float) -> np.ndarray:
    """(k, 2) two straight arms and, between them, a turn by `angle` degrees on a radius of 0.55 widths."""
    t = np.linspace(0, np.radians(angle), 100)[1:]
    s = np.linspace(0, ARM, 400)
    arc = 0.55 * WIDTH * np.column_stack([np.sin(t), 1 - np.cos(t)])
    last = arc[-1] + s[1:, None] * np.array([np.cos(t[-1]), np.sin(t[-1])])
    return np.concatenate([np.column_stack([s - ARM, 0 * s]), arc, last])


def scan_of(path: np.ndarray, seed: int, noise: float = 0.04) -> np.ndarray:
    rng = np.random.default_rng(seed)
    xy = rng.uniform(path.min(axis=0) - 15, path.max(axis=0) + 15, (12000, 2))
    away, nearest = cKDTree(path).query(xy)
    ahead = ((xy - path[-1]) @ (path[-1] - path[-2]) > 0) & (nearest == len(path) - 1)
    behind = (xy[:, 0] < path[0, 0]) & (nearest == 0)
    z = np.where(ahead | behind, 0.0, HEIGHT * bell()(np.minimum(away / WIDTH, 0.5)))
    return np.column_stack([xy, z]) + rng.normal(0, noise, (len(xy), 3))


@pytest.mark.parametrize("angle", [20.0, 50.0, 80.0, 90.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_kink_is_followed(angle: float, seed: int) -> None:
    path = bent_path(angle)
    ridge = rf.register(scan_of(path, seed), at=(-30, 0, HEIGHT))
    spine = cKDTree(ridge.spine[:, :2])
    assert (spine.query(path)[0] < 0.4 * WIDTH).mean() > 0.95
    assert cKDTree(path).query(ridge.spine[:, :2])[0].max() < 0.4 * WIDTH
    assert ridge.height == pytest.approx(HEIGHT, rel=0.1)


def test_a_straight_ridge_ends_where_it_ends() -> None:
    path = bent_path(1e-6)
    for seed in range(4):
        ridge = rf.register(scan_of(path, seed, noise=0.15), at=(-30, 0, HEIGHT))
        x = ridge.spine[:, 0]
        assert abs(x.min() - path[0, 0]) < 0.5 * WIDTH and abs(x.max() - path[-1, 0]) < 0.5 * WIDTH


@pytest.mark.parametrize("place", np.arange(-38.0, -30.0, 2.0))
def test_a_kink_is_followed_wherever_templates_end_in_it(place: float) -> None:
    """Templates as long as the flat top of the ridge allows: one ends somewhere in the bend."""
    path = bent_path(90.0)
    away, _ = cKDTree(path).query(xy := np.random.default_rng(7).uniform(-55, 60, (9000, 2)))
    points = np.column_stack([xy, HEIGHT * plateau()(np.minimum(away / WIDTH, 0.5))])
    ridge = rf.register(
        points + np.random.default_rng(8).normal(0, 0.04, points.shape), at=(place, 0, HEIGHT)
    )
    assert (cKDTree(ridge.spine[:, :2]).query(path)[0] < 0.4 * WIDTH).mean() > 0.95
