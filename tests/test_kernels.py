"""The kernels of one template against plain numpy: residual, loss, gradient, deviations, evidence, search."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import LOSSES, NO_TREND, jacobian, loss, moved_residual, psi, residual, straight_ridge
from scipy.optimize import minimize

from ridgefeature.kernels import appraise, evidence, objective
from ridgefeature.kernels import residual as kernel
from ridgefeature.kernels.search import best_straight_ridge, principal_axes
from ridgefeature.section import bell, plateau

BEND = np.array([0.03, 0.05, -0.04])
SECTIONS = [bell(), plateau()]
TUNING = {"huber": 1.345, "tukey": 5.0, "cauchy": 2.4, "square": 1.0}


def noisy(n: int = 300, seed: int = 3, noise: float = 0.1) -> np.ndarray:
    return straight_ridge(n, noise=noise, seed=seed, outliers=0.05, half=(4, 6))[0]


# Residual and loss


@pytest.mark.parametrize("section", SECTIONS, ids=lambda s: s.name)
@pytest.mark.parametrize("trend", [NO_TREND, BEND], ids=["straight", "bent"])
def test_residuals_are_the_first_order_distance_to_the_section(section, trend):
    points = noisy()
    found = appraise.residuals(points, 3.2, 7.5, trend, section.table)
    np.testing.assert_allclose(found, residual(points, 3.2, 7.5, trend, section), atol=1e-13)


def test_a_bent_template_fits_a_circular_path_to_second_order():
    """Points on a ring of radius 30, seen from a frame on its path, have almost no residual."""
    radius, h, w = 30.0, 3.0, 8.0
    angle, y = np.meshgrid(np.linspace(-0.1, 0.1, 21), np.linspace(-6, 6, 41))
    points = np.column_stack(
        [
            ((radius - y) * np.sin(angle)).ravel(),
            (radius - (radius - y) * np.cos(angle)).ravel(),
            (h * bell()(y / w)).ravel(),
        ]
    )
    bent = appraise.residuals(points, h, w, np.array([1 / radius, 0, 0]), bell().table)
    straight = appraise.residuals(points, h, w, NO_TREND, bell().table)
    assert np.abs(bent).max() < 1e-3 * h < np.abs(straight).max()


@pytest.mark.parametrize("name", LOSSES)
def test_loss_and_weight_follow_their_formulas(name):
    x = np.linspace(-9, 9, 181)
    number, tuning = LOSSES[name], TUNING[name]
    np.testing.assert_allclose(appraise.losses(x, number, tuning), loss(x, name, tuning), atol=1e-13)
    jets = np.array([kernel.loss_jet(v, number, tuning) for v in x])
    np.testing.assert_allclose(jets[:, 1], psi(x, name, tuning), atol=1e-13)
    weights = np.array([kernel.weight_of(v, number, tuning) for v in x])
    np.testing.assert_allclose(weights * x, psi(x, name, tuning), atol=1e-13)


def test_the_robust_scale_is_the_scaled_median_and_never_below_its_floor():
    points = noisy()
    r = residual(points, 3.0, 8.0, NO_TREND, bell())
    prior, huber = np.ones((2, 8)), (LOSSES["huber"], 1.345)
    found = appraise.prepare(points, 3.0, 8.0, NO_TREND, bell().table, 1e-9, prior, *huber)[0]
    assert found == pytest.approx(1.4826 * np.median(np.abs(r)), rel=1e-12)
    assert appraise.prepare(points, 3.0, 8.0, NO_TREND, bell().table, 0.7, prior, *huber)[0] == 0.7
    assert evidence.assess(points, 3.0, 8.0, NO_TREND, bell().table, 1e-9, 0.5, *huber)[0] == found
    assert evidence.assess(points, 3.0, 8.0, NO_TREND, bell().table, 0.7, 0.5, *huber)[0] == 0.7


def test_mean_loss_counts_the_share_beyond_three_scales():
    points = noisy()
    r = residual(points, 3.0, 8.0, BEND, bell()) / 0.1
    mean, far = appraise.mean_loss(points, 3.0, 8.0, BEND, bell().table, 0.1, LOSSES["huber"], 1.345)
    assert mean == pytest.approx(loss(r, "huber", 1.345).mean(), rel=1e-12)
    assert far == np.mean(np.abs(r) > 3)


# Objective


def problem(seed: int, name: str, with_prior: bool, with_trend: bool):
    random = np.random.default_rng(seed)
    transform = np.zeros((8, 7))
    transform[1:] = np.eye(7) + 0.2 * random.normal(size=(7, 7))
    start = np.array([0, 0, 0, 0, 0, 0, 3.0, 8.0])
    prior = np.zeros((2, 8))
    if with_prior:
        prior = np.array([[0, 0.1, 0, 0, 0.05, 0, 2.5, 7.0], random.uniform(0.1, 40.0, 8)])
    trend = BEND if with_trend else NO_TREND
    section = SECTIONS[seed % 2]
    return (noisy(seed=seed), start, prior, trend, transform, section.table, 0.15, LOSSES[name], TUNING[name])


def value_and_gradient(q: np.ndarray, packed: np.ndarray) -> tuple[float, np.ndarray]:
    gradient = np.empty(7)
    return objective.objective(q, gradient, packed), gradient


@pytest.mark.parametrize("name", LOSSES)
@given(
    st.integers(0, 10**6),
    st.booleans(),
    st.booleans(),
    st.lists(st.floats(-0.1, 0.1), min_size=7, max_size=7),
)
@settings(max_examples=25, deadline=None, derandomize=True)
def test_the_gradient_of_the_objective_is_that_of_central_differences(name, seed, prior, trend, q):
    packed, q = objective.pack(*problem(seed, name, prior, trend)), np.array(q)
    _, gradient = value_and_gradient(q, packed)
    for step in (1e-5, 1e-6):  # a point on a kink of a second derivative spoils one step, not both
        ends = np.array(
            [[objective.objective(q + s * e, np.empty(0), packed) for s in (step, -step)] for e in np.eye(7)]
        )
        differences = (ends[:, 0] - ends[:, 1]) / (2 * step)
        if np.allclose(gradient, differences, rtol=1e-6, atol=1e-6 * (1 + np.abs(gradient).max())):
            return
    np.testing.assert_allclose(gradient, differences, rtol=1e-6, atol=1e-6 * (1 + np.abs(gradient).max()))


@pytest.mark.parametrize("name", LOSSES)
def test_the_objective_is_the_mean_loss_of_the_moved_residuals_plus_the_prior(name):
    arguments = problem(8, name, True, True)
    points, start, prior, trend, transform, _, scale, _, tuning = arguments
    q = np.array([0.1, -0.2, 0.15, 0.1, -0.3, 0.2, -0.4])
    p = start + transform @ q
    r = moved_residual(points, p, trend, SECTIONS[0]) / scale
    expected = loss(r, name, tuning).mean() + 0.5 * (prior[1] * (p - prior[0]) ** 2).sum() / len(points)
    found = value_and_gradient(q, objective.pack(*arguments))[0]
    assert found == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize("name", LOSSES)
def test_the_c_function_says_what_the_objective_says_with_and_without_a_gradient(name):
    packed, q = objective.pack(*problem(4, name, True, True)), np.full(7, 0.05)
    expected, gradient = value_and_gradient(q, packed)
    written, call = np.zeros(7), objective.callback().ctypes
    assert call(7, q.ctypes.data, written.ctypes.data, packed.ctypes.data) == pytest.approx(
        expected, rel=1e-13
    )
    np.testing.assert_allclose(written, gradient, rtol=1e-12, atol=1e-14)
    assert call(7, q.ctypes.data, 0, packed.ctypes.data) == pytest.approx(expected, rel=1e-13)


def test_prepare_whitens_the_objective_where_it_stands():
    """Seen through the transform the mean Huber loss has unit curvature along every placement, h and w."""
    points, _ = straight_ridge(300, noise=0.1, seed=5, half=(4, 6))
    prior = np.zeros((2, 8))
    huber = LOSSES["huber"], 1.345
    _, _, packed = appraise.prepare(points, 3.0, 8.0, NO_TREND, bell().table, 0.1, prior, *huber)
    step = 1e-2
    rows = [
        (value_and_gradient(step * e, packed)[1] - value_and_gradient(-step * e, packed)[1]) / (2 * step)
        for e in np.eye(7)
    ]
    curvature = np.array(rows)
    assert np.linalg.eigvalsh(0.5 * (curvature + curvature.T))[0] > 0.6
    assert np.linalg.eigvalsh(0.5 * (curvature + curvature.T))[-1] < 1.7


# Deviations, evidence


@pytest.mark.parametrize("name", LOSSES)
@pytest.mark.parametrize("trend", [NO_TREND, BEND], ids=["straight", "bent"])
def test_deviations_are_those_of_an_m_estimator(name, trend):
    points, scale, tuning = noisy(600), 0.12, TUNING[name] + 2
    std, inliers = appraise.deviations(points, 3.0, 8.0, trend, bell().table, scale, LOSSES[name], tuning)
    r = residual(points, 3.0, 8.0, trend, bell()) / scale
    inside = np.abs(r) < tuning
    slope = (psi(r + 1e-6, name, tuning) - psi(r - 1e-6, name, tuning))[inside] / 2e-6
    n, free = inside.sum(), jacobian(points[inside], 3.0, 8.0, trend, bell())[:, 1:]
    factor = scale**2 * (psi(r, name, tuning)[inside] ** 2).sum() / (n - 7) / slope.mean() ** 2
    expected = np.sqrt(factor * np.diag(np.linalg.inv(free.T @ free)))
    assert inliers == n
    assert std[0] == 0
    np.testing.assert_allclose(std[1:], expected, rtol=1e-4)


@pytest.mark.parametrize("points", [noisy(8), np.array([[0.0, 9.0, 0.0]] * 40)], ids=["few", "on the flank"])
def test_deviations_are_infinite_where_the_points_do_not_tell(points):
    std, _ = appraise.deviations(points, 3.0, 8.0, NO_TREND, bell().table, 0.1, LOSSES["tukey"], 5.0)
    assert std[0] == 0 and np.isinf(std[6:]).all()


def test_the_plane_of_least_squares_is_found_exactly():
    points = noisy()
    best, plane = evidence.plane_loss(points, 0.1, LOSSES["square"], 1.0, 3)
    design = np.column_stack([np.ones(len(points)), points[:, :2]])
    expected, *_ = np.linalg.lstsq(design, points[:, 2], rcond=None)
    np.testing.assert_allclose(plane, expected, atol=1e-10)
    assert best == pytest.approx(0.5 * ((points[:, 2] - design @ expected) ** 2).sum() / 0.01, rel=1e-10)


def robust_plane(points: np.ndarray, scale: float, name: str, tuning: float) -> float:
    design = np.column_stack([np.ones(len(points)), points[:, :2]])
    start, *_ = np.linalg.lstsq(design, points[:, 2], rcond=None)

    def total(c):
        return loss((points[:, 2] - design @ c) / scale, name, tuning).sum()

    return minimize(
        total, start, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-9, "maxiter": 4000}
    ).fun


def test_the_robust_plane_loss_is_the_smallest_there_is():
    points = noisy(200)
    best, plane = evidence.plane_loss(points, 0.5, LOSSES["huber"], 1.345, 80)
    assert best == pytest.approx(robust_plane(points, 0.5, "huber", 1.345), rel=1e-7)
    flat = points[:, 2] - plane[0] - points[:, :2] @ plane[1:]
    assert best == pytest.approx(loss(flat / 0.5, "huber", 1.345).sum(), rel=1e-12)


@pytest.mark.parametrize(("height", "sign"), [(3.0, 1), (0.0, -1)], ids=["ridge", "flat"])
def test_evidence_is_twice_what_a_plane_loses_against_the_template(height, sign):
    points, _ = straight_ridge(300, height=height, noise=0.1, seed=4, half=(4, 6))
    huber = LOSSES["huber"], 1.345
    _, far, found = evidence.assess(points, 3.0, 8.0, NO_TREND, bell().table, 1e-9, 0.5, *huber)
    r = residual(points, 3.0, 8.0, NO_TREND, bell())
    assert far == pytest.approx(np.mean(np.abs(r) > 3 * 1.4826 * np.median(np.abs(r))))
    ridge = loss(residual(points, 3.0, 8.0, NO_TREND, bell()) / 0.5, "huber", 1.345).sum()
    expected = 2 * (robust_plane(points, 0.5, "huber", 1.345) - ridge)
    assert found == pytest.approx(expected, rel=2e-3)  # it stops reweighting after five rounds
    assert found * sign > 100


def test_explained_grows_with_what_the_ridge_explains():
    points, _ = straight_ridge(300, noise=0.1, seed=4, half=(4, 6))
    good = evidence.explained(points, 3.0, 8.0, NO_TREND, bell().table)
    poor = evidence.explained(points, 2.0, 5.0, NO_TREND, bell().table)
    wrong = evidence.explained(points, -3.0, 8.0, NO_TREND, bell().table)
    assert good > 1 > poor > 0 > wrong


def test_sampled_points_lie_on_the_template():
    points = kernel.sampled(3.0, 8.0, BEND, bell().table, 6.0, 7.0, 5, 9)
    assert points.shape == (45, 3)
    np.testing.assert_allclose(np.unique(points[:, 0]), [-2.4, -1.2, 0.0, 1.2, 2.4], atol=1e-15)
    y = points[:, 1] - 0.5 * BEND[0] * points[:, 0] ** 2
    assert np.abs(y).max() == pytest.approx(7.0 * 8 / 9)
    height, width = 3.0 + BEND[1] * points[:, 0], 8.0 + BEND[2] * points[:, 0]
    np.testing.assert_allclose(points[:, 2], height * bell()(y / width), atol=1e-12)


# Search of GUESS


def by_least_squares(points: np.ndarray, width: float, angles, offsets, section):
    """Every direction and offset by numpy's least squares; (explained, angle, offset, height)."""
    z = points[:, 2]
    flat = np.column_stack([np.ones(len(z)), points[:, :2]])
    plane = z - flat @ np.linalg.lstsq(flat, z, rcond=None)[0]
    rows = []
    for angle in angles:
        across = points[:, 1] * np.cos(angle) - points[:, 0] * np.sin(angle)
        for offset in offsets:
            g = section(across / width - offset)
            c = np.linalg.lstsq(np.column_stack([flat, g]), z, rcond=None)[0]
            rest = z - flat @ c[:3] - c[3] * g
            rows.append((1 - rest @ rest / (plane @ plane), angle, offset, c[3], *c[:3]))
    return max(rows)


