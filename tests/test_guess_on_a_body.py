"""GUESS on a body that rises itself, and explains far more of the scan than the ridge on it."""

from __future__ import annotations

import numpy as np
import pytest

import ridgefeature as rf
from ridgefeature.section import plateau

WIDTH, HEIGHT = 15.0, 3.5


def hill(tall: float, wide: float) -> np.ndarray:
    """A hill with a straight ridge along x on its side, few points a width."""
    random = np.random.default_rng(0)
    x, y = random.uniform(-115.0, 115.0, (3400, 2)).T
    z = tall * np.exp(-0.5 * (y / wide) ** 2 - 0.5 * (x / (1.5 * wide)) ** 2)
    z += np.where(np.abs(x + 10.0) < 45.0, HEIGHT * plateau()((y - 20.0) / WIDTH), 0.0)
    return np.column_stack([x, y, z]) + random.normal(0.0, 0.15, (3400, 3))


@pytest.mark.parametrize(("tall", "wide"), [(50.0, 40.0), (60.0, 50.0), (80.0, 60.0)])
def test_what_is_too_large_for_a_ridge_leaves_the_one_on_it_to_be_found(tall, wide):
    points = hill(tall, wide)
    click = points[np.argmin(np.hypot(points[:, 0] + 10.0, points[:, 1] - 20.0))]
    ridge = rf.register(points, at=click)
    assert 80.0 < ridge.length < 100.0
    assert abs(np.median(ridge.height) - HEIGHT) < 0.2 * HEIGHT
    assert np.abs(ridge.spine[:, 1] - 20.0).max() < 3.0


def test_a_width_that_was_given_is_kept_to():
    points = hill(50.0, 40.0)
    click = points[np.argmin(np.hypot(points[:, 0] + 10.0, points[:, 1] - 20.0))]
    with pytest.raises(rf.NoRidgeError):
        rf.register(points, at=click, width=150.0)
