"""How the whole fit of a steep ridge begins: nearest places of its section, and the likeliest start."""

from __future__ import annotations

import numpy as np
import pytest

import ridgefeature as rf
from ridgefeature.foot_points import distances, information
from ridgefeature.grid import build_grid
from ridgefeature.joint import fit_whole
from ridgefeature.joint_rounds import is_steep, task_of
from ridgefeature.kernels.strip import TERMS, A, C, E, H, W
from ridgefeature.path_frame import path_frame
from ridgefeature.refit import refitted
from ridgefeature.section import bell, box, plateau
from ridgefeature.smearing import log_likelihood
from ridgefeature.stations import Stations
from ridgefeature.steep_start import topped

HEIGHT, WIDTH = 12.0, 10.0


def wall(eta: np.ndarray) -> np.ndarray:
    """A section with flanks of 84 degrees and a slightly arched top."""
    return np.clip((0.5 - np.abs(eta)) / 0.08, 0.0, 1.0) * (1.0 - 0.3 * eta * eta)


def straight(height: float = HEIGHT, width: float = WIDTH, bend: float = 0.0) -> Stations:
    """Stations along x from 0 to 60 of a ridge that is taken to be so high and wide, on so curved a base."""
    s, ones = np.linspace(0.0, 60.0, 31), np.ones(31)
    x, _, z = np.eye(3)
    spine = s[:, None] * x
    return Stations(
        s, spine, np.tile(x, (31, 1)), np.tile(z, (31, 1)), height * ones, width * ones,
        ones, ones, ones, curvature=bend * ones,
    )  # fmt: skip


def scanned(noise: float = 0.15, strays: float = 0.1, seed: int = 3) -> np.ndarray:
    """A wall on a plane, points even over its surface, some of them strays."""
    rng = np.random.default_rng(seed)
    eta = np.linspace(-2.5, 2.5, 20001)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(WIDTH * np.diff(eta), HEIGHT * np.diff(wall(eta))))])
    n = 12000
    y = np.interp(rng.uniform(0, way[-1], n), way, eta)
    points = np.column_stack([rng.uniform(-20, 80, n), WIDTH * y, HEIGHT * wall(y)])
    points[(points[:, 0] < 0) | (points[:, 0] > 60), 2] = 0.0
    points += rng.normal(0, noise, points.shape)
    far = rng.random(n) < strays
    points[far, 2] = rng.uniform(-HEIGHT, 2 * HEIGHT, far.sum())
    return points


def terms(n: int = 5) -> np.ndarray:
    out = np.zeros((n, TERMS))
    out[:, H], out[:, W], out[:, E], out[:, A], out[:, C] = 9.0, 8.0, 0.4, 0.2, 0.01
    return out


@pytest.mark.parametrize("section", [bell(), plateau(), box()], ids=lambda s: s.name)
def test_distances_are_those_from_the_nearest_place(section):
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(0, 4, 300), rng.uniform(-6, 6, 300), rng.uniform(-1, 11, 300)])
    found, _ = distances(points, terms(), section)
    eta = np.linspace(-1.0, 1.0, 40001)
    y, z = 0.4 + 8.0 * eta, 9.0 * section(eta)
    over = points[:, 2] - 0.2 - 0.01 * points[:, 1] ** 2  # the base is taken out at the point's own place
    nearest = np.array([np.hypot(y - p, z - q).min() for p, q in zip(points[:, 1], over, strict=True)])
    # Along the normal at one of about a hundred places: less where a corner is nearest, never much more.
    assert (np.abs(found) < nearest + 0.05).all()
    near = nearest < 0.5
    assert near.sum() > 30
    assert np.abs(np.abs(found) - nearest)[near].max() < 0.1
    assert np.median(np.abs(np.abs(found) - nearest)) < 2e-3
    inside = over < 9.0 * section((points[:, 1] - 0.4) / 8.0)
    clear = nearest > 0.3
    assert ((found < 0) == inside)[clear].all()


