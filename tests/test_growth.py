"""A ridge fitted as a whole: what is left of a march astray, and how it goes on beyond its march."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import straight_ridge, template_at

import ridgefeature as rf
from ridgefeature.astray import OTHER_WIDTH, as_wide_as_usual, usual_ends
from ridgefeature.grid import build_grid
from ridgefeature.path_frame import path_frame, points_along
from ridgefeature.refit import Refit, refitted
from ridgefeature.section import bell
from ridgefeature.stations import in_line, lay_out
from ridgefeature.template import Template

SETTINGS = rf.Settings()


def known(*x: float, **values) -> list[Template]:
    """Templates at places along the x axis."""
    told = {"std": np.full(8, 0.05), "scale": 0.05, "points": 300, **values}
    return [template_at(position=(place, 0, 0), **told) for place in x]


def whole(points: np.ndarray, templates: list[Template], settings: rf.Settings = SETTINGS) -> Refit:
    stations = lay_out(tuple(templates), settings, False)
    return refitted(build_grid(points), stations, bell(), False, (True, True), settings)


@pytest.mark.parametrize("hole", [(0.0, 0.0), (14.0, 21.0)])
def test_a_ridge_known_in_part_grows_over_a_gap_to_the_last_width(hole):
    points, _ = straight_ridge(24000, noise=0.05, half=(40, 14))
    x = points[:, 0]
    ridge = whole(points[(x < hole[0]) | (x > hole[1])], known(*np.arange(-30.0, 5.0, 6.4)))
    ends = np.sort(ridge.stations.spine[[0, -1], 0])
    assert -40.9 < ends[0] < -39.0 and 39.0 < ends[1] < 40.9
    assert np.abs(ridge.stations.height - 3.0).max() < 0.3


def test_over_a_gap_wider_than_it_may_look_ahead_it_does_not():
    points, _ = straight_ridge(24000, noise=0.05, half=(40, 14))
    x = points[:, 0]
    points = points[(x < 8.0) | (x > 24.0)]
    ridge = whole(points, known(*np.arange(-30.0, 1.0, 6.4)))
    assert 7.0 < ridge.stations.spine[:, 0].max() < 8.9
    ridge = whole(points, known(*np.arange(-30.0, 1.0, 6.4)), rf.Settings(look_ahead=2.5))
    assert 39.0 < ridge.stations.spine[:, 0].max() < 40.9


@pytest.mark.parametrize("height", [3.0, 10.0])
def test_beyond_its_known_ends_a_ridge_is_looked_for_as_high_as_it_is(height):
    points, _ = straight_ridge(8000, height=height, half=(40, 14))
    stations = lay_out(tuple(known(-12.0, -4.0, 4.0, 12.0, height=height)), SETTINGS, False)
    path = path_frame(stations, False, (16.0, 16.0))
    seen = points_along(build_grid(points), path, 0.8 * path.width, 10**6)
    s = np.interp(seen[:, 0], np.arange(len(path.at)), path.at)
    crests = s[seen[:, 2] > 0.8 * height]
    assert crests.min() < -15.0 and crests.max() > stations.arc_length[-1] + 15.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_of_a_march_astray_what_is_alike_is_left(side):
    """It left the ridge for the flat ground beside it, where it saw a higher one."""
    points, _ = straight_ridge(24000, noise=0.05, half=(40, 30))
    on = known(*np.arange(-36.0, 1.0, 6.4))
    last = on[-1].position
    astray = [
        template_at(
            position=(last[0] + 3 * i, side * 5.4 * i, 0), height=9.0, turn=(0, 0, side * 1.1), std=on[0].std
        )
        for i in range(1, 6)
    ]
    ridge = whole(points, [*on, *astray])
    assert ridge.joint is not None
    assert np.abs(ridge.stations.spine[:, 1]).max() < 0.5
    assert np.abs(ridge.stations.height - 3.0).max() < 0.3
    assert ridge.stations.arc_length[-1] > 30.0


def test_a_template_out_of_line_among_its_neighbours_is_left_out():
    good = known(*np.arange(-36.0, 37.0, 6.4), scale=0.01)
    assert in_line(tuple(good)) == tuple(good)
    poor = template_at(position=(-4.0, 1.0, 0.5), height=1.8, std=good[5].std, scale=0.2)
    assert in_line((*good[:5], poor, *good[6:])) == (*good[:5], *good[6:])
    # A ridge may well be lower somewhere, or noisier; and of an end there is but one neighbour.
    low, noisy = poor.changed(scale=0.01), good[5].changed(scale=0.2)
    assert in_line((*good[:5], low, *good[6:])) == (*good[:5], low, *good[6:])
    assert in_line((*good[:5], noisy, *good[6:])) == (*good[:5], noisy, *good[6:])
    assert in_line((poor, *good)) == (poor, *good)


def test_the_ridge_goes_through_the_pick_whatever_it_runs_through():
    """A hill beside the pick fits neither part; the longer part was kept, and the pick lost."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-10.0, 80.0, 14000), rng.uniform(-14.0, 14.0, 14000)
    ridge = np.where((x >= 0.0) & (x <= 70.0), 2.0 * bell()(y / 6.0), 0.0)
    hill = 4.0 * np.maximum(1.0 - ((x - 20.0) ** 2 + y**2) / 36.0, 0.0)
    points = np.column_stack([x, y, np.maximum(ridge, hill)]) + rng.normal(0.0, 0.05, (14000, 3))
    found = rf.register(points, at=(6.0, 0.0, 2.0))
    assert np.linalg.norm(found.spine - (6.0, 0.0, 0.0), axis=1).min() < 1.0


@pytest.mark.parametrize("open_ends", [(True, True), (False, True), (True, False)])
def test_ends_far_wider_than_the_ridge_are_another_rise(open_ends):
    widths = [40.0, 16.0, *(8 * [8.0]), 16.0, 40.0]
    templates = [t.changed(width=w) for t, w in zip(known(*np.arange(0.0, 72.0, 6.0)), widths, strict=True)]
    stations = lay_out(tuple(templates), SETTINGS, False)
    kept = as_wide_as_usual(stations, open_ends)
    for end, may_move in ((0, open_ends[0]), (-1, open_ends[1])):
        assert (kept.width[end] <= OTHER_WIDTH * np.median(stations.width)) == may_move
        assert np.array_equal(kept.spine[end], stations.spine[end]) != may_move
    assert kept.arc_length[0] == 0.0


def test_what_is_usual_is_told_by_arc_length():
    """Nodes of a path lie closer where it is narrow: many of them are no long stretch."""
    at = np.concatenate([np.linspace(0.0, 60.0, 11), np.linspace(60.2, 70.0, 50)])
    width = np.where(at < 61.0, 8.0, 1.0)
    assert usual_ends(at, width, (True, True)) == (0, int(np.flatnonzero(at < 61.0)[-1]))
