"""The points a template sees: regions that are looked up once, and thinned, against brute force."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import straight_ridge
from scipy.spatial.transform import Rotation

from ridgefeature.grid import build_grid, typical_spacing
from ridgefeature.kernels import region
from ridgefeature.section import bell
from ridgefeature.template import Template
from ridgefeature.window import _MOST_REGIONS, Window

HALF = np.array([6.0, 5.0, 4.0])


def box_of(origin, axes, half=HALF) -> np.ndarray:
    return np.concatenate([origin, axes.ravel(), half])


def brute_force(points, old, new, low, high, half_y, half_z):
    """To the scan's frame and on to the new one; and whether the new box lies in the old."""
    scan = points @ old[1].T + old[0]
    local = (scan - new[0]) @ new[1]
    x, y, z = local.T
    keep = (low <= x) & (x <= high) & (abs(y) <= half_y) & (abs(z) <= half_z)
    corners = np.stack(np.meshgrid([low, high], [-half_y, half_y], [-half_z, half_z]), -1).reshape(-1, 3)
    in_old = (corners @ new[1].T + new[0] - old[0]) @ old[1]
    return local[keep], bool((np.abs(in_old) <= HALF).all())


@given(st.integers(0, 10**6))
@settings(max_examples=80, deadline=None, derandomize=True)
def test_a_region_serves_exactly_the_windows_that_lie_in_it(seed):
    random = np.random.default_rng(seed)
    points = random.uniform(-1, 1, (400, 3)) * HALF
    old = random.normal(size=3), Rotation.random(random_state=seed).as_matrix()
    turn = Rotation.from_rotvec(0.3 * random.normal(size=3)).as_matrix()
    new = old[0] + random.normal(size=3), old[1] @ turn
    low, high = sorted(random.uniform(-3, 3, 2))
    half_y, half_z = random.uniform(0.5, 3.5, 2)
    window = (*new, low, high, half_y, half_z)
    expected, covers = brute_force(points, old, *[new], low, high, half_y, half_z)
    far = box_of(old[0] + 100, old[1])
    boxes = np.array([far, box_of(*old), far, box_of(*old)])
    assert region.covering(boxes, 3, *window, 1e9) == (1 if covers else -1)
    found = region.select(points, box_of(*old), *window)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_the_newest_region_serves_and_a_far_larger_one_does_not():
    axes, origin = np.eye(3), np.zeros(3)
    boxes = np.array([box_of(origin, axes), box_of(origin, axes)])
    window = (origin, axes, -1.0, 1.0, 1.0, 0.5)
    assert region.covering(boxes, 2, *window, 31.0) == 1
    assert region.covering(boxes, 2, *window, 29.0) == -1
    assert region.covering(boxes, 0, *window, 31.0) == -1


def test_a_thinned_window_is_as_dense_whatever_was_looked_up_before(window):
    few, wide = window.thinned(100), patch(0.0, width=14.0)
    few(wide)
    assert len(few(patch(0.0, width=2.0))) >= 20


@given(st.integers(0, 10**6))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_thinning_keeps_the_point_nearest_to_the_centre_of_each_bin_in_any_order(seed):
    random = np.random.default_rng(seed)
    points = random.uniform(-1, 1, (200, 3)) * HALF
    points[100:120] = points[:20]
    nx, ny = 5, 3
    found = region.thin(points, HALF[0], HALF[1], nx, ny)
    wide = 2 * HALF[:2] / [nx, ny]
    bins = np.clip(((points[:, :2] + HALF[:2]) / wide).astype(int), 0, [nx - 1, ny - 1])
    off = np.linalg.norm(points[:, :2] + HALF[:2] - (bins + 0.5) * wide, axis=1)
    expected = []
    for v in range(ny):
        for u in range(nx):
            inside = np.flatnonzero((bins == [u, v]).all(axis=1))
            if len(inside):
                expected.append(points[inside[np.argmin(off[inside])]])
    np.testing.assert_allclose(found, expected)
    np.testing.assert_array_equal(region.thin(random.permutation(points), HALF[0], HALF[1], nx, ny), found)


def test_thinning_nothing_gives_nothing():
    assert region.thin(np.empty((0, 3)), 1.0, 1.0, 4, 4).shape == (0, 3)


def patch(x: float, width: float = 6.0) -> Template:
    return Template(np.array([x, 0.0, 0.0]), np.eye(3), width, 2.0, 5.0, 2.0, bell())


@pytest.fixture
def window() -> Window:
    points = straight_ridge(4000, noise=0.1, seed=2, half=(40, 10))[0]
    grid = build_grid(points)
    return Window(grid, typical_spacing(grid))


def test_windows_hold_what_lies_in_them_whatever_was_asked_before(window):
    for x in (0.0, 0.3, 30.0, -25.0, 0.1):
        template = patch(x)
        points = window.grid.points - template.position
        inside = (abs(points) <= [2.5, template.half_breadth, 5.5]).all(axis=1)
        found = window(template)
        assert len(found) == inside.sum() > 50
        np.testing.assert_allclose(np.sort(found, axis=0), np.sort(points[inside], axis=0), atol=1e-12)


def test_a_thinned_window_takes_from_the_full_one_without_another_look_up(window, monkeypatch):
    few = window.thinned(40)
    some = few(patch(0.0))
    monkeypatch.setattr("ridgefeature.window.points_in_box", None)
    whole = window(patch(0.2))
    assert 10 <= len(some) <= 40 < len(whole)
    as_rows = {tuple(row) for row in np.round(window(patch(0.0)), 9)}
    assert {tuple(row) for row in np.round(some, 9)} <= as_rows


def test_long_marches_forget_the_oldest_regions_and_stay_right(window):
    positions = np.linspace(-30, 30, 3 * _MOST_REGIONS)
    for x in positions:
        window(patch(x, width=0.02))
    template = patch(-30.0)
    points = window.grid.points - template.position
    inside = (abs(points) <= [2.5, template.half_breadth, 5.5]).all(axis=1)
    assert len(window._regions.points) <= _MOST_REGIONS
    assert len(window(template)) == inside.sum()