def test_rows_tell_how_distances_change():
    rng = np.random.default_rng(2)
    points = np.column_stack([rng.uniform(0, 4, 200), rng.uniform(-5, 5, 200), rng.uniform(0, 9, 200)])
    before, rows = distances(points, terms(), plateau())
    step = 1e-5
    for k in range(TERMS):
        moved = terms()
        moved[:, k] += step
        change = (distances(points, moved, plateau())[0] - before) / step
        # To first order in how far a point is from the surface.
        assert np.median(np.abs(change + rows[:, k])) < 0.05 * max(np.abs(rows[:, k]).max(), 1.0), k


def test_normal_equations_are_the_weighted_sums_of_each_stretch():
    rng = np.random.default_rng(4)
    points, rows = rng.uniform(0, 3, (50, 3)), rng.normal(size=(50, TERMS))
    off = rng.normal(size=50)
    matrix, right, sums = information(points, 3, off, rows, 0.5, 0.02)
    r = off / 0.5
    weight = np.exp(-0.5 * r * r) / (np.exp(-0.5 * r * r) + 0.02)
    for j in range(3):
        on = points[:, 0].astype(int) == j
        np.testing.assert_allclose(matrix[j], (rows[on].T * weight[on]) @ rows[on] / 0.25, rtol=1e-9)
        np.testing.assert_allclose(right[j], (rows[on].T * weight[on]) @ off[on] / 0.25, rtol=1e-9)
    np.testing.assert_allclose(sums[:3], [50, weight.sum(), (weight * weight * r * r).sum()])


@pytest.mark.parametrize(("height", "width"), [(1.5, 1.0), (0.8, 0.7), (1.0, 1.6)])
@pytest.mark.parametrize("bend", [0.0, 0.01])
def test_a_steep_ridge_is_found_from_a_start_far_off(height, width, bend):
    """Height, width and the base's curvature are wrong to begin with, as templates leave them."""
    start = straight(height * HEIGHT, width * WIDTH, bend)
    found = refitted(build_grid(scanned()), start, plateau(), False, (False, False), rf.Settings())
    assert found.joint is not None
    at, half = found.stations, found.joint.section.half_height_width
    inner = slice(3, -3)
    assert np.abs(at.height[inner] / HEIGHT - 1.0).max() < 0.03
    assert np.abs(half * at.width[inner] / (0.92 * WIDTH) - 1.0).max() < 0.04
    assert np.abs(at.curvature[inner] * WIDTH).max() < 0.1


def test_only_steep_ridges_begin_so():
    assert is_steep(path_frame(straight(), False))
    assert not is_steep(path_frame(straight(height=3.0), False))
    assert task_of(np.zeros((0, 3)), path_frame(straight(), False), False).steep


def test_without_rounds_there_is_the_start_of_a_steep_ridge_and_nothing_of_another():
    grid = build_grid(scanned())
    told = rf.Settings(), None, 0
    assert fit_whole(grid, path_frame(straight(), False), plateau(), *told) is not None
    assert fit_whole(grid, path_frame(straight(height=3.0), False), plateau(), *told) is None


def test_a_height_that_crosses_nothing_is_scaled_by_the_points_where_there_is_one():
    """A fit of what is no ridge has such; its other places tell how high it is."""
    one = terms()
    one[:, [A, C, E]] = 0.0
    one[:, H] = np.where(np.arange(len(one)) < 2, 0.0, 6.0)
    place = np.repeat(np.arange(len(one)), 5).astype(float)
    points = np.column_stack([place, np.zeros(len(place)), np.full(len(place), 9.0)])
    found = topped(points, one, box())
    np.testing.assert_allclose(found[:, H], 1.5 * one[:, H])


def test_the_likelihood_does_not_depend_on_how_fine_its_quadrature_is():
    """Up a flank of 85 degrees a coarse one misses the points between its places."""
    rng = np.random.default_rng(5)
    one = terms()
    one[:, [A, C, E]] = 0.0
    eta = rng.uniform(-1, 1, 2000)
    points = np.column_stack([rng.uniform(0, 4, 2000), 8.0 * eta, 9.0 * box()(eta)])
    points[:, 1:] += rng.normal(0, 0.1, (2000, 2))
    near = [log_likelihood(points, one, box(), noise, 0.0, 0.01, 40.0) for noise in (0.0999, 0.1, 0.1001)]
    assert abs(near[0] - near[2]) < 0.02 * abs(near[1])
