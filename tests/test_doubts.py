"""Strays to one side of a ridge, and a pick off it, are doubts; strays strewn over all of it are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import ridgefeature as rf
from ridgefeature.commands import output
from ridgefeature.curvilinear import local_coordinates
from ridgefeature.readable import rows
from ridgefeature.section import bell

Array = NDArray[np.float64]
PICK = (0.0, 0.0, 3.0)


@pytest.fixture(scope="module")
def points() -> Array:
    """A straight ridge along x, 10 wide and 3 high."""
    random = np.random.default_rng(0)
    x, y = random.uniform(-40, 40, 15_000), random.uniform(-30, 30, 15_000)
    return np.column_stack([x, y, 3.0 * bell()(y / 10.0)]) + random.normal(0, 0.02, (15_000, 3))


@pytest.fixture(scope="module")
def ridge(points: Array) -> rf.Ridge:
    return rf.register(points, PICK)


def lifted(points: Array, share: float, low: float, high: float, where: NDArray[np.bool_]) -> Array:
    """The points, of which a share of those that are there is moved up by low to high."""
    random = np.random.default_rng(1)
    moved = where & (random.random(len(points)) < share)
    return points + np.outer(moved * random.uniform(low, high, len(points)), [0, 0, 1])


def test_neighbours_closer_than_the_feet_are_a_doubt() -> None:
    random = np.random.default_rng(0)
    x, y = random.uniform(-40, 40, 20_000), random.uniform(-25, 25, 20_000)
    z = np.maximum(2 * bell()(y / 8), 2 * bell()((y - 5) / 8)) + random.normal(0, 0.03, 20_000)
    scan = np.column_stack([x, y, z])
    found = rf.diagnose(rf.register(scan, (0, 0, 2)), scan)
    assert {why for *_, why in found.doubts} == {"strays lie to one side"}
    assert sum(high - low for low, high, _ in found.doubts) > 60


@pytest.mark.parametrize("flank", [(0.5, 4.0), (-4.0, -0.5)])
def test_strays_on_one_flank_are_a_doubt_where_they_are(
    flank: tuple[float, float], ridge: rf.Ridge, points: Array
) -> None:
    s, y, _ = local_coordinates(ridge, points)
    there = (s > 20) & (s < 40) & (y > flank[0]) & (y < flank[1])
    found = rf.diagnose(ridge, lifted(points, 0.8, 0.5, 1.5, there))
    ((low, high, why),) = found.doubts
    assert 19 < low < 27 and 33 < high < 41 and why == "strays lie to one side"


@pytest.mark.parametrize(("low", "high"), [(-3.0, 3.0), (0.0, 4.0)])
def test_strays_that_are_as_many_everywhere_are_no_doubt(
    low: float, high: float, ridge: rf.Ridge, points: Array
) -> None:
    found = rf.diagnose(ridge, lifted(points, 0.2, low, high, np.ones(len(points), bool)))
    assert found.outliers > 0.15
    assert found.doubts == ()


def picked_at(ridge: rf.Ridge, y: float, beyond: float) -> rf.Ridge:
    """The ridge as if it had been picked beside its end."""
    return replace(ridge, pick=ridge.spine[-1] + beyond * ridge.tangent[-1] + y * ridge.across[-1])


@pytest.mark.parametrize(("y", "beyond"), [(10.5, -30.0), (-10.5, -30.0), (0.0, 3.5)])
def test_a_pick_off_the_ridge_is_a_doubt_and_told(
    y: float, beyond: float, ridge: rf.Ridge, points: Array
) -> None:
    missed = picked_at(ridge, y, beyond)
    found = rf.diagnose(missed, points)
    ((low, high, why),) = found.doubts
    assert (low, high) == (0, ridge.length) and why.startswith("the pick lies ")
    told = dict(output.rows(missed, found))
    assert "from the ridge; see whether it is the one that is meant" in told["pick"]
    assert why in told["in doubt"]


@pytest.mark.parametrize(("y", "beyond"), [(9.5, -30.0), (-9.5, -30.0), (0.0, 2.5)])
def test_a_pick_on_the_ridge_or_close_to_it_is_none(
    y: float, beyond: float, ridge: rf.Ridge, points: Array
) -> None:
    near = picked_at(ridge, y, beyond)
    found = rf.diagnose(near, points)
    assert found.doubts == () and dict(rows(near, found))["in doubt"] == "no stretch"
    assert dict(output.rows(near, found))["pick"] == " ".join(f"{x:.6g}" for x in near.pick)
