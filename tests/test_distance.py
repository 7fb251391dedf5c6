"""Eq. 1 to 3 against brute force, their properties, and the floor below which no fit comes."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ridgefeature.distance import directed_hausdorff, hausdorff, mean_directed_hausdorff, sampling_floor
from ridgefeature.grid import build_grid


def brute(A, B):
    """All distances, (len(A), len(B)), ascending in each row."""
    return np.sort(np.linalg.norm(A[:, None] - B[None], axis=-1), axis=1)


def cloud(n, seed, kind):
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(n, 3)) * [10.0, 10.0, 0.1]
    if kind == "duplicates":
        p = np.round(p)
    if kind == "stray":
        p[0] = 1e7
    return p + (1e4 if kind == "offset" else 0.0)


clouds = st.builds(
    cloud,
    st.integers(1, 300),
    st.integers(0, 10**6),
    st.sampled_from(["plain", "duplicates", "stray", "offset"]),
)


@settings(deadline=None)
@given(clouds, clouds, st.integers(1, 5))
def test_distances_equal_brute_force(A, B, k):
    forth, back = brute(A, B), brute(B, A)
    k = min(k, len(B))
    assert directed_hausdorff(A, B) == pytest.approx(forth[:, 0].max(), rel=1e-14)
    assert hausdorff(A, B) == pytest.approx(max(forth[:, 0].max(), back[:, 0].max()), rel=1e-14)
    assert mean_directed_hausdorff(A, B, k) == pytest.approx(forth[:, :k].mean(), rel=1e-12)


@settings(deadline=None)
@given(clouds, clouds, clouds)
def test_hausdorff_is_a_metric(A, B, C):
    assert hausdorff(A, A) == 0.0
    assert hausdorff(A, B) == hausdorff(B, A)
    assert hausdorff(A, C) <= (hausdorff(A, B) + hausdorff(B, C)) * (1 + 1e-12)
    assert mean_directed_hausdorff(A, B) <= directed_hausdorff(A, B) * (1 + 1e-12)


@settings(deadline=None)
@given(clouds, clouds, st.integers(0, 10**6))
def test_order_of_points_changes_no_bit(A, B, seed):
    rng = np.random.default_rng(seed)
    X, Y = A[rng.permutation(len(A))], B[rng.permutation(len(B))]
    k = min(3, len(B))
    assert hausdorff(A, B) == hausdorff(X, Y)
    assert mean_directed_hausdorff(A, B, k) == mean_directed_hausdorff(X, Y, k)


def test_rigid_motion_keeps_distances_and_scale_scales_them():
    rng = np.random.default_rng(1)
    A, B = cloud(200, 1, "plain"), cloud(300, 2, "plain")
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    for distance in (directed_hausdorff, hausdorff, mean_directed_hausdorff):
        expected = distance(A, B)
        assert distance(A @ turn.T + 7, B @ turn.T + 7) == pytest.approx(expected, rel=1e-12)
        assert distance(1e-6 * A, 1e-6 * B) == pytest.approx(1e-6 * expected, rel=1e-12)


def test_known_values():
    A, B = [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [1, 0, 0], [5, 0, 0]]
    assert directed_hausdorff(A, B) == 0.0
    assert directed_hausdorff(B, A) == 4.0
    assert hausdorff(A, B) == 4.0
    assert mean_directed_hausdorff(B, A) == pytest.approx(4 / 3)
    assert mean_directed_hausdorff(A, B, k=2) == 0.5


def test_scans_grids_and_arrays_serve_alike():
    A, B = cloud(50, 1, "plain"), cloud(60, 2, "plain")
    expected = hausdorff(A, B)
    for form in (SimpleNamespace, None):
        wrapped = build_grid(A) if form is None else form(points=A)
        assert hausdorff(wrapped, B) == expected
        assert hausdorff(B, wrapped) == expected


@pytest.mark.parametrize("k", [1, 2, 4])
def test_floor_is_what_a_perfect_surface_measures(k):
    rng = np.random.default_rng(k)
    density, side = 2.5, 200.0
    scan = np.column_stack(
        (rng.uniform(0, side, (int(density * side**2), 2)), np.zeros(int(density * side**2)))
    )
    surface = np.column_stack((rng.uniform(5, side - 5, (40_000, 2)), np.zeros(40_000)))
    assert mean_directed_hausdorff(surface, scan, k) == pytest.approx(sampling_floor(density, k), rel=0.01)
    assert sampling_floor(density) == pytest.approx(0.5 / np.sqrt(density), rel=1e-14)


@pytest.mark.parametrize(
    ("A", "B", "words"),
    [
        (np.zeros((0, 3)), np.zeros((1, 3)), "between 1 and"),
        (np.zeros((1, 3)), np.zeros((2, 4)), r"\(2, 4\)"),
        ([[np.nan, 0, 0]], np.zeros((1, 3)), "finite"),
        (np.zeros((1, 3)), [[0, 0, np.inf]], "finite"),
        (None, np.zeros((1, 3)), "expected points"),
        ("points", np.zeros((1, 3)), "expected points"),
    ],
)
def test_bad_points(A, B, words):
    for distance in (directed_hausdorff, hausdorff, mean_directed_hausdorff):
        with pytest.raises(ValueError, match=words):
            distance(A, B)


def test_bad_numbers():
    for k in (0, 3):
        with pytest.raises(ValueError, match="k"):
            mean_directed_hausdorff(np.zeros((1, 3)), np.zeros((2, 3)), k)
    for density in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="density"):
            sampling_floor(density)
    with pytest.raises(ValueError, match="k >= 1"):
        sampling_floor(1.0, 0)
