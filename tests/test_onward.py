"""A ridge marched on from the ends of its whole fit, whose section and width are known by then."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import template_at

import ridgefeature as rf
from ridgefeature.grid import build_grid, typical_spacing
from ridgefeature.march import Track
from ridgefeature.onward import followed
from ridgefeature.refit import refitted
from ridgefeature.section import dome
from ridgefeature.stations import lay_out
from ridgefeature.window import Window

SETTINGS = rf.Settings()
FLAT = "no ridge: the data agree with a flat base"
WIDTH, HEIGHT, LEG = 8.0, 2.0, 30.0


def legs(turn: float, noise: float = 0.06, n: int = 16000, beyond: float = 0.0) -> np.ndarray:
    """A ridge from x = -30 to the origin and on for 30 where it turns by so many degrees.

    beyond: height of the ground where x < -30.
    """
    random = np.random.default_rng(1)
    xy = random.uniform(-48, 48, (n, 2))
    nearest = np.full(n, np.inf)
    for angle in (np.pi, np.radians(turn)):
        way = np.array([np.cos(angle), np.sin(angle)])
        along = np.clip(xy @ way, 0, LEG)
        nearest = np.minimum(nearest, np.linalg.norm(xy - along[:, None] * way, axis=1))
    z = np.where(xy[:, 0] < -LEG, beyond, HEIGHT * dome()(nearest / WIDTH))
    return np.column_stack([xy, z]) + random.normal(0, noise, (n, 3))


def from_known(points: np.ndarray, low: float, high: float, stop: tuple[str, str]):
    """The whole fit of the first leg between two places, and the same followed on."""
    full = Window(build_grid(points), typical_spacing(build_grid(points)))
    places = np.arange(low + 3.2, high, 6.4)
    templates = tuple(
        template_at(HEIGHT, WIDTH, (x, 0, 0), section=dome(), std=np.full(8, 0.05), scale=0.05, points=300)
        for x in places
    )
    stations = lay_out(templates, SETTINGS)
    fixed = refitted(full.grid, stations, dome(), False, (False, False), SETTINGS)
    track = Track(templates, stop)
    return (fixed, track), followed(full.thinned(400), full, fixed, track, SETTINGS)


@pytest.mark.parametrize("turn", [0.0, 60.0, 90.0])
def test_a_whole_fit_that_ends_too_early_is_followed_to_the_end_round_a_corner_too(turn):
    (fixed, track), (found, longer) = from_known(legs(turn), -27.0, -4.0, (FLAT, FLAT))
    assert fixed.stations.arc_length[-1] < 26.0
    assert found.stations.arc_length[-1] == pytest.approx(2 * LEG, abs=6.0)
    way = np.array([np.cos(np.radians(turn)), np.sin(np.radians(turn)), 0.0])
    assert np.linalg.norm(found.stations.spine[-1] - LEG * way) < 0.5 * WIDTH
    assert len(longer.templates) > len(track.templates)
    assert np.median(found.stations.height) == pytest.approx(HEIGHT, rel=0.05)


def test_an_end_that_is_one_stays_and_so_does_one_that_is_not_open():
    points = legs(0.0)
    (fixed, track), (found, same) = from_known(points, -30.0, 30.0, (FLAT, FLAT))
    assert found is fixed and same is track
    stop = ("interrupted", "max_templates (3) reached")
    (fixed, track), (found, same) = from_known(points, -27.0, -4.0, stop)
    assert found is fixed and same is track


def test_ground_as_high_as_the_ridge_is_not_run_over():
    _, (found, _) = from_known(legs(0.0, beyond=HEIGHT), -28.0, 30.0, (FLAT, FLAT))
    assert found.stations.spine[:, 0].min() > -LEG - 0.5 * WIDTH


def test_one_click_on_a_ridge_with_a_sharp_corner_finds_both_legs():
    ridge = rf.register(legs(90.0), at=(-20.0, 0.0, HEIGHT))
    assert ridge.length == pytest.approx(2 * LEG, abs=6.0)
