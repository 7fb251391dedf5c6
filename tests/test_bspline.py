"""B-splines against scipy's, and the properties that the exports rely on."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from surfaces import bell, inner

from ridgefeature.bspline import Curve, Surface, basis_matrix, clamped_knots, greville, interpolate

DEGREES = st.integers(1, 5)
SEEDS = st.integers(0, 2**32 - 1)


def random_knots(rng: np.random.Generator, degree: int) -> np.ndarray:
    return clamped_knots(np.cumsum(rng.uniform(0.1, 2.0, rng.integers(2, 9))), degree)


@given(DEGREES, SEEDS, st.integers(0, 3))
def test_basis_is_scipys(degree: int, seed: int, derivative: int) -> None:
    rng = np.random.default_rng(seed)
    knots = random_knots(rng, degree)
    at = np.append(rng.uniform(knots[0], knots[-1], 20), [knots[0], knots[-1], knots[degree + 1]])
    n = knots.size - degree - 1
    oracle = BSpline(knots, np.eye(n), degree)
    expected = oracle(at) if derivative == 0 else oracle.derivative(min(derivative, degree))(at)
    if derivative > degree:
        expected = np.zeros_like(expected)
    if (
        derivative == degree
    ):  # piecewise constant: at a knot scipy takes the right, at the end the left side too
        at, expected = at[:20], expected[:20]
    scale = max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(basis_matrix(knots, degree, at, derivative), expected, atol=1e-10 * scale)


@given(DEGREES, SEEDS)
def test_basis_is_a_partition_of_unity(degree: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    knots = random_knots(rng, degree)
    values = basis_matrix(knots, degree, rng.uniform(knots[0], knots[-1], 30))
    assert values.min() >= 0.0
    np.testing.assert_allclose(values.sum(axis=1), 1.0, atol=1e-13)


@given(st.integers(3, 5), SEEDS)
def test_interpolation_reproduces_cubics(degree: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    knots = random_knots(rng, degree)
    cubic = np.polynomial.Polynomial(rng.uniform(-1, 1, 4), domain=[knots[0], knots[-1]])
    poles = interpolate(knots, degree, cubic(greville(knots, degree)))
    at = rng.uniform(knots[0], knots[-1], 30)
    np.testing.assert_allclose(basis_matrix(knots, degree, at) @ poles, cubic(at), atol=1e-9)


def test_interpolation_takes_any_trailing_shape_and_is_linear() -> None:
    knots = clamped_knots([0, 1, 3, 4], 3)
    values = np.random.default_rng(0).normal(size=(6, 2, 3))
    poles = interpolate(knots, 3, values)
    assert poles.shape == (6, 2, 3)
    np.testing.assert_allclose(poles[:, 1, 2], interpolate(knots, 3, values[:, 1, 2]), atol=1e-14)
    np.testing.assert_allclose(
        np.einsum("mi,iab->mab", basis_matrix(knots, 3, greville(knots, 3)), poles), values, atol=1e-13
    )


@given(SEEDS)
def test_curve_is_scipys(seed: int) -> None:
    rng = np.random.default_rng(seed)
    knots = random_knots(rng, 3)
    curve = Curve(rng.normal(size=(knots.size - 4, 3)), knots, 3)
    t = rng.uniform(*curve.domain, (4, 5))
    for order in (0, 1, 2):
        expected = BSpline(knots, curve.poles, 3)(t, nu=order)
        np.testing.assert_allclose(curve(t, order), expected, atol=1e-11 * max(1.0, np.abs(expected).max()))


def test_arc_length_of_a_circle() -> None:
    knots = clamped_knots(np.linspace(0.0, 2.0, 400), 3)
    a = greville(knots, 3) ** 2  # not at constant speed
    curve = Curve(interpolate(knots, 3, 5.0 * np.stack([np.cos(a), np.sin(a)], axis=-1)), knots, 3)
    assert curve.arc_length() == pytest.approx(20.0, rel=1e-8)
    assert curve.arc_length(1.0, 0.0) == pytest.approx(-5.0, rel=1e-8)
    s = np.linspace(0.0, curve.arc_length(), 31).reshape(1, -1)
    t = curve.at_arc_length(s)
    assert t.shape == s.shape
    np.testing.assert_allclose(curve.arc_length(t1=t), s, atol=1e-12)
    np.testing.assert_allclose(t, np.sqrt(s / 5.0), atol=1e-5)  # the start has almost no speed


@given(SEEDS)
@settings(max_examples=30)
def test_arc_length_and_its_inverse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    knots = random_knots(rng, 3)
    n = knots.size - 4
    curve = Curve(np.column_stack([np.arange(n), *rng.normal(scale=0.5, size=(2, n))]), knots, 3)
    t = np.sort(rng.uniform(*curve.domain, 20))
    s = curve.arc_length(t1=t)
    assert np.all(np.diff(s) > 0)
    np.testing.assert_allclose(curve.at_arc_length(s), t, atol=1e-9)
    chords = np.linalg.norm(np.diff(curve(t), axis=0), axis=1)
    assert np.all(chords <= np.diff(s) + 1e-9)


def test_surface_is_scipys_tensor_product() -> None:
    surface, rng = bell(), np.random.default_rng(1)
    u, v = inner(rng, surface, 50)
    rows = BSpline(surface.knots_u, surface.poles, 3)
    for k, (a, b) in enumerate(((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))):
        expected = [BSpline(surface.knots_v, rows(x, nu=a), 3)(y, nu=b) for x, y in zip(u, v, strict=True)]
        got = surface(u, v) if k == 0 else surface.derivatives(u, v, order=2)[k - 1]
        np.testing.assert_allclose(got, expected, atol=1e-11)
        grid = surface.on_grid(u, v, (a, b))
        np.testing.assert_allclose(grid[np.arange(50), np.arange(50)], expected, atol=1e-11)


def test_derivatives_against_differences() -> None:
    surface, rng = bell(), np.random.default_rng(2)
    u, v = rng.uniform(0.1, 0.9, 40), rng.uniform(-5, 5, 40)
    step = 1e-6
    first = surface.derivatives(u, v)
    assert len(first) == 2
    np.testing.assert_allclose(
        first[0], (surface(u + step, v) - surface(u - step, v)) / (2 * step), atol=1e-6
    )
    np.testing.assert_allclose(
        first[1], (surface(u, v + step) - surface(u, v - step)) / (2 * step), atol=1e-6
    )


@given(SEEDS)
@settings(max_examples=25)
def test_surface_is_affinely_invariant(seed: int) -> None:
    rng, surface = np.random.default_rng(seed), bell()
    matrix, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
    moved = dataclasses.replace(surface, poles=surface.poles @ matrix.T + shift)
    u, v = inner(rng, surface, 10)
    np.testing.assert_allclose(moved(u, v), surface(u, v) @ matrix.T + shift, atol=1e-11)


def test_surface_broadcasts_and_grids() -> None:
    surface = bell()
    (u0, u1), (v0, v1) = surface.domain
    assert surface(0.5, 1.0).shape == (3,)
    points = surface(np.linspace(u0, u1, 7)[:, None], np.linspace(v0, v1, 5))
    np.testing.assert_allclose(surface.grid(7, 5), points, atol=1e-12)
    np.testing.assert_allclose(
        surface.grid(2, 2)[[0, 1], [0, 1]], surface.poles[[0, -1], [0, -1]], atol=1e-12
    )


def test_normal_is_unit_and_across_both_derivatives() -> None:
    surface, rng = bell(), np.random.default_rng(3)
    u, v = inner(rng, surface, 50)
    normal, (du, dv) = surface.normal(u, v), surface.derivatives(u, v)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(np.einsum("md,kmd->km", normal, np.array([du, dv])), 0.0, atol=1e-11)
    assert np.all(np.einsum("md,md->m", normal, np.cross(du, dv)) > 0)


def test_normal_of_a_collapsed_border_is_nan() -> None:
    poles = bell().poles.copy()
    poles[0] = poles[0, 0]
    surface = dataclasses.replace(bell(), poles=poles)
    assert np.isnan(surface.normal(0.0, 0.0)).all()


def test_flux_over_a_closed_box_of_faces_is_the_volume() -> None:
    line = np.array([0.0, 0.0, 1.0, 1.0])

    def patch(a: list[float], b: list[float], c: list[float], d: list[float]) -> float:
        return Surface(np.array([[a, c], [b, d]]), line, line, 1, 1).flux()

    p = [[x, y, z] for x in (1.0, 3.0) for y in (2.0, 5.0) for z in (-1.0, 4.0)]
    outwards = [(0, 1, 2, 3), (4, 6, 5, 7), (0, 4, 1, 5), (2, 3, 6, 7), (0, 2, 4, 6), (1, 5, 3, 7)]
    assert sum(patch(*(p[i] for i in face)) for face in outwards) == pytest.approx(30.0, rel=1e-13)


def test_nan_in_nan_out() -> None:
    surface, curve = bell(), Curve([[0.0], [1.0]], [0, 0, 1, 1], 1)
    got = surface([0.5, np.nan], [1.0, 1.0])
    assert np.isfinite(got[0]).all() and np.isnan(got[1]).all()
    assert np.isnan(curve([np.nan])).all() and np.isnan(curve.at_arc_length(np.nan))
    assert np.isnan(basis_matrix([0, 0, 1, 1], 1, [np.nan])).any()


@pytest.mark.parametrize("u", [-0.01, 1.01, np.inf])
def test_outside_the_domain_is_an_error(u: float) -> None:
    with pytest.raises(ValueError, match="parameters from 0 to 1"):
        bell()(u, 0.0)
    with pytest.raises(ValueError, match="arc lengths"):
        Curve([[0.0], [1.0]], [0, 0, 1, 1], 1).at_arc_length(2.0 * np.sign(u))


def test_arrays_are_copies_and_read_only() -> None:
    poles = np.array([[0, 0], [1, 1]])
    curve = Curve(poles, [0, 0, 1, 1], 1)
    poles[0] = 9
    assert curve.poles.dtype == np.float64 and curve(0.0)[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        curve.poles[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        bell().knots_u[0] = 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"poles": np.zeros((22, 13))}, r"\(nu, nv, 3\)"),
        ({"poles": np.zeros((22, 13, 2))}, r"\(nu, nv, 3\)"),
        ({"poles": np.full((22, 13, 3), np.nan)}, "finite poles"),
        ({"knots_u": np.arange(25.0)}, "expected 26 knots for 22 poles of degree 3, got 25"),
        ({"knots_u": np.arange(26.0)[::-1]}, "ascending"),
        ({"knots_u": np.zeros(26)}, "no knot more than 4 times"),
        ({"knots_u": np.append(np.arange(25.0), np.nan)}, "finite knots"),
        ({"degree_v": 0}, "degree of 1 or more"),
        ({"degree_v": 2}, "expected 16 knots"),
    ],
)
def test_a_bad_surface_is_an_error(change: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(bell(), **change)


def test_bad_arguments_are_errors() -> None:
    with pytest.raises(ValueError, match="strictly ascending"):
        clamped_knots([0, 1, 1], 3)
    with pytest.raises(ValueError, match="expected 6 values"):
        interpolate(clamped_knots([0, 1, 3, 4], 3), 3, np.zeros(5))
    with pytest.raises(ValueError, match="order 1 or 2"):
        bell().derivatives(0.5, 0.5, order=3)
    with pytest.raises(ValueError, match="derivative order"):
        basis_matrix([0, 0, 1, 1], 1, [0.5], derivative=-1)
    with pytest.raises(ValueError, match="at least 2 x 2"):
        bell().grid(1, 5)
