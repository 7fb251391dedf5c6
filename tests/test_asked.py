"""A direction that was given and does not agree with the ridge is told."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from cli_helpers import run
from numpy.typing import NDArray

import ridgefeature as rf
from ridgefeature.section import bell

PICK = (0.0, 0.0, 3.0)


@pytest.fixture(scope="module")
def points() -> NDArray[np.float64]:
    """A straight ridge along x, 10 wide and 3 high."""
    random = np.random.default_rng(0)
    x, y = random.uniform(-40, 40, 15_000), random.uniform(-30, 30, 15_000)
    return np.column_stack([x, y, 3.0 * bell()(y / 10.0)]) + random.normal(0, 0.02, (15_000, 3))


def test_a_direction_off_the_ridge_is_a_warning_that_tells_both(points: NDArray[np.float64]) -> None:
    with pytest.warns(
        UserWarning, match=r"direction: .* got \(0, 0, 2\); .* along \(-?1, 0, 0\) .* 90 degrees off"
    ) as told:
        rf.register(points, PICK, direction=(0, 0, 2))
    assert told[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rf.register(points, PICK, direction=(1, 1, 0))
        rf.register(points, PICK, direction=(-1, 0.5, 0))


def test_a_refusal_tells_along_which_direction_it_was_looked_for(points: NDArray[np.float64]) -> None:
    flat = points * [1, 1, 0]
    with pytest.raises(rf.NoRidgeError, match=r"for along \(0, 1, 0\): leave direction= out"):
        rf.register(flat, (0, 0, 0), direction=(0, 3, 0))
    with pytest.raises(rf.NoRidgeError) as plain:
        rf.register(flat, (0, 0, 0))
    assert "looked for along" not in str(plain.value)


def test_the_command_line_names_its_own_option(points: NDArray[np.float64], tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", points)
    quiet = "--no-step", "--no-pictures", "--out", tmp_path / "out"
    result = run("register", tmp_path / "a.npy", "--at", *PICK, "--direction", 0, 0, 1, *quiet)
    assert result.exit_code == 0
    [line] = result.stderr.splitlines()
    assert line.startswith("ridgefeature: warning: --direction: expected one along the ridge, got (0, 0, 1)")
    assert "its own --direction or leave" in line
