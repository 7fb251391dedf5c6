"""A place on the screen means the scan point that is seen there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ridgefeature.viewer.picking import picked, thinned

SIZE = (400, 200)
PARALLEL = np.diag([0.1, 0.2, -0.1, 1.0])
"""Looking down on 20 x 10; what is high is in front."""


def grid() -> np.ndarray:
    x, y = np.meshgrid(np.arange(-9.0, 10.0), np.arange(-4.0, 5.0))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


@given(st.integers(0, 170))
def test_a_point_is_picked_where_it_is_seen(number: int) -> None:
    points = grid()
    x, y, _ = points[number]
    cursor = (200 + 20 * x + 2.0, 100 + 20 * y - 2.0)
    assert picked(points, PARALLEL, SIZE, cursor) == number


def test_what_is_behind_is_not_meant() -> None:
    points = np.array([[0.0, 0.0, -3.0], [0.2, 0.0, 4.0], [0.1, 0.0, 50.0]])
    assert picked(points, PARALLEL, SIZE, (200, 100)) == 1, "the third is nearer than what is seen at all"


def test_beside_all_points_nothing_is_picked() -> None:
    assert picked(grid(), PARALLEL, SIZE, (210, 110), reach=5.0) is None
    assert picked(np.empty((0, 3)), PARALLEL, SIZE, (210, 110)) is None


def test_behind_the_eye_nothing_is_picked() -> None:
    away = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, -1, 0]])
    assert picked(np.array([[0.0, 0.0, 2.0]]), away, SIZE, (200, 100)) is None
    assert picked(np.array([[0.0, 0.0, -2.0]]), away, SIZE, (200, 100)) == 0


@pytest.mark.parametrize(("count", "most"), [(10, 20), (1000, 7), (1000, 999), (1, 1)])
def test_thinned_numbers_are_spread_evenly(count: int, most: int) -> None:
    found = thinned(count, most)
    assert len(found) == min(count, most) and (np.diff(found) >= 1).all()
    assert found.max(initial=0) < count
    if most < count:
        assert np.ptp(np.diff(found)) <= 1
