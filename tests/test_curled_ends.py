"""Paths do not curl where a ridge falls to the base at its end."""

from __future__ import annotations

import numpy as np
import pytest

import ridgefeature as rf
from ridgefeature.curled_ends import uncurled
from ridgefeature.section import bell

WIDTH = 8.0
S = np.linspace(0.0, 60.0, 41)


def path(bend: float, curl: float = 0.0) -> np.ndarray:
    """An arc of this curvature in the plane z = 1, whose last 4 mm at either end turn off by `curl`."""
    turn = bend * S
    x, y = np.sinc(turn / np.pi) * S, 0.5 * S * turn * np.sinc(0.5 * turn / np.pi) ** 2
    aside = curl * (np.clip(4.0 - S, 0, None) ** 2 + np.clip(S - 56.0, 0, None) ** 2) / 16.0
    normal = np.column_stack([-np.sin(turn), np.cos(turn)])
    flat = np.column_stack([x, y]) + aside[:, None] * normal
    return np.column_stack([flat, np.ones(len(S))])


def falling(reach: float) -> np.ndarray:
    """Heights that fall to nothing over this length at both ends."""
    return 3.0 * np.clip(np.minimum(S, 60.0 - S) / reach, 0.05, 1.0)


UP, WIDE = np.tile([0.0, 0.0, 1.0], (len(S), 1)), np.full(len(S), WIDTH)


@pytest.mark.parametrize("bend", [0.0, 0.03, -1 / (1.5 * WIDTH)])
@pytest.mark.parametrize("curl", [1.2, -2.0])
def test_a_curl_is_taken_out_and_the_path_goes_on_as_it_bent(bend, curl):
    found = uncurled(path(bend, curl), UP, falling(4.0), WIDE)
    assert np.linalg.norm(path(bend, curl) - path(bend), axis=1).max() == pytest.approx(abs(curl), rel=1e-6)
    assert np.linalg.norm(found - path(bend), axis=1).max() < 0.05 * WIDTH
    inside = (S > 4.0) & (S < 56.0)
    np.testing.assert_array_equal(found[inside], path(bend, curl)[inside])


@pytest.mark.parametrize("bend", [0.0, 0.03, -1 / (1.5 * WIDTH)])
def test_a_path_that_does_not_curl_stays(bend):
    for heights in (falling(4.0), falling(20.0)):
        np.testing.assert_array_equal(uncurled(path(bend), UP, heights, WIDE), path(bend))


def test_an_end_that_does_not_fall_within_a_width_leads_where_it_does():
    for heights in (falling(30.0), np.full(len(S), 3.0)):
        np.testing.assert_array_equal(uncurled(path(0.0, 2.0), UP, heights, WIDE), path(0.0, 2.0))


def test_a_short_ridge_stays():
    some = slice(0, 6)
    given = path(0.0, 2.0)[some]
    np.testing.assert_array_equal(uncurled(given, UP[some], falling(4.0)[some], WIDE[some]), given)


def test_what_has_no_width_stays():
    np.testing.assert_array_equal(uncurled(path(0.0, 2.0), UP, falling(4.0), 0.0 * WIDE), path(0.0, 2.0))


def test_a_rounded_end_that_was_seen_from_one_side_does_not_turn_the_path():
    random = np.random.default_rng(3)
    x, y = random.uniform([[-15.0], [-18.0]], [[60.0], [18.0]], (2, 40_000))
    cap = np.clip(1.0 - (np.minimum(x - 0.6 * y, 0.0) / 5.0) ** 2, 0.0, None)
    points = np.column_stack([x, y, 6.0 * bell()(y / WIDTH) * cap + random.normal(0.0, 0.05, len(x))])
    seen = ~((y > 0.5) & (y < 3.0) & (points[:, 2] < 5.0))
    ridge = rf.register(points[seen], at=(30.0, 0.0, 6.0))
    assert np.abs(ridge.spine[:, 1]).max() < 0.1 * WIDTH
    assert ridge.length > 62.0
