"""Coefficients with one hump, against what scipy and brute force find."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from ridgefeature.one_hump import not_negative, one_hump, symmetric_hump

seeds = st.integers(0, 10_000)


def humps(x: np.ndarray) -> int:
    """Number of stretches that fall, of coefficients between zeros."""
    change = np.sign(np.diff(x, prepend=0.0, append=0.0))
    change = change[change != 0]
    return int((np.diff(change) < 0).sum())


def problem(seed: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=n), np.triu(rng.normal(size=(n, n))) + 2.0 * np.eye(n)


@settings(max_examples=60, deadline=None)
@given(seeds, st.integers(1, 12), st.integers(0, 8))
def test_factors_are_those_of_scipy(seed, n, more):
    rng = np.random.default_rng(seed)
    columns, goal = rng.normal(size=(n + more, n)), rng.normal(size=n + more)
    found, loss = not_negative(columns, goal)
    wanted, miss = nnls(columns, goal)
    assert (found >= 0).all()
    np.testing.assert_allclose(found, wanted, atol=1e-8)
    assert loss == pytest.approx(miss**2, abs=1e-10)


def test_nothing_to_gain_gives_zeros():
    found, loss = not_negative(np.eye(3), np.array([-1.0, 0.0, -2.0]))
    assert found.tolist() == [0.0, 0.0, 0.0] and loss == 5.0


@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(2, 7))
def test_one_hump_is_the_best_of_all_tops(seed, n):
    free, root = problem(seed, n)
    free = free - free.min() + 0.1
    found, loss = one_hump(free, root)
    assert humps(found) <= 1 and (found >= -1e-12).all()
    assert loss == pytest.approx(float(((root @ (found - free)) ** 2).sum()), rel=1e-6, abs=1e-9)
    for top in range(n):
        if free[top] <= 0.6 * free.max():
            continue
        # Brute force: every set of steps that may be 0.
        at = np.arange(n)
        same = (at[:, None] <= top) == (at <= top)
        sums = np.where(at[:, None] <= top, np.tri(n), np.tri(n).T) * same
        for used in itertools.product([False, True], repeat=n):
            columns = (root @ sums)[:, list(used)]
            steps = np.linalg.lstsq(columns, root @ free, rcond=None)[0]
            if (steps >= 0).all():
                assert loss <= float(((root @ free - columns @ steps) ** 2).sum()) + 1e-9


def test_what_has_one_hump_already_stays():
    free = np.array([0.1, 0.5, 0.9, 0.9, 0.3])
    found, loss = one_hump(free, np.eye(5))
    assert found is free and loss == 0.0


@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(3, 20))
def test_a_symmetric_hump_is_symmetric_and_has_one_hump(seed, n):
    free, root = problem(seed, n)
    found, _, loss = symmetric_hump(np.abs(free), root)
    assert np.allclose(found, found[::-1]) and humps(found) <= 1
    assert loss >= -1e-12


@pytest.mark.parametrize("shift", [-0.3, 0.0, 0.2])
def test_a_symmetric_hump_that_was_moved_is_found_with_its_move(shift):
    at = np.arange(31) - 15.0
    free = np.exp(-0.5 * ((at - shift) / 4.0) ** 2)
    found, moved, loss = symmetric_hump(free, np.eye(31))
    assert moved == pytest.approx(shift, abs=0.02)
    assert np.abs(found - np.exp(-0.5 * (at / 4.0) ** 2)).max() < 5e-3
    assert loss < 1e-3
