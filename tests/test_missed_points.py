"""A whole fit that would begin where its points are strays begins where most of them are."""

from __future__ import annotations

import numpy as np
import pytest

from ridgefeature.grid import build_grid
from ridgefeature.kernels.agreement import agreed_heights
from ridgefeature.kernels.strip import TERMS, A, B, H, W
from ridgefeature.missed_points import with_missed_points
from ridgefeature.noise import Noise
from ridgefeature.refit import refitted
from ridgefeature.section import bell
from ridgefeature.settings import Settings
from ridgefeature.stations import Stations

NODES, HEIGHT, WIDTH = 41, 3.0, 10.0
NOISE = Noise(0.02, 0.01, 0.001, 4 * HEIGHT, 0.0, 0.02)


def points(random: np.random.Generator, heights: np.ndarray, strays: float = 0.0) -> np.ndarray:
    """Path coordinates of a bell's points, with heights (NODES,) at the nodes."""
    n = 60 * NODES
    s, y = random.uniform(0, NODES - 1, n), random.uniform(-WIDTH, WIDTH, n)
    z = np.interp(s, np.arange(NODES), heights) * bell()(y / WIDTH) + random.normal(0, NOISE.scale, n)
    stray = random.random(n) < strays
    z[stray] = random.uniform(-HEIGHT, 2 * HEIGHT, stray.sum())
    return np.column_stack([s, y, z])


def terms(heights: np.ndarray) -> np.ndarray:
    out = np.zeros((NODES, TERMS))
    out[:, H], out[:, W] = heights, WIDTH
    return out


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("strays", [0.0, 0.2])
def test_heights_that_hardly_any_point_agrees_with_are_found(sign, strays):
    true = np.linspace(0.6, 1.2, NODES) * HEIGHT
    known = np.where(np.arange(NODES) < 8, 0.5 * true, true)
    found = with_missed_points(
        points(np.random.default_rng(0), sign * true, strays), terms(sign * known), bell(), NOISE
    )
    assert found[:, H] == pytest.approx(sign * true, rel=0.05)
    assert (found[12:] == terms(sign * known)[12:]).all()


def test_terms_that_points_agree_with_stay():
    true = np.linspace(0.6, 1.2, NODES) * HEIGHT
    known = terms(true)
    assert (with_missed_points(points(np.random.default_rng(1), true), known, bell(), NOISE) == known).all()


def test_a_ridge_begins_beyond_its_end_only_where_points_stand_over_the_flats():
    true = np.where(np.arange(NODES) < 30, HEIGHT, 0.0)
    known = np.where(np.arange(NODES) < 22, HEIGHT, 0.0)
    scan = points(np.random.default_rng(2), true)
    found = with_missed_points(scan, terms(known), bell(), NOISE)[:, H]
    assert found[:29] == pytest.approx(HEIGHT, rel=0.05)
    assert (found[33:] == 0).all()
    # The whole ground as high as the ridge is no ridge.
    scan[scan[:, 0] > 22, 2] = HEIGHT
    assert (with_missed_points(scan, terms(known), bell(), NOISE)[25:, H] == 0).all()


def test_a_base_that_lies_lower_or_leans_is_found_and_the_height_over_it():
    scan = points(np.random.default_rng(3), np.full(NODES, HEIGHT))
    low = scan[:, 0] > 30
    scan[low, 2] += -2.0 + 0.1 * scan[low, 1]
    known = np.where(np.arange(NODES) > 30, 0.5, 1.0) * HEIGHT
    found = with_missed_points(scan, terms(known), bell(), NOISE)
    assert found[34:, A] == pytest.approx(-2.0, abs=0.1)
    assert found[34:, B] == pytest.approx(0.1, abs=0.02)
    assert found[34:, H] == pytest.approx(HEIGHT, rel=0.05)
    assert (found[:27, [A, B]] == 0).all()


def test_what_lies_lower_than_a_march_has_it_is_not_taken_for_the_ridge():
    """It may be another thing that the march ran along: the fit is to miss it, and to be cut there."""
    known = terms(np.full(NODES, HEIGHT))
    scan = points(np.random.default_rng(4), np.where(np.arange(NODES) < 30, HEIGHT, 0.4 * HEIGHT))
    assert (with_missed_points(scan, known, bell(), NOISE)[:, H] == HEIGHT).all()


def test_without_any_height_nothing_is_known():
    flat = terms(np.zeros(NODES))
    scan = points(np.random.default_rng(6), np.full(NODES, HEIGHT))
    assert (with_missed_points(scan, flat, bell(), NOISE) == flat).all()


@pytest.mark.parametrize("count", [0, 3])
def test_few_points_change_nothing(count):
    known = terms(np.full(NODES, HEIGHT))
    assert (with_missed_points(np.zeros((count, 3)), known, bell(), NOISE) == known).all()


def test_a_ridge_is_followed_to_its_end_at_low_noise_from_far_before():
    """A fit that begins without height beyond an early end would take all points of its top for strays."""
    random = np.random.default_rng(5)
    n, length = 30000, 120.0
    x, y = random.uniform(-20, length + 20, n), random.uniform(-2 * WIDTH, 2 * WIDTH, n)
    z = np.where((x > 0) & (x < length), HEIGHT, 0.0) * bell()(y / WIDTH) + random.normal(0, 0.005, n)
    stray = random.random(n) < 0.1
    z[stray] = random.uniform(-HEIGHT, 2 * HEIGHT, stray.sum())
    s, ones, axes = np.linspace(0.0, 100.0, 41), np.ones(41), np.eye(3)
    known = Stations(
        arc_length=s,
        spine=s[:, None] * axes[0],
        tangent=np.tile(axes[0], (41, 1)),
        normal=np.tile(axes[2], (41, 1)),
        height=HEIGHT * ones,
        width=WIDTH * ones,
        height_std=ones,
        width_std=ones,
        border=ones,
    )
    grid = build_grid(np.column_stack([x, y, z]))
    found = refitted(grid, known, bell(), False, (True, True), Settings()).stations
    assert found.spine[-1, 0] == pytest.approx(length, abs=0.1 * WIDTH)
    assert found.height == pytest.approx(HEIGHT, rel=0.02)


@pytest.mark.parametrize("share", [0.0, 0.4, 0.9])
def test_agreed_heights_are_those_of_a_search_about_every_node(share):
    random = np.random.default_rng(7)
    known, places = random.uniform(2, 3, NODES), random.uniform(0, NODES - 1, 900)
    heights = np.interp(places, np.arange(NODES), known) + random.normal(0, 0.1, 900)
    off, near = 0.3, 0.4
    other = random.random(900) < share
    heights[other] = random.normal(5, 0.2, other.sum())
    found = agreed_heights(places, heights, known, off, near, 2, 6, 0.5)
    agrees = np.abs(heights - np.interp(places, np.arange(NODES), known)) < off
    for k in range(NODES):
        about = np.abs((places + 0.5).astype(int) - k) <= 2
        median = np.median(heights[about])
        told = (np.abs(heights[about] - median) < near).sum()
        few = agrees[about].sum() < 0.5 * about.sum()
        good = about.sum() >= 6 and few and told > max(agrees[about].sum(), 0.5 * about.sum())
        assert found[k] == (pytest.approx(median, rel=1e-12) if good else pytest.approx(np.nan, nan_ok=True))
    assert np.isfinite(found).any() == (share > 0.5)
    assert np.isnan(agreed_heights(places[:0], heights[:0], known, off, near, 2, 6, 0.5)).all()
