"""Straight pieces in a face's parameters: which of them meet."""

import numpy as np
import pytest

from cad_export.polylines import meetings


def test_pieces_of_one_straight_line_do_not_meet_others_further_along():
    random = np.random.default_rng(5)
    for _ in range(300):
        start, end = random.uniform(-40.0, 40.0, (2, 2))
        way = start + np.sort(random.uniform(0.0, 1.0, 24))[:, None] * (end - start)
        pieces = np.stack([way[:-1], way[1:]], axis=1)
        i, j = np.nonzero(meetings(pieces, pieces))
        assert (np.abs(i - j) <= 1).all()


@pytest.mark.parametrize("apart", [1e-6, 1.0])
def test_pieces_that_cross_meet_also_at_a_small_angle(apart):
    flat = np.array([[[-1.0, 0.0], [1.0, 0.0]]])
    tilted = np.array([[[-1.0, -apart], [1.0, apart]]])
    assert meetings(flat, tilted).all()
    assert not meetings(flat, tilted + np.array([0.0, 2.5 * apart])).any()
    assert not meetings(flat + np.array([2.5, 0.0]), tilted).any()
