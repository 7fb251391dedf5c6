"""What is left of a march that went astray over a part of its way."""

from __future__ import annotations

import numpy as np
import pytest

import ridgefeature as rf
from ridgefeature.astray import longest_part
from ridgefeature.grid import build_grid
from ridgefeature.refit import refitted
from ridgefeature.section import bell
from ridgefeature.stations import Stations

HEIGHT, WIDTH, LENGTH = 3.0, 10.0, 200.0


def along(spine: np.ndarray) -> Stations:
    k = len(spine)
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(spine, axis=0), axis=1))])
    tangent = np.gradient(spine, s, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    ones, normal = np.ones(k), np.tile([0.0, 0.0, 1.0], (k, 1))
    return Stations(s, spine, tangent, normal, HEIGHT * ones, WIDTH * ones, ones, ones, ones)


def straight(count: int) -> Stations:
    return along(np.linspace([0.0, 0.0, 0.0], [LENGTH, 0.0, 0.0], count))


def test_the_longest_run_of_good_stations_is_kept_less_a_width_where_others_follow():
    good = np.ones(41, dtype=bool)
    good[[3, 30]] = False
    part = longest_part(straight(41), good)
    assert part is not None
    assert part.arc_length[0] == 0.0
    assert part.spine[[0, -1], 0] == pytest.approx([20.0 + WIDTH, 145.0 - WIDTH])


@pytest.mark.parametrize("good", [np.zeros(41, dtype=bool), np.arange(41) < 3])
def test_too_few_good_stations_are_no_ridge(good):
    assert longest_part(straight(41), good) is None


def test_too_few_stations_for_a_spline_are_no_ridge_however_far_apart():
    good = np.arange(21) >= 16
    part = longest_part(straight(21), good)
    assert part is not None and len(part.arc_length) == 4
    assert longest_part(straight(21), np.arange(21) >= 17) is None


def test_a_ridge_is_fitted_along_what_a_march_did_not_leave_it_on():
    """Over a fifth of its way the march goes off to the side, as high and wide as the ridge."""
    random = np.random.default_rng(0)
    n = 20000
    x, y = random.uniform(-30, LENGTH + 30, n), random.uniform(-60, 60, n)
    z = np.where((x > 0) & (x < LENGTH), HEIGHT, 0.0) * bell()(y / WIDTH) + random.normal(0, 0.1, n)
    s = np.linspace(0.0, LENGTH, 61)
    aside = np.maximum(s - 0.75 * LENGTH, 0.0)
    marched = along(np.column_stack([s, 0.8 * aside, np.zeros(61)]))
    found = refitted(
        build_grid(np.column_stack([x, y, z])), marched, bell(), False, (True, True), rf.Settings()
    ).stations
    assert found.spine[0, 0] == pytest.approx(0.0, abs=0.2 * WIDTH)
    assert 0.7 * LENGTH < found.spine[-1, 0] < LENGTH + 0.2 * WIDTH
    # But for its very end: from there a march goes on.
    assert np.abs(found.spine[:-2, 1]).max() < 0.1 * WIDTH
    assert found.height == pytest.approx(HEIGHT, rel=0.1)
