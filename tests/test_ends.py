"""Where a ridge ends: the change point along the last template, and what its neighbours let expect."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import LOSSES, NO_TREND

from ridgefeature.ends import _extrapolated, trends
from ridgefeature.kernels import chain
from ridgefeature.section import bell
from ridgefeature.template import Template

H, W, NOISE = 1.0, 5.0, 0.3
TUKEY = LOSSES["tukey"], 5.0


def strip(end: float, seed: int, h: float = H, tilt: float = 0.0, other: float = np.inf) -> np.ndarray:
    """A ridge along x that ends at `end`, on a base that tilts along x; from `other` on, another one."""
    random = np.random.default_rng(seed)
    points = random.uniform([-6.0, -4.0, 0.0], [18.0, 4.0, 0.0], (600, 3))
    x, y, _ = points.T
    points[:, 2] = tilt * x + np.where(x < end, h, 0.0) * bell()(y / W)
    points[:, 2] += np.where(x > other, 6.0, 0.0) + random.normal(0, NOISE, len(points))
    return points


def found(points: np.ndarray, scale: float = NOISE) -> float:
    return chain.change_point(points, H, W, NO_TREND, bell().table, scale, *TUKEY)


@pytest.mark.parametrize("tilt", [-0.05, 0.0, 0.05])
def test_the_end_is_found_whatever_the_tilt_of_the_base(tilt):
    ends = np.random.default_rng(0).uniform(-2.0, 10.0, 60)
    errors = [found(strip(end, seed, tilt=tilt)) - end for seed, end in enumerate(ends)]
    assert np.sqrt(np.mean(np.square(errors))) < 0.6
    assert np.abs(errors).max() < 2.5


def test_an_end_far_from_the_middle_is_no_matter_of_the_order_of_points():
    points = strip(4.0, 3)
    assert found(points) == found(points[::-1].copy())


def test_another_ridge_beyond_the_end_does_not_count():
    assert found(strip(4.0, 5, other=14.0)) == pytest.approx(4.0, abs=1.0)


def test_where_the_ridge_explains_nothing_there_is_no_end():
    assert found(strip(-9.0, 1)) < -5.0
    assert found(np.empty((0, 3))) == -np.inf


def test_heights_and_widths_go_on_straight_but_change_by_less_than_a_third():
    places = np.array([[-30.0, 0, 0], [-20.0, 0, 0], [-10.0, 0, 0], [0.0, 0, 0]])
    assert _extrapolated(places, [3.0, 2.8, 2.6]) == pytest.approx((2.4, -0.02))
    assert _extrapolated(places, [9.0, 6.0, 3.0]) == pytest.approx((2.1, -0.3))
    assert _extrapolated(places[-2:], [2.0]) == (2.0, 0.0)


def test_trends_are_the_curvature_and_slopes_of_a_ring_that_tapers():
    radius, turn = 30.0, 0.2
    templates = []
    for i in range(6):
        a = i * turn
        axes = np.column_stack([[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0], [0, 0, 1]])
        place = radius * np.array([np.sin(a), 1 - np.cos(a), 0.0])
        templates.append(Template(place, axes, 8.0 - 0.3 * i, 3.0 - 0.1 * i, 6.0, 2.0, bell()))
    chord = 2 * radius * np.sin(turn / 2)
    for t in trends(templates):
        assert t.trend == pytest.approx([turn / chord, -0.1 / chord, -0.3 / chord], rel=1e-9)
    assert (trends(templates[:1])[0].trend == 0).all()
