"""Kernels of the joint refit against dense and brute-force oracles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ridgefeature.kernels.banded import factor, inverse_band, solve
from ridgefeature.kernels.information import information
from ridgefeature.kernels.penalised import assembled, most_likely
from ridgefeature.kernels.section_sums import misfit_sums
from ridgefeature.kernels.strip import TERMS, A, H, W, mixture, offsets, rectified, share_of_surface
from ridgefeature.section import bell
from ridgefeature.smearing import smear
from ridgefeature.smoothing import ORDERS, basis_at


def banded(n: int, m: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A positive definite matrix that vanishes m places off its diagonal, and its lower band."""
    rng = np.random.default_rng(seed)
    lower = np.tril(np.triu(rng.normal(size=(n, n)), -m // 2))
    dense = lower @ lower.T + 0.5 * np.eye(n)
    band = np.zeros((n, m + 1))
    for k in range(min(m, n - 1) + 1):
        band[k:, k] = np.diagonal(dense, -k)
    return dense, band


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 30), st.integers(0, 8), st.integers(0, 99))
def test_a_band_is_factored_solved_and_inverted_as_a_dense_matrix(n, m, seed):
    dense, band = banded(n, m, seed)
    right = np.random.default_rng(seed + 1).normal(size=n)
    factored, good = factor(band)
    assert good
    assert np.allclose(solve(factored, right), np.linalg.solve(dense, right), rtol=1e-9, atol=1e-12)
    inverse, found = np.linalg.inv(dense), inverse_band(factored)
    for k in range(min(m, n - 1) + 1):
        assert np.allclose(found[k:, k], np.diagonal(inverse, -k), rtol=1e-9, atol=1e-12)


def test_a_matrix_that_is_not_positive_definite_is_told():
    assert not factor(np.array([[1.0, 0.0], [1.0, 2.0]]))[1]


def test_smoothing_finds_straight_lines_exactly_and_what_is_wanted():
    n, m = 12, 60
    places = np.linspace(0, n - 3, m)
    first, basis = basis_at(n, places)
    goal = np.tile(np.eye(TERMS), (m, 1, 1))
    line = places[:, None] * np.arange(1, TERMS + 1)
    band, right = assembled(goal, line, first, basis, n)
    wanted = np.zeros((TERMS, n))
    found, _, weights, _ = most_likely(band, right, np.array(ORDERS), wanted, np.ones(TERMS), 30)
    values = (basis[:, :, None] * found[first[:, None] + np.arange(4)]).sum(axis=1)
    order_1 = ORDERS.index(1)
    others = [k for k in range(TERMS) if k != order_1]
    assert np.allclose(values[:, others], line[:, others], atol=1e-5)
    straight = found[:, H] - np.polyval(np.polyfit(np.arange(n), found[:, H], 1), np.arange(n))
    assert np.abs(straight).max() < 1e-5, "a straight line needs no roughness"
    assert 1.0 < weights[H] < 1e3, "but may have some: nothing in the data speaks against it"


def test_the_smoothness_is_that_of_the_data():
    n, m, rng = 40, 800, np.random.default_rng(1)
    places = np.linspace(0, n - 3, m)
    first, basis = basis_at(n, places)
    curve = np.sin(places / 4)
    matrix = np.tile(100.0 * np.eye(TERMS), (m, 1, 1))
    goal = 100.0 * (curve[:, None] + rng.normal(0, 0.1, (m, TERMS)))
    found, inverse, _, freedom = most_likely(
        *assembled(matrix, goal, first, basis, n),
        np.array(ORDERS),
        np.zeros((TERMS, n)),
        np.ones(TERMS),
        50,
    )
    values = (basis * found[first[:, None] + np.arange(4), H]).sum(axis=1)
    assert np.sqrt(np.mean((values - curve) ** 2)) < 0.1 * np.sqrt(n / m)
    assert (inverse[:, 0] > 0).all()
    assert 5 * TERMS < freedom < 0.6 * TERMS * n, "one and a half waves are told, not every coefficient"