@pytest.mark.parametrize("section", SECTIONS, ids=lambda s: s.name)
@pytest.mark.parametrize("height", [2.0, -2.0])
def test_the_best_straight_ridge_is_that_of_brute_force(section, height):
    random = np.random.default_rng(2)
    points = random.uniform(-6, 6, (300, 3))
    across = points[:, 1] * np.cos(0.8) - points[:, 0] * np.sin(0.8)
    points[:, 2] = 0.5 + 0.1 * points[:, 0] + height * section(across / 6 - 0.2) + random.normal(0, 0.2, 300)
    angles, offsets = np.arange(12) * np.pi / 12, np.array([-0.4, -0.2, 0.0, 0.2, 0.4])
    found = best_straight_ridge(points, 6.0, angles, offsets, section.table)
    np.testing.assert_allclose(found, by_least_squares(points, 6.0, angles, offsets, section), rtol=1e-8)


@pytest.mark.parametrize(
    "points", [np.zeros((40, 3)), np.eye(3), np.c_[np.random.default_rng(0).random((40, 2)), np.zeros(40)]]
)
def test_points_that_leave_nothing_to_explain_give_no_ridge(points):
    found = best_straight_ridge(points, 6.0, np.arange(3.0), np.zeros(1), bell().table)
    assert found[0] <= 1.0 and np.isfinite(found).all()


@given(st.integers(0, 10**6), st.sampled_from([1e-6, 1.0, 1e6]))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_principal_axes_are_the_eigenvectors_of_the_scatter(seed, size):
    random = np.random.default_rng(seed)
    points = size * random.normal(size=(30, 3)) @ random.normal(size=(3, 3)) + 1e3 * size
    axes = principal_axes(points)
    centred = points - points.mean(axis=0)
    scatter = axes.T @ (centred.T @ centred) @ axes
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert abs(scatter - np.diag(np.diag(scatter))).max() <= 1e-9 * scatter.max()
    assert scatter[0, 0] >= scatter[1, 1] >= scatter[2, 2]


def test_principal_axes_of_a_plane_end_with_its_normal():
    x, y = np.meshgrid(np.arange(5.0), np.arange(3.0))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    np.testing.assert_allclose(np.abs(principal_axes(points)), np.eye(3), atol=1e-15)
