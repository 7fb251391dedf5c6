"""Why a ridge ends: a flat base, or something that is none."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import ridgefeature as rf
from ridgefeature.continuation import FLAT
from ridgefeature.follows import ABOVE, BELOW
from ridgefeature.section import bell

Array = NDArray[np.float64]
WIDTH, HEIGHT, END = 10.0, 3.0, 20.0


def registered(beyond: Callable[[Array, Array], Array], upwards: int = 1, bent: float = 0.0) -> rf.Ridge:
    """A ridge along x that ends at END, and what lies beyond; on a base that is bent along it."""
    random = np.random.default_rng(0)
    x, y = random.uniform(-50, 50, 30_000), random.uniform(-30, 30, 30_000)
    z = np.maximum(np.where(x < END, HEIGHT * bell()(y / WIDTH), -np.inf), beyond(x, y))
    points = np.column_stack([x, y, upwards * z + bent * x * x]) + random.normal(0.0, 0.03, (30_000, 3))
    kind = "ridge" if upwards > 0 else "groove"
    return rf.register(points, (-20.0, 0.0, upwards * HEIGHT + 400 * bent), kind=kind, direction=(1, 0, 0))


def nothing(x: Array, y: Array) -> Array:
    return np.zeros_like(x)


def dome(x: Array, y: Array) -> Array:
    return np.sqrt(np.maximum(225.0 - (x - 30.0) ** 2 - y**2, 0.0))


def ramp(x: Array, y: Array) -> Array:
    return 0.7 * np.maximum(x - END, 0.0)


def pit(x: Array, y: Array) -> Array:
    return np.where(x > END, -6.0, 0.0)


@pytest.mark.parametrize(("beyond", "why"), [(dome, ABOVE), (ramp, ABOVE), (pit, BELOW)])
def test_what_a_ridge_runs_into_is_told(beyond: Callable[[Array, Array], Array], why: str) -> None:
    ridge = registered(beyond)
    assert 14.0 < ridge.spine[-1, 0] < 22.0
    assert ridge.stop == ("the data end here", why)


def test_of_a_groove_above_is_the_side_of_its_normal() -> None:
    ridge = registered(dome, upwards=-1)
    side = np.sign(ridge.normal[0, 2])
    assert ridge.stop[1] == (BELOW if side > 0 else ABOVE)


@pytest.mark.parametrize("bent", [0.0, 0.008, -0.008])
def test_a_base_goes_on_as_it_was_bent_before(bent: float) -> None:
    ridge = registered(nothing, bent=bent)
    assert abs(ridge.spine[-1, 0] - END) < 2.0
    assert ridge.stop[1] == FLAT