def test_bands_hold_what_another_smoothness_would_change():
    """Against finite differences: the fit with a weight of the heights' penalty a little larger."""
    n, m, rng = 20, 200, np.random.default_rng(4)
    places = np.linspace(0, n - 3, m)
    first, basis = basis_at(n, places)
    matrix = np.tile(100.0 * np.eye(TERMS), (m, 1, 1))
    goal = 100.0 * (np.sin(places / 3)[:, None] + rng.normal(0, 0.3, (m, TERMS)))
    band, right = assembled(matrix, goal, first, basis, n)
    orders, wanted = np.array(ORDERS), np.zeros((TERMS, n))
    found, inverse, _, _ = most_likely(band, right, orders, wanted, np.ones(TERMS), 1)
    step = np.ones(TERMS)
    step[H] = 1.0 + 1e-6
    change = (most_likely(band, right, orders, wanted, step, 1)[0] - found)[:, H] / 1e-6
    dense = np.zeros((n, n))
    for k in range(4):
        i = np.arange(k, n)
        np.add.at(dense, (i, i - k), band[TERMS * i + H, TERMS * k])
    dense += np.tril(dense, -1).T
    penalty = np.diff(np.eye(n), ORDERS[H], axis=0)
    held = np.linalg.inv(dense + penalty.T @ penalty)
    more = inverse[H::TERMS, 0] - np.diagonal(held)
    ratio = more @ change**2 / (change**2 @ change**2)
    assert ratio > 0
    assert np.allclose(more, ratio * change**2, rtol=1e-3, atol=1e-3 * more.max())
    free = n - ORDERS[H] - np.trace(penalty @ held @ penalty.T)
    assert ratio == pytest.approx(2.0 / free, rel=1e-3)


def straight(n: int = 21) -> tuple[np.ndarray, ...]:
    x = np.arange(float(n))
    axes = [np.tile(a, (n, 1)) for a in np.eye(3)]
    return np.column_stack([x, 0 * x, 0 * x]), *axes


def test_coordinates_along_a_straight_path_are_the_points_own():
    rng, (origin, tangent, left, normal) = np.random.default_rng(2), straight()
    points = rng.uniform([0.01, -2, -1], [19.99, 2, 1], (500, 3))
    n = len(origin)
    found = rectified(points, origin, tangent, left, normal, np.zeros(n), np.full(n, 3.0), np.full(n, 2.0), 5)
    assert len(found) == 500
    assert np.allclose(found - [5, 0, 0], points, atol=1e-12)


def test_coordinates_over_a_cylinder_are_arc_and_radius():
    rng, (origin, tangent, left, normal) = np.random.default_rng(3), straight()
    angle, z, x = rng.uniform(-0.6, 0.6, 300), rng.uniform(-0.5, 0.5, 300), rng.uniform(0.1, 19.9, 300)
    radius = 4.0  # the base falls to both sides: its centre lies below
    points = np.column_stack([x, (radius + z) * np.sin(angle), (radius + z) * np.cos(angle) - radius])
    n = len(origin)
    bend = np.full(n, -1 / radius)
    found = rectified(points, origin, tangent, left, normal, bend, np.full(n, 3.0), np.full(n, 2.0), 0)
    assert np.allclose(found, np.column_stack([x, radius * angle, z]), atol=1e-9)


def test_points_too_far_off_are_left_out():
    origin, tangent, left, normal = straight()
    n = len(origin)
    points = np.array(
        [[5.5, 3.1, 0], [5.5, 0, 2.1], [-0.5, 0, 0], [20.5, 0, 0], [np.nan, 0, 0], [5.5, 0.0, 0.0]]
    )
    found = rectified(points, origin, tangent, left, normal, np.zeros(n), np.full(n, 3.0), np.full(n, 2.0), 0)
    assert found.tolist() == [[5.5, 0.0, 0.0]]


