"""Scans that say the same point many times over."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import apex, spiral_points, spiral_ridge

import ridgefeature as rf


def test_a_scan_given_twice_over_is_the_same_ridge_within_its_bands():
    twice = rf.register(np.repeat(spiral_points(), 2, axis=0), apex())
    assert twice.length == pytest.approx(spiral_ridge().length, rel=0.03)
    assert twice.height.max() == pytest.approx(spiral_ridge().height.max(), rel=0.03)


def test_points_that_are_all_repeated_often_end_in_a_value_error():
    points = np.repeat(np.random.default_rng(0).normal(size=(40, 3)), 200, axis=0)
    with pytest.raises(ValueError, match="point"):
        rf.register(points, points[0])
