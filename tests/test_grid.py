"""The grid against brute force: every query, on points that make an index fail."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ridgefeature.grid import (
    build_grid,
    nearest,
    nearest_distance,
    nearest_distances,
    points_in_ball,
    points_in_box,
    typical_spacing,
)

KINDS = ("surface", "clusters", "duplicates", "line", "strays", "lattice", "sphere", "one place")


def cloud(kind, n, seed, scale=1.0, offset=0.0):
    rng = np.random.default_rng(seed)
    p = rng.uniform(-1, 1, (n, 3))
    if kind in ("surface", "strays"):
        p[:, 2] = 0.1 * np.sin(5 * p[:, 0])
    if kind == "strays":
        p[: max(1, n // 300)] *= 1e6
        p[n // 2 : n // 2 + n // 20, 2] = rng.uniform(-1, 1, n // 20)
    if kind == "clusters":
        p = rng.integers(0, 3, (n, 3)) + 1e-3 * p
    if kind == "duplicates":
        p = p[rng.integers(0, max(1, n // 10), n)]
    if kind == "line":
        p = np.outer(p[:, 0], [1.0, 2.0, -0.5])
    if kind == "lattice":
        p = rng.integers(0, 7, (n, 3)).astype(float)
    if kind == "sphere":
        p /= np.linalg.norm(p, axis=1)[:, None]
    if kind == "one place":
        p[:] = p[0]
    return scale * p + offset


def rotation(seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def brute_nearest(points, queries, k):
    d = queries[:, None, :] - points[None, :, :]
    squares = d[..., 0] * d[..., 0] + d[..., 1] * d[..., 1] + d[..., 2] * d[..., 2]
    distances, found = np.empty((len(queries), k)), np.empty((len(queries), k, 3))
    for i, row in enumerate(squares):
        order = np.lexsort((points[:, 2], points[:, 1], points[:, 0], row))[:k]
        distances[i], found[i] = np.sqrt(row[order]), points[order]
    return distances, found


def brute_box(points, origin, axes, half):
    d = points - origin
    local = np.stack([d[:, 0] * a[0] + d[:, 1] * a[1] + d[:, 2] * a[2] for a in axes], axis=1)
    return local[(np.abs(local) <= half).all(axis=1)]


def brute_bins(local, half, cells):
    nx, ny = cells
    step = np.array([2 * half[0] / nx, 2 * half[1] / ny])
    place = np.clip(np.floor((local[:, :2] + half[:2]) * (1.0 / step)), 0, [nx - 1, ny - 1])
    away = local[:, :2] + half[:2] - (place + 0.5) * step
    squares = away[:, 0] * away[:, 0] + away[:, 1] * away[:, 1]
    bins = place[:, 1] * nx + place[:, 0]
    order = np.lexsort((local[:, 2], local[:, 1], local[:, 0], squares, bins))
    return local[order][np.unique(bins[order], return_index=True)[1]]


def in_order(rows):
    return rows[np.lexsort(rows.T[::-1])]


clouds = st.builds(
    cloud,
    st.sampled_from(KINDS),
    st.one_of(st.integers(1, 12), st.integers(13, 1500)),
    st.integers(0, 10**6),
    st.sampled_from([1.0, 1e-6, 1e6, 37.0]),
    st.sampled_from([0.0, 1e3, -1e6]),
)
seeds = st.integers(0, 10**6)


def probes(points, seed, m=12):
    """Queries near the points, among them, and far outside."""
    rng = np.random.default_rng(seed)
    size = np.ptp(points, axis=0).max() or 1.0
    near = points[rng.integers(0, len(points), m)]
    far = near + size * rng.choice([0.01, 0.3, 10.0, 1e5], (m, 1)) * rng.normal(size=(m, 3))
    return np.concatenate((near, far))


@settings(deadline=None, max_examples=150)
@given(clouds, seeds, st.integers(1, 16))
def test_nearest_equals_brute_force(points, seed, k):
    k = min(k, len(points))
    queries = probes(points, seed)
    grid = build_grid(points)
    distances, found = nearest(grid, queries, k)
    expected, places = brute_nearest(points, queries, k)
    np.testing.assert_array_equal(distances, expected)
    np.testing.assert_array_equal(found, places)
    np.testing.assert_array_equal(nearest_distances(grid, queries, k), expected)
    assert nearest_distance(grid, queries[0]) == expected[0, 0]


@settings(deadline=None, max_examples=150)
@given(clouds, seeds, st.tuples(st.floats(1e-3, 3), st.floats(1e-3, 3), st.floats(1e-3, 3)))
def test_box_equals_brute_force(points, seed, ratios):
    size = np.ptp(points, axis=0).min() or np.ptp(points, axis=0).max() or 1.0
    half = size * np.array(ratios)
    origin = probes(points, seed)[seed % 24]
    for axes in (rotation(seed), np.eye(3), np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])):
        found = points_in_box(build_grid(points), origin, axes, half)
        expected = brute_box(points, origin, axes, half)
        np.testing.assert_array_equal(in_order(found), in_order(expected))
        thinned = points_in_box(build_grid(points), origin, axes, half, cells=(5, 3))
        np.testing.assert_array_equal(thinned, brute_bins(expected, half, (5, 3)))


@settings(deadline=None, max_examples=100)
@given(clouds, seeds, st.floats(0, 4))
def test_ball_equals_brute_force(points, seed, ratio):
    centre = probes(points, seed)[seed % 24]
    radius = ratio * (np.ptp(points, axis=0).min() or 1.0)
    d = points - centre
    inside = d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1] + d[:, 2] * d[:, 2] <= radius * radius
    found = points_in_ball(build_grid(points), centre, radius)
    np.testing.assert_array_equal(in_order(found), in_order(points[inside]))


@settings(deadline=None, max_examples=60)
@given(clouds, seeds)
def test_results_do_not_depend_on_the_order_of_points(points, seed):
    queries = probes(points, seed)
    half = np.full(3, np.ptp(points, axis=0).max() / 3 + 1e-9)
    answers = []
    for given_points in (points, points[np.random.default_rng(seed).permutation(len(points))]):
        grid = build_grid(given_points)
        answers.append(
            (
                *nearest(grid, queries, min(5, len(points))),
                points_in_box(grid, queries[0], rotation(seed), half),
                points_in_box(grid, queries[0], rotation(seed), half, cells=(4, 6)),
                points_in_ball(grid, queries[1], half[0]),
                np.array(typical_spacing(grid)),
            )
        )
    for first, second in zip(*answers, strict=True):
        assert first.tobytes() == second.tobytes()


@pytest.mark.parametrize("kind", KINDS)
def test_large_clouds_agree_with_brute_force(kind):
    points = cloud(kind, 60_000, 5)
    queries = probes(points, 6, 8)
    grid = build_grid(points)
    distances, found = nearest(grid, queries, 3)
    expected, places = brute_nearest(points, queries, 3)
    np.testing.assert_array_equal(distances, expected)
    np.testing.assert_array_equal(found, places)
    half = np.array([2.0, 0.05, 1.0])
    axes = rotation(7)
    np.testing.assert_array_equal(
        in_order(points_in_box(grid, points[3], axes, half)),
        in_order(brute_box(points, points[3], axes, half)),
    )


def test_thinning_follows_a_rigid_motion():
    points = cloud("surface", 4000, 1)
    axes, turn, shift = rotation(2), rotation(3), np.array([4.0, -2.0, 9.0])
    half = (0.6, 0.4, 0.5)
    before = points_in_box(build_grid(points), points[0], axes, half, cells=(12, 8))
    moved = points @ turn.T + shift
    after = points_in_box(build_grid(moved), moved[0], axes @ turn.T, half, cells=(12, 8))
    assert len(before) > 30
    np.testing.assert_allclose(after, before, atol=1e-12)


@pytest.mark.parametrize("kind", ["surface", "sphere", "strays"])
def test_cells_are_neither_crowded_nor_many(kind):
    points = cloud(kind, 50_000, 2)
    grid = build_grid(points)
    counts = np.diff(grid.starts).astype(float)
    assert (counts**2).sum() / counts.sum() < 60  # the company a point has in its cell
    assert len(counts) <= len(points)


def test_memory_stays_near_one_copy():
    points = cloud("sphere", 500_000, 2)
    build_grid(points[:100])
    tracemalloc.start()
    grid = build_grid(points)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(grid.points) == len(points)
    assert points.nbytes < peak < 1.3 * points.nbytes


def test_spacing_of_a_lattice_and_of_random_points():
    steps = np.arange(100.0)
    lattice = np.stack((*np.meshgrid(3 * steps, 3 * steps), np.zeros((100, 100))), axis=-1).reshape(-1, 3)
    assert typical_spacing(build_grid(lattice)) == 3.0
    assert typical_spacing(build_grid(np.repeat(lattice, 3, axis=0))) == 3.0
    rng = np.random.default_rng(0)
    flat = np.column_stack((rng.uniform(0, 100, (40_000, 2)), np.zeros(40_000)))
    assert typical_spacing(build_grid(flat)) == pytest.approx(0.47 / 2.0, rel=0.15)
    assert typical_spacing(build_grid(np.ones((50, 3)))) == 0.0
    assert typical_spacing(build_grid(np.ones((1, 3)))) == 0.0


def test_input_of_any_layout_is_taken_and_left_alone():
    points = cloud("surface", 300, 3)
    expected = build_grid(points).points
    record = np.zeros(300, dtype=[("flag", "u1"), ("p", "<f8", 3)])
    record["p"] = points
    fixed = points.copy()
    fixed.setflags(write=False)
    for same in (np.asfortranarray(points), points.astype(">f8"), record["p"], fixed, points.tolist()):
        np.testing.assert_array_equal(build_grid(same).points, expected)
    assert points.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        build_grid(points).points[0, 0] = 1.0


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (np.zeros((0, 3)), "between 1 and"),
        (np.zeros((4, 2)), r"\(n, 3\).*\(4, 2\)"),
        (np.zeros(3), r"\(n, 3\).*\(3,\)"),
        (None, "expected points"),
        ([["a", "b", "c"]], "array of numbers"),
        ([[0, 0, 0], [0, np.nan, 0]], "finite.*row 1"),
        ([[np.inf, 0, 0]], "finite.*row 0"),
        ([[0, 0, -1e200]], "1e\\+150.*row 0"),
    ],
)
def test_bad_points(points, words):
    with pytest.raises(ValueError, match=words):
        build_grid(points)


def test_bad_queries():
    grid = build_grid(cloud("surface", 20, 0))
    origin, axes, half = np.zeros(3), np.eye(3), np.ones(3)
    for k in (0, -1, 21):
        with pytest.raises(ValueError, match="1 <= k <= 20"):
            nearest(grid, [[0, 0, 0]], k)
    for queries, words in (
        ([[0, np.nan, 0]], "finite"),
        ([[0, 0, np.inf]], "finite"),
        ([0, 0, 0], r"\(m, 3\)"),
    ):
        with pytest.raises(ValueError, match=words):
            nearest(grid, queries)
    for box, words in (
        ((origin * np.nan, axes, half), "finite origin"),
        ((origin, 2 * axes, half), "orthonormal"),
        ((origin, axes * np.nan, half), "orthonormal"),
        ((origin, axes, [1, 1, 0]), "half sizes above 0"),
        ((origin, axes, [1, np.inf, 1]), "half sizes above 0"),
        (([0, 0], axes, half), r"shape \(3,\)"),
        ((origin, axes, half, (0, 3)), "at least one bin"),
    ):
        with pytest.raises(ValueError, match=words):
            points_in_box(grid, *box)
    for ball in ((origin, -1.0), (origin, np.nan), (origin, np.inf), (origin * np.nan, 1.0)):
        with pytest.raises(ValueError, match="finite"):
            points_in_ball(grid, *ball)


def test_no_queries_give_no_answers():
    distances, found = nearest(build_grid(np.zeros((3, 3))), np.zeros((0, 3)), 2)
    assert distances.shape == (0, 2)
    assert found.shape == (0, 2, 3)


def test_a_grid_is_the_same_with_its_bounds_given():
    points = np.random.default_rng(3).normal(size=(500, 3))
    own, given = build_grid(points), build_grid(points, np.array([points.min(axis=0), points.max(axis=0)]))
    for a, b in zip(vars(own).values(), vars(given).values(), strict=True):
        np.testing.assert_array_equal(a, b)