def scene(
    noise: float, strays: float, h: float = 0.3, n: int = 200_000, even: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Points in path coordinates about a ridge of width 1, and terms a little off.

    even: 0 for points that lie evenly over the base, 1 evenly over the surface.
    """
    rng = np.random.default_rng(4)
    s, at = rng.uniform(0, 100, n), np.linspace(-1.2, 1.2, 4801)
    crowd = np.cumsum(np.sqrt(1 + even * (h * bell()(at, 1)) ** 2))
    y = np.interp(rng.uniform(crowd[0], crowd[-1], n), crowd, at)
    z = h * bell()(y)
    y, z = y + rng.normal(0, noise, n), z + rng.normal(0, noise, n)
    k = int(strays * n)
    z[:k] = rng.uniform(-h, 2 * h, k)
    keep = (np.abs(y) < 0.8) & (np.abs(z) < 2 * h + 0.25)
    terms = np.zeros((101, TERMS))
    terms[:, H], terms[:, W] = 1.1 * h, 0.95
    return np.column_stack([s, y, z])[keep], terms


@pytest.mark.parametrize(
    ("strays", "h", "noise", "even"),
    [(0.0, 0.3, 0.024, 0.0), (0.2, 0.3, 0.024, 0.0), (0.0, 0.3, 0.07, 0.0), (0.0, 0.3, 0.07, 1.0)],
)
def test_height_and_width_have_no_bias_under_much_noise(strays, h, noise, even):
    points, terms = scene(noise, strays, h, even=even)
    scale, share = noise, 0.05
    for _ in range(12):
        seen = smear(bell(), terms, scale, even).told
        r = offsets(points, terms, seen, scale)
        scale, share, density = mixture(*r, scale, share, 4 * h + 0.5, 1e-3 * h, 20)
        matrix, right, _ = information(points, terms, seen, scale, density)
        terms = terms + np.linalg.solve(matrix.sum(axis=0), right.sum(axis=0))
    assert terms[0, H] == pytest.approx(h, rel=3e-3 + 0.2 * noise)
    assert terms[0, W] == pytest.approx(1.0, rel=3e-3 + 0.01 * strays + 0.1 * noise)
    assert scale == pytest.approx(noise, rel=0.06)
    # Strays that lie among the others are not told from them.
    assert share == pytest.approx(strays, abs=0.05)


def test_the_share_of_the_surface_is_that_of_normal_noise_against_even_strays():
    r, stray = np.linspace(-12.0, 12.0, 4001), 0.03
    shares = np.array([share_of_surface(x, 0.5, stray) for x in r])
    expected = 1.0 / (1.0 + stray / 0.5 * np.exp(np.minimum(0.5 * r**2, 50.0)))
    np.testing.assert_allclose(shares, expected, rtol=1e-11)
    assert shares[0] == share_of_surface(1e200, 0.5, stray) > 0


def test_information_is_the_sum_over_the_points_whatever_their_order():
    points, terms = scene(0.01, 0.0, n=2000)
    seen = smear(bell(), terms, 0.01, 0.0).told
    whole = information(points, terms, seen, 0.01, 0.1)
    order = np.random.default_rng(5).permutation(len(points))
    for a, b in zip(whole, information(points[order], terms, seen, 0.01, 0.1), strict=True):
        assert np.allclose(a, b, rtol=1e-9, atol=1e-6)
    assert whole[2][0] == len(points)
    assert (np.diagonal(whole[0], axis1=1, axis2=2)[:, A] > 0).all()


def test_information_is_that_of_each_point_which_tells_one_thing():
    points, terms = scene(0.02, 0.1, n=60)
    seen = smear(bell(), terms, 0.02, 0.0).told
    whole, each = information(points, terms, seen, 0.02, 0.1), np.zeros((100, TERMS, TERMS))
    for point in points:
        matrix, right, sums = information(point[None], terms, seen, 0.02, 0.1)
        j = int(point[0])
        r = offsets(point[None], terms, seen, 0.02)[0][0] / 0.02
        if right[j].any():
            assert np.allclose(matrix[j], np.outer(right[j], right[j]) / (sums[1] * r * r), rtol=1e-8)
        each += matrix
    assert np.allclose(whole[0], each, rtol=1e-9)


def test_misfits_are_those_of_the_points_between_the_feet():
    points, terms = scene(0.02, 0.2, n=3000)
    section, scale, least, most = bell(), 0.02, 0.03, 9.0
    seen = smear(section, terms, scale, 0.0)
    found = misfit_sums(points, terms, seen.told, scale, least, most, section.top)
    eta = points[:, 1] / terms[0, W]
    square = np.minimum((offsets(points, terms, seen.told, scale)[0] / least) ** 2, most)
    top = (np.abs(eta) < section.top[1]) & (square < most)
    on = np.abs(eta) < 0.5
    told = [np.bincount(points[on, 0].astype(int), w, 100) for w in (on[on], square[on], top[on])]
    assert np.allclose(found, np.column_stack(told), rtol=1e-9)
    assert 0 < found[:, 2].sum() < found[:, 0].sum() < len(points)
