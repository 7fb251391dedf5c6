"""Points in pairs or lines, and ridges so high that the points about a pick do not tell which way is up."""

from __future__ import annotations

import numpy as np
import pytest

import ridgefeature as rf
from ridgefeature.grid import build_grid
from ridgefeature.registration import _spacing

HEIGHT, CAP = 14.0, 5.2


def wall(seed: int, paired: bool) -> np.ndarray:
    """A wall along x with a rounded cap, its flanks and the ground beside them unseen, on 84 by 76."""
    random = np.random.default_rng(seed)
    x, y = random.uniform((-42, -38), (42, 38), (5200, 2)).T
    cap = np.abs(y) < 0.5 * CAP
    seen = cap | (np.abs(y) > 6.0)
    points = np.column_stack([x, y, np.where(cap, HEIGHT - 0.2 * y * y, 0.0)])[seen]
    if paired:
        points = np.vstack([points, points + random.normal(0, 0.06, points.shape)])
    return points + random.normal(0, 0.03, points.shape)


def test_the_spacing_is_that_of_neighbours_where_points_lie_evenly():
    x, y = np.meshgrid(np.arange(40.0), np.arange(40.0))
    lattice = build_grid(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]))
    assert _spacing(lattice, np.array([20.0, 20.0, 0.0])) == 1.0


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_the_spacing_of_pairs_and_of_scan_lines_is_that_of_as_dense_a_surface(turn):
    random = np.random.default_rng(1)
    places = random.uniform(0, 40, (1600, 2))
    pairs = np.vstack([places, places + random.normal(0, 0.01, places.shape)])
    lines = np.stack(np.meshgrid(np.arange(0.0, 40.0, 0.02), np.arange(0.0, 40.0, 1.0)), axis=-1).reshape(
        -1, 2
    )
    c, s = np.cos(turn), np.sin(turn)
    for points, density in ((pairs, 2.0), (lines, 50.0)):
        flat = np.column_stack([points @ np.array([[c, -s], [s, c]]).T, np.zeros(len(points))])
        pick = flat[np.argmin(np.linalg.norm(points - 20.0, axis=1))]
        assert _spacing(build_grid(flat), pick) == pytest.approx(0.5 / density**0.5, rel=0.35)


@pytest.mark.parametrize("paired", [False, True])
@pytest.mark.parametrize("seed", range(2))
def test_a_high_wall_of_which_no_flank_was_seen_is_found_from_everywhere_along_it(seed, paired):
    points = wall(seed, paired)
    for x in (-34.0, -21.0, -3.0, 15.0, 32.0):
        pick = points[np.argmin(np.linalg.norm(points - (x, 0.0, HEIGHT), axis=1))]
        ridge = rf.register(points, at=pick)
        assert np.median(ridge.height) == pytest.approx(HEIGHT, rel=0.02)
        assert ridge.length == pytest.approx(84.0, abs=0.5 * CAP)
        # The flanks are somewhere between cap and ground, and the deviation says so.
        off = np.abs(np.median(ridge.half_height_width) - 0.5 * (CAP + 12.0))
        assert off < 2.0 * np.median(ridge.half_height_width_std)
