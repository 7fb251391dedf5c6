"""Small algebra and rotations of the kernels, against numpy and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from ridgefeature.kernels import algebra

VECTORS = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3).map(np.array)


def positive(n: int, seed: int, spread: float = 1.0) -> np.ndarray:
    random = np.random.default_rng(seed)
    half = random.normal(size=(n + 4, n)) * 10 ** random.uniform(-spread, spread, n)
    return half.T @ half


@pytest.mark.parametrize("n", [1, 3, 7, 8])
def test_cholesky_is_that_of_numpy(n):
    matrix = positive(n, n)
    lower = matrix.copy()
    assert algebra.cholesky_in_place(lower)
    np.testing.assert_allclose(np.tril(lower), np.linalg.cholesky(matrix), rtol=1e-10)


@pytest.mark.parametrize("n", [1, 3, 7, 8])
def test_solve_is_that_of_numpy(n):
    matrix, right = positive(n, n), np.random.default_rng(n).normal(size=n)
    found = right.copy()
    assert algebra.solve_in_place(np.tril(matrix), found)  # the lower triangle is all it reads
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-8)


@pytest.mark.parametrize(
    "matrix",
    [np.zeros((3, 3)), -np.eye(3), np.ones((3, 3)), np.full((3, 3), np.nan)],
    ids=["0", "-1", "rank 1", "nan"],
)
def test_a_matrix_that_is_not_positive_definite_is_refused(matrix):
    assert not algebra.cholesky_in_place(matrix.copy())
    assert not algebra.solve_in_place(matrix.copy(), np.ones(3))


@given(st.integers(0, 10**6), st.floats(0.0, 1.5))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_whitening_makes_the_hessian_unity_block_by_block(seed, spread):
    normal = positive(8, seed, spread)
    transform = algebra.whitening(normal)
    seen = transform.T @ normal @ transform
    np.testing.assert_allclose(seen[:5, :5], np.eye(5), atol=1e-4)
    np.testing.assert_allclose(seen[:5, 5:], 0, atol=1e-4)
    np.testing.assert_allclose(np.diag(seen), 1, atol=1e-4)
    assert abs(seen[5, 6]) < 1  # height and width stay correlated as they are


@pytest.mark.parametrize("normal", [positive(8, 1), np.zeros((8, 8)), np.diag([0.0, 1, 1, 1, 0, 1, 0, 1])])
def test_height_and_width_change_along_one_axis_each_and_sliding_never(normal):
    transform = algebra.whitening(normal)
    assert np.isfinite(transform).all()
    assert not transform[0].any()
    assert list(np.flatnonzero(transform[6])) == [5]
    assert list(np.flatnonzero(transform[7])) == [6]


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 0.99e-4, 1.01e-4, 1e-3, 0.5, 3.0, np.pi - 1e-9, np.pi])
@pytest.mark.parametrize("axis", [[1, 0, 0], [0, 0, -1], [0.36, 0.48, 0.8]])
def test_rotation_is_that_of_scipy_from_tiny_to_half_a_turn(angle, axis):
    vector = angle * np.array(axis, dtype=float)
    rotation, _ = algebra.rotation_of(vector)
    np.testing.assert_allclose(rotation, Rotation.from_rotvec(vector).as_matrix(), atol=1e-14)


@given(VECTORS, VECTORS)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_the_right_jacobian_turns_a_small_change_into_a_rotation_of_the_body(vector, change):
    rotation, jacobian = algebra.rotation_of(vector)
    step = 1e-6
    ahead, _ = algebra.rotation_of(vector + step * change)
    back, _ = algebra.rotation_of(vector - step * change)
    body = rotation.T @ (ahead - back) / (2 * step)
    np.testing.assert_allclose([body[2, 1], body[0, 2], body[1, 0]], jacobian @ change, atol=1e-8)


def move(place: np.ndarray, frame: np.ndarray, p: np.ndarray):
    """`moved` by p, height and width half as what they were and half as the increment."""
    increments = np.concatenate([p[:6], 0.5 * p[6:]])
    transform = increments[:, None] * np.eye(8, 7)[:1].repeat(8, 0)
    return algebra.moved(place, frame, 0.5 * p[6], 0.5 * p[7], transform, np.eye(7)[0])


@given(VECTORS, VECTORS)
@settings(max_examples=40, deadline=None, derandomize=True)
def test_moved_applies_increments_in_the_own_frame(shift, turn):
    frame = Rotation.from_rotvec([0.4, -1.0, 0.7]).as_matrix()
    place, turned, height, width = move(np.array([1.0, 2.0, 3.0]), frame, np.array([*shift, *turn, 1.5, 2.5]))
    assert (height, width) == (1.5, 2.5)
    np.testing.assert_allclose(place, [1, 2, 3] + frame @ shift, atol=1e-12)
    np.testing.assert_allclose(turned, frame @ Rotation.from_rotvec(turn).as_matrix(), atol=1e-12)


def test_a_thousand_moves_keep_the_frame_orthonormal():
    place, frame = np.zeros(3), np.eye(3)
    random = np.random.default_rng(1)
    for _ in range(1000):
        place, frame, _, _ = move(place, frame, random.normal(size=8))
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-14)
    assert np.linalg.det(frame) == pytest.approx(1)


def test_turned_facing_and_cross_are_rodrigues_projection_and_product():
    normal, direction = np.array([0.36, 0.48, 0.8]), np.array([1.0, -2.0, 0.5])
    turned = algebra.turned(direction, normal, 0.7)
    np.testing.assert_allclose(turned, expm(np.cross(np.eye(3), 0.7 * normal)) @ direction, atol=1e-14)
    frame = algebra.facing(normal, direction)
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(frame[:, 2], normal)
    assert frame[:, 0] @ direction > 0 and abs(frame[:, 1] @ direction) < 1e-12
    np.testing.assert_array_equal(algebra.cross(normal, direction), np.cross(normal, direction))


def test_walk_goes_straight_on_from_the_joint_without_bend():
    joint, up = np.array([3.0, 0, 0]), np.array([0.0, 0, 1])
    place, frame = algebra.walk(joint, up, np.array([2.0, 0, 0]), 0.0, 3.0, 4.0)
    np.testing.assert_allclose(place, [7, 0, 0], atol=1e-15)
    np.testing.assert_allclose(frame, np.eye(3), atol=1e-15)


def test_walk_turns_with_the_path_and_begins_at_the_joint():
    radius, first, second = 30.0, 3.0, 4.0
    joint, up, ahead = np.array([3.0, 1, 0]), np.array([0.0, 0, 1]), np.array([1.0, 0, 0])
    place, frame = algebra.walk(joint, up, ahead, 1 / radius, first, second)
    turn = (first + second) / radius
    np.testing.assert_allclose(frame[:, 0], [np.cos(turn), np.sin(turn), 0], atol=1e-12)
    np.testing.assert_allclose(place - second * frame[:, 0], joint, atol=1e-14)


def test_walk_turns_by_a_radian_at_most():
    frame = algebra.walk(np.zeros(3), np.array([0.0, 0, 1]), np.array([1.0, 0, 0]), 1.0, 30.0, 30.0)[1]
    assert np.arctan2(frame[1, 0], frame[0, 0]) == pytest.approx(1.0)


# Windows
