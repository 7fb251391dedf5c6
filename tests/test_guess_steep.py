"""GUESS where flanks are steep: one click anywhere on a ridge higher than wide, and none on an edge."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ridgefeature as rf
from ridgefeature.section import bell, box

WIDTH, HEIGHT = 8.0, 14.0


def wall(noise: float, strays: float = 0.0) -> np.ndarray:
    """A wall along x, its points even by area, flanks too."""
    random = np.random.default_rng(5)
    y = np.linspace(-24.0, 24.0, 8001)
    z = HEIGHT * box()(y / WIDTH)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(y), np.diff(z)))])
    s = random.uniform(0.0, along[-1], 24000)
    points = np.column_stack(
        [random.uniform(-50, 50, len(s)), np.interp(s, along, y), np.interp(s, along, z)]
    )
    points += random.normal(0.0, noise, points.shape)
    astray = random.uniform(size=len(points)) < strays
    points[astray, 2] = random.uniform(-1.0, 2.0, astray.sum()) * HEIGHT
    return points


@pytest.mark.parametrize("strays", [0.1])
def test_a_wall_is_found_from_any_place_on_it(strays):
    points = wall(0.5, strays)
    clicks = [(0, 0, HEIGHT), (5, 3.7, 2.0), (-9, -3.6, 7.0), (12, 3.4, 11.0), (20, -3.4, 12.0)]
    for k, click in enumerate(clicks):
        turn = Rotation.random(random_state=k).as_matrix()
        ridge = rf.register(points @ turn.T, at=turn @ np.array(click, dtype=float))
        assert ridge.length > 95.0
        inner = slice(2, -2)
        assert np.abs(ridge.height[inner] / HEIGHT - 1.0).max() < 0.05
        assert np.abs((ridge.spine @ turn)[inner, 1]).max() < 0.2
        assert np.median(np.abs(ridge.tangent @ turn)[:, 0]) > 0.999


@pytest.mark.parametrize("noise", [0.02, 0.4])
def test_a_bell_twice_as_high_as_wide_is_found_from_the_pick_alone(noise):
    random = np.random.default_rng(0)
    x, y = random.uniform(-40, 40, 40_000), random.uniform(-30, 30, 40_000)
    points = np.column_stack([x, y, 20.0 * bell()(y / 10.0)]) + random.normal(0.0, noise, (40_000, 3))
    for click in ((0, 0, 20), (15, 0.5, 18)):
        ridge = rf.register(points, at=click)
        assert ridge.length == pytest.approx(80, abs=3)
        middle = np.abs(ridge.arc_length - 40) < 20
        assert np.median(ridge.height[middle]) == pytest.approx(20, rel=0.01)
        usual = 10 * bell().half_height_width
        assert np.median(ridge.half_height_width[middle]) == pytest.approx(usual, rel=0.01)


def test_a_hinted_direction_and_width_are_kept_to():
    points = wall(0.3)
    ridge = rf.register(points, at=(5, 3.7, 4.0), direction=(1, 0.05, 0), width=WIDTH)
    assert ridge.length > 95.0 and ridge.tangent[0, 0] > 0.99


@pytest.mark.parametrize("kind", ["ridge", "auto"])
def test_the_edge_of_a_step_is_no_wall(kind):
    points = wall(0.3)
    y, z = points[:, 1], points[:, 2]
    step = np.column_stack([points[:, 0], y, np.where(y < 0, HEIGHT, z)])
    for click in ((0, 3.6, 7.0), (5, 3.0, HEIGHT), (9, 4.0, 1.0)):
        with pytest.raises(rf.NoRidgeError):
            rf.register(step, at=click, kind=kind)


def tube(seed: int, height: float, width: float = 6.0, noise: float = 0.03) -> np.ndarray:
    """40 000 points spread evenly over a ridge along x with a flat top and vertical walls, and its ground."""
    random, ground = np.random.default_rng(seed), 20 - width / 2
    t, x = random.uniform(0, 2 * (ground + height) + width, 40_000), random.uniform(-60, 60, 40_000)
    corners = np.cumsum([0.0, ground, height, width, height, ground])
    y = np.interp(t, corners, [-20, -width / 2, -width / 2, width / 2, width / 2, 20])
    z = np.interp(t, corners, [0, 0, height, height, 0, 0])
    return np.column_stack([x, y, z]) + random.normal(0, noise, (40_000, 3))


@pytest.mark.parametrize(("height", "seed"), [(3.0, 2), (4.0, 2), (5.0, 1)])
def test_vertical_walls_make_no_horns(height, seed):
    """No spline is as steep: the likeliest one would swing over the top, and its horns pass for the apex."""
    ridge = rf.register(tube(seed, height), at=(0, 0, height))
    steps = np.diff(ridge.section(np.linspace(-0.5, 0.5, 1001)))
    rises = np.sign(steps[np.abs(steps) > 1e-12])  # what is level is so to the last bits alone
    assert (np.diff(rises) < 0).sum() == 1
    assert np.median(ridge.height) == pytest.approx(height, rel=0.005)
    assert abs(np.median(ridge.height) - height) < 3 * np.median(ridge.height_std)
    assert np.median(ridge.half_height_width) == pytest.approx(6.0, rel=0.03)
