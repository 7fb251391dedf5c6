"""IMPROVE: one template onto a straight ridge whose height and width are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles import LOSSES, NO_TREND, jacobian, straight_ridge, template_at, window_on

from ridgefeature import Settings
from ridgefeature.improve import FEWEST_POINTS, improve, judge, limits_of, loss_of, refine, sized, start_loss
from ridgefeature.section import bell, plateau

SETTINGS = Settings()
FINE = Settings(tolerance=1e-7, max_evaluations=400)
HEIGHT, WIDTH = 3.0, 8.0


def fitted(window, start, settings=SETTINGS):
    """Roughly, then to the last digit, as the march and what follows it do."""
    rough = improve(window, start, settings)
    return refine(window, rough, limits_of(rough.height, rough.width, settings), settings)


def off_start(section=None):
    """A start that is off by a tenth in size and a few degrees in direction."""
    return template_at(2.5, 9.0, (0.3, 0.4, 0.2), (0.05, -0.05, 0.08), section)


def assert_true(template, digits=1e-6):
    """The template lies on the ridge along x of `straight_ridge`; how far along it is free."""
    assert template.height == pytest.approx(HEIGHT, rel=digits)
    assert template.width == pytest.approx(WIDTH, rel=digits)
    assert np.abs(template.position[1:]).max() < digits * WIDTH
    np.testing.assert_allclose(template.rotation, np.eye(3), atol=digits)


# Without noise


@pytest.mark.parametrize("section", [bell(), plateau()], ids=lambda s: s.name)
def test_without_noise_a_fit_converges_to_the_truth(section):
    window = window_on(straight_ridge(4000, section=section)[0])
    template = fitted(window, off_start(section), FINE)
    assert template.status == "converged"
    assert_true(template)


@pytest.mark.parametrize("loss", LOSSES)
def test_every_loss_converges_to_the_truth(loss):
    template = fitted(window_on(straight_ridge(4000)[0]), off_start(), replace(FINE, loss=loss))
    assert_true(template)


@pytest.mark.parametrize(
    "optimiser", ["LD_SLSQP", "LD_LBFGS", "LD_MMA", "LD_CCSAQ", "LD_VAR2", "LD_TNEWTON_PRECOND"]
)
def test_every_gradient_optimiser_converges_to_the_truth(optimiser):
    template = fitted(window_on(straight_ridge(4000)[0]), off_start(), replace(FINE, optimiser=optimiser))
    assert template.status in ("converged", "limit")
    assert_true(template)


def test_an_optimiser_without_gradients_serves_too():
    settings = replace(FINE, optimiser="LN_BOBYQA")
    template = fitted(window_on(straight_ridge(4000)[0]), off_start(), settings)
    assert (template.height, template.width) == pytest.approx((HEIGHT, WIDTH), rel=1e-4)


def test_a_fit_is_the_same_wherever_it_is_done_in_space():
    points, _ = straight_ridge(4000, noise=0.1, seed=2)
    here = fitted(window_on(points), template_at(2.8, 8.5), FINE)
    turn, shift = template_at(turn=(0.7, -0.4, 1.9)).rotation, np.array([300.0, -200.0, 50.0])
    there = fitted(window_on(points @ turn.T + shift), template_at(2.8, 8.5, shift, (0.7, -0.4, 1.9)), FINE)
    assert (there.height, there.width) == pytest.approx((here.height, here.width), rel=1e-6)
    np.testing.assert_allclose(there.position, turn @ here.position + shift, atol=1e-5)
    np.testing.assert_allclose(there.rotation, turn @ here.rotation, atol=1e-6)


@pytest.mark.parametrize("k", [1, 2])
def test_the_papers_measure_serves_too_and_is_weaker(k):
    settings = replace(SETTINGS, measure="M", k=k)
    template = fitted(window_on(straight_ridge(8000)[0]), off_start(), settings)
    assert template.status in ("converged", "limit")
    assert (template.height, template.width) == pytest.approx((HEIGHT, WIDTH), rel=0.15)


def test_the_default_tolerance_is_fine_enough_for_a_ten_thousandth():
    assert_true(fitted(window_on(straight_ridge(4000)[0]), off_start()), 1e-4)


# What a fit says


def test_a_fit_reports_status_evaluations_points_scale_and_evidence():
    points, _ = straight_ridge(4000, noise=0.1, seed=1)
    window = window_on(points)
    template = fitted(window, off_start())
    assert template.status == "converged"
    assert 1 <= template.evaluations <= 4 * SETTINGS.max_evaluations
    assert template.scale == pytest.approx(0.1, rel=0.1)
    assert template.evidence > 1000
    judged = judge(window(template), template, SETTINGS)
    assert 500 < judged.inliers <= judged.points == len(window(template))
    assert judged.std[0] == 0 and (judged.std[1:] > 0).all() and np.isfinite(judged.std).all()


def test_a_fit_that_runs_out_of_evaluations_says_so():
    window = window_on(straight_ridge(4000)[0])
    template = refine(
        window, off_start(), limits_of(2.5, 9.0, SETTINGS), replace(SETTINGS, max_evaluations=2)
    )
    assert template.status == "limit"


def test_a_fit_leaves_its_start_as_it_was():
    start = off_start()
    improve(window_on(straight_ridge(2000)[0]), start, SETTINGS)
    assert (start.height, start.width, start.status) == (2.5, 9.0, "start")


# Hopeless data: a status, never an exception


def hopeless():
    random = np.random.default_rng(5)
    flat = np.column_stack([random.uniform(-12, 12, (2000, 2)), np.zeros(2000)])
    spikes = random.standard_cauchy((2000, 3)) * [3, 3, 1]
    return {
        "flat": flat,
        "noise in a box": random.uniform(-8, 8, (2000, 3)),
        "wild": spikes,
        "a wall across": np.column_stack([0 * flat[:, 0], flat[:, :2]]),
        "two levels": flat + np.column_stack([0 * flat[:, :2], 2.0 * (flat[:, 1] > 0)]),
        "the same point over and over": np.concatenate([np.repeat(flat[:1], 300, axis=0), flat[:40]]),
        "huge": 1e7 * flat,
        "few": flat[:60],
    }


@pytest.mark.parametrize("name", hopeless())
@pytest.mark.parametrize("height", [3.0, -3.0, 1e-9, 0.0])
def test_hopeless_data_end_in_a_status(name, height):
    window, start = window_on(hopeless()[name]), template_at(height, WIDTH)
    for template in (improve(window, start, SETTINGS), fitted(window, start)):
        assert template.status in ("converged", "limit", "failed", "no data")
        assert np.isfinite([template.height, template.width, *template.position]).all()
        assert 0 < template.width <= 4 * WIDTH
        np.testing.assert_allclose(template.rotation.T @ template.rotation, np.eye(3), atol=1e-9)


def test_too_few_points_are_no_data():
    points, _ = straight_ridge(4000)
    window = window_on(points)
    away = template_at(HEIGHT, WIDTH, (500, 0, 0))
    assert improve(window, away, SETTINGS).status == "no data"
    assert refine(window, away, limits_of(HEIGHT, WIDTH, SETTINGS), SETTINGS).status == "no data"
    assert improve(window, away, SETTINGS).points < FEWEST_POINTS
    assert start_loss(window, away, 0.1) == np.inf


def test_flat_data_give_no_evidence():
    random = np.random.default_rng(6)
    flat = np.column_stack([random.uniform(-12, 12, (4000, 2)), random.normal(0, 0.1, 4000)])
    assert fitted(window_on(flat), template_at(1.0, WIDTH)).evidence < SETTINGS.evidence


# Limits and sizes


def test_limits_hold_height_and_width():
    limits = limits_of(HEIGHT, WIDTH, SETTINGS.marching())
    assert (limits.narrowest, limits.widest) == (WIDTH / 1.5, WIDTH * 1.5)
    assert (limits.lowest, limits.highest) == (0.0, 2 * HEIGHT)
    window = window_on(straight_ridge(4000, height=1.0, width=20.0, half=(20, 20))[0])
    template = refine(window, template_at(HEIGHT, WIDTH), limits, SETTINGS)
    assert limits.narrowest - 1e-9 <= template.width <= limits.widest + 1e-9
    assert limits.lowest - 1e-9 <= template.height <= limits.highest + 1e-9


def test_a_first_fit_may_turn_a_ridge_into_a_groove_and_a_marching_one_not():
    free, marching = limits_of(HEIGHT, WIDTH, SETTINGS), limits_of(-HEIGHT, WIDTH, SETTINGS.marching())
    assert (free.lowest, free.highest) == (-4 * HEIGHT, 4 * HEIGHT)
    assert (marching.lowest, marching.highest) == (-2 * HEIGHT, 0.0)


def test_templates_grow_longer_where_the_data_are_poor():
    good = sized(template_at(points=2000, scale=0.1), SETTINGS)
    poor = sized(template_at(points=60, scale=1.0), SETTINGS)
    assert good.length == SETTINGS.length * WIDTH
    assert poor.length == SETTINGS.longest * SETTINGS.length * WIDTH
    assert poor.flank == SETTINGS.flank * WIDTH


def test_the_loss_of_the_settings_is_the_kernels():
    assert [loss_of(replace(SETTINGS, loss=n, tuning=2.0)) for n in LOSSES] == [
        (k, 2.0) for k in LOSSES.values()
    ]


# Against the Cramer-Rao bound


def errors_in_bounds(outliers: float, windows: int = 160, noise: float = 0.1) -> np.ndarray:
    """(windows, 2) errors of height and width, each in units of the bound of its window's good points."""
    rows = []
    for seed in range(windows):
        points, stray = straight_ridge(1500, noise=noise, outliers=outliers, seed=seed, half=(6, 8))
        random = np.random.default_rng(seed)
        size = 1 + 0.1 * random.normal(size=2)
        place = (0, 0.3 * random.normal(), 0.1 * random.normal())
        start = template_at(HEIGHT * size[0], WIDTH * size[1], place, 0.05 * random.normal(size=3))
        template = fitted(window_on(points), start)
        truth = template_at(HEIGHT, WIDTH)
        seen = window_on(points[~stray])(truth)
        free = jacobian(seen, HEIGHT, WIDTH, NO_TREND, bell())[:, 1:]
        bound = noise * np.sqrt(np.diag(np.linalg.inv(free.T @ free)))[5:]
        rows.append(np.array([template.height - HEIGHT, template.width - WIDTH]) / bound)
    return np.array(rows)


@pytest.mark.parametrize(("outliers", "most"), [(0.0, 1.15), (0.1, 1.3)], ids=["clean", "a tenth outliers"])
def test_height_and_width_reach_the_cramer_rao_bound(outliers, most):
    rms = np.sqrt((errors_in_bounds(outliers) ** 2).mean(axis=0))
    assert (rms <= most).all(), rms
    assert (rms >= 0.8).all(), rms  # less would say that the bound is wrong
