"""NLopt by its C functions and by its Python module: the same answers, and one stands in for the other."""

from __future__ import annotations

import nlopt
import numpy as np
import pytest
from oracles import LOSSES, NO_TREND, straight_ridge

import ridgefeature as rf
from ridgefeature import improve as improving
from ridgefeature import optimise
from ridgefeature.kernels import fit
from ridgefeature.kernels.appraise import prepare
from ridgefeature.kernels.objective import objective
from ridgefeature.section import bell
from ridgefeature.synthetic import Spiral

FREE = np.full(7, -np.inf), np.full(7, np.inf)
HIDDEN = optimise.c_functions() is None
needs_c = pytest.mark.skipif(HIDDEN, reason="this build of nlopt hides its C functions")


def problem(name: str = "huber") -> np.ndarray:
    points = straight_ridge(400, noise=0.1, seed=1, outliers=0.05, half=(4, 6))[0]
    prior = np.array([[0, 0, 0, 0, 0, 0, 3.0, 8.0], np.full(8, 1e-2)])
    return prepare(points, 2.6, 7.0, NO_TREND, bell().table, 0.01, prior, LOSSES[name], 3.0)[2]


@needs_c
@pytest.mark.parametrize("algorithm", ["LD_LBFGS", "LD_SLSQP", "LD_MMA", "LN_BOBYQA", "LN_NELDERMEAD"])
@pytest.mark.parametrize("name", LOSSES)
def test_both_interfaces_take_the_same_steps(algorithm, name):
    packed = problem(name)
    compiled = fit.minimise(optimise.c_functions(), packed, *FREE, 1e-5, 500, getattr(nlopt, algorithm))
    python = optimise.minimise(lambda q, g: objective(q, g, packed), *FREE, 1e-5, 500, algorithm)
    np.testing.assert_allclose(compiled[0], python[0], atol=1e-6)
    assert compiled[2] > 0 and optimise.status_of(compiled[2]) == optimise.status_of(python[2])
    assert np.linalg.norm(compiled[0]) > 0.5


@needs_c
def test_bounds_and_limits_hold():
    c, packed, low, high = optimise.c_functions(), problem(), np.full(7, -0.1), np.full(7, 0.1)
    q, evaluations, result = fit.minimise(c, packed, low, high, 1e-6, 100, nlopt.LD_LBFGS)
    assert np.abs(q).max() == pytest.approx(0.1) and evaluations <= 100
    q, evaluations, result = fit.minimise(c, packed, *FREE, 1e-12, 3, nlopt.LD_LBFGS)
    assert evaluations == 3 and optimise.status_of(result) == "limit"


@needs_c
def test_what_nlopt_cannot_do_is_a_failure_and_moves_nothing():
    c, packed = optimise.c_functions(), problem()
    _, _, result = fit.minimise(c, packed, FREE[1], FREE[0], 1e-6, 100, nlopt.LD_LBFGS)
    assert optimise.status_of(result) == "failed"


def test_a_whole_registration_without_the_c_functions_is_the_same(monkeypatch):
    spiral = Spiral()
    points = spiral.points(10_000, noise=0.1)
    at = (*spiral.spine(np.array(8.0))[:2], float(spiral.height(np.array(8.0))))
    usual = rf.register(points, at=at)
    monkeypatch.setattr(improving, "c_functions", lambda: None)
    other = rf.register(points, at=at)
    assert len(usual.templates) == len(other.templates) > 10
    np.testing.assert_allclose(usual.height, other.height, rtol=1e-6)
    np.testing.assert_allclose(usual.width, other.width, rtol=1e-6)


def test_a_library_without_the_functions_is_no_error(monkeypatch):
    class Hides:
        def __init__(self, name: str) -> None:
            pass

    monkeypatch.setattr(optimise.ctypes, "CDLL", Hides)
    optimise.c_functions.cache_clear()
    try:
        assert optimise.c_functions() is None
    finally:
        optimise.c_functions.cache_clear()


def test_a_function_that_raises_is_not_swallowed():
    def value(q, gradient):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        optimise.minimise(value, *FREE, 1e-3, 10, "LD_LBFGS")
