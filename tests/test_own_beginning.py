"""A ridge that comes back to its own beginning is a ring."""

from __future__ import annotations

import numpy as np
import pytest

from ridgefeature.own_beginning import as_ring
from ridgefeature.stations import Stations


def circling(turns: float, radius: float = 20.0, rise: float = 0.0, bent: float = 0.0, fades: float = 0.0):
    """Stations of width 8 on a circle; rise: how far the path is from itself after a turn; bent: how far the
    first one lies aside; fades: share of the height that is lost to the end."""
    angle = np.linspace(0.0, 2.0 * np.pi * turns, round(60 * turns))
    far = radius + rise * angle / (2.0 * np.pi)
    far[:2] += bent
    spine = np.column_stack([far * np.cos(angle), far * np.sin(angle), 0.0 * angle])
    tangent = np.column_stack([-np.sin(angle), np.cos(angle), 0.0 * angle])
    n, ones = len(angle), np.ones(len(angle))
    height = 3.0 * (1.0 - fades * angle / angle[-1])
    up = np.tile([0.0, 0.0, 1.0], (n, 1))
    return Stations(radius * angle, spine, tangent, up, height, 8.0 * ones, 0.1 * ones, 0.1 * ones, ones)


@pytest.mark.parametrize("turns", [1.02, 1.3, 3.4])
@pytest.mark.parametrize("bent", [0.0, 4.0])
def test_what_runs_around_once_or_more_is_closed_after_one_turn(turns, bent):
    ring = as_ring(circling(turns + 0.15, bent=bent))
    assert ring is not None
    assert ring.arc_length[0] == 0.0
    assert abs(ring.arc_length[-1] - 40.0 * np.pi) < 2.2
    assert (ring.spine[-1] == ring.spine[0]).all()


@pytest.mark.parametrize(
    "open_one",
    [
        circling(0.97),
        circling(2.0, rise=6.0),
        circling(1.2, fades=0.9),
        circling(1.3, radius=3.0),
    ],
    ids=["a gap", "a spiral", "fades", "shorter than three widths"],
)
def test_what_does_not_meet_its_beginning_stays_open(open_one):
    assert as_ring(open_one) is None
