"""How evenly points lie over a ridge, told by those that are no strays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ridgefeature.kernels.strip import TERMS, H, W
from ridgefeature.noise import Noise, evenness
from ridgefeature.section import bell

HEIGHT, WIDTH, NOISE = 6.0, 10.0, 0.2


def scanned(over_surface: bool, strays: float) -> np.ndarray:
    """Points of a bell in path coordinates, some of them strays that lie evenly over the base."""
    rng, n, eta = np.random.default_rng(2), 20000, np.linspace(-1.0, 1.0, 4001)
    way = eta
    if over_surface:
        way = np.concatenate(
            [[0.0], np.cumsum(np.hypot(WIDTH * np.diff(eta), HEIGHT * np.diff(bell()(eta))))]
        )
    y = np.interp(rng.uniform(way[0], way[-1], n), way, eta)
    points = np.column_stack([rng.uniform(0, 50, n), WIDTH * y, HEIGHT * bell()(y)])
    points[:, 1:] += rng.normal(0, NOISE, (n, 2))
    far = rng.random(n) < strays
    points[far, 1:] = rng.uniform([-WIDTH, -HEIGHT], [WIDTH, 2 * HEIGHT], (far.sum(), 2))
    return points


@pytest.mark.parametrize("strays", [0.0, 0.2])
@pytest.mark.parametrize("over_surface", [False, True])
def test_strays_do_not_make_points_lie_evenly_over_the_base(over_surface, strays):
    terms = np.zeros((51, TERMS))
    terms[:, H], terms[:, W] = HEIGHT, WIDTH
    noise = Noise(NOISE, max(strays, 1e-3), 0.01, 4 * HEIGHT, 0.5, NOISE)
    points = scanned(over_surface, strays)
    assert evenness(points, terms, bell(), noise) == pytest.approx(float(over_surface), abs=0.12)
    if over_surface and strays:  # all of them would seem to lie less evenly over the surface
        assert evenness(points, terms, bell(), replace(noise, scale=1e3)) < 0.88


@pytest.mark.filterwarnings("error")
def test_where_all_points_are_strays_they_lie_over_the_base():
    terms = np.zeros((51, TERMS))
    terms[:, H], terms[:, W] = HEIGHT, WIDTH
    far = np.column_stack([np.linspace(0, 50, 99), np.zeros(99), np.full(99, 9 * HEIGHT)])
    assert evenness(far, terms, bell(), Noise(NOISE, 0.01, 0.01, 4 * HEIGHT, 0.5, NOISE)) == 0.0
