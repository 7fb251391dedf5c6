"""The whole ridge fitted together: its path frame, free sections, smooth functions and ends."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from oracles import SPIRAL, apex, spiral_points, spiral_ridge
from scipy.spatial import cKDTree

import ridgefeature as rf
from ridgefeature.free_section import trimmed
from ridgefeature.grid import build_grid
from ridgefeature.joint_stations import stations_of
from ridgefeature.kernels.strip import rectified
from ridgefeature.path_frame import path_frame, points_along
from ridgefeature.refit import refitted
from ridgefeature.section import Section, bell, cosine, plateau
from ridgefeature.settings import Settings
from ridgefeature.stations import lay_out
from ridgefeature.whole_ends import ends_of

LEAN = 0.12


def leaning(eta: np.ndarray) -> np.ndarray:
    """An asymmetric section: a cosine whose apex lies LEAN widths to the left of the middle."""
    x = np.where(eta < LEAN, (eta - LEAN) / (0.5 + LEAN), (eta - LEAN) / (0.5 - LEAN))
    return np.where(np.abs(eta) < 0.5, 0.5 + 0.5 * np.cos(np.pi * x), 0.0)


def strip(section, n: int = 20000, noise: float = 0.05, seed: int = 1, fade: float = 0.0) -> np.ndarray:
    """A straight ridge along x from 0 to 60, 2 high and 10 wide, on a plane; its end fades over `fade`."""
    random = np.random.default_rng(seed)
    points = random.uniform([-25, -25, 0], [85, 25, 0], (n, 3))
    x, y = points[:, 0], points[:, 1]
    height = 2.0 * np.clip((60.0 - x) / fade, 0.0, 1.0) if fade else 2.0 * (x < 60)
    points[:, 2] = np.where(x > 0, height, 0.0) * section(y / 10.0)
    return points + random.normal(0.0, noise, points.shape)


@lru_cache
def asymmetric() -> rf.Ridge:
    return rf.register(strip(leaning), at=(30, 10 * LEAN, 2), direction=(1, 0, 0))


# Coordinates along the path


@pytest.mark.parametrize("beyond", [(0.0, 0.0), (12.0, 5.0)])
def test_points_along_a_path_are_those_that_a_look_at_all_points_finds(beyond):
    ridge, points = spiral_ridge(), spiral_points(3000)
    path = path_frame(ridge, False, beyond)
    reach = 0.8 * path.width
    found = points_along(build_grid(points), path, reach, 10**6)
    frame = path.origin, path.tangent, path.left, path.normal, path.curvature
    expected = rectified(points, *frame, reach, path.tall, 0)
    order = [np.lexsort(x.round(9).T) for x in (found, expected)]
    np.testing.assert_allclose(found[order[0]], expected[order[1]], atol=1e-9)


def test_of_many_points_some_are_taken():
    ridge, grid = spiral_ridge(), build_grid(spiral_points(12000))
    path = path_frame(ridge, False)
    whole, some = (len(points_along(grid, path, path.width, most)) for most in (10**6, 1000))
    assert 500 < some <= 1000 < whole


def test_which_points_are_taken_does_not_depend_on_their_order():
    ridge, points = spiral_ridge(), np.repeat(spiral_points(12000), 2, axis=0)
    path = path_frame(ridge, False)
    shuffled = points[np.random.default_rng(4).permutation(len(points))]
    one, other = (points_along(build_grid(p), path, path.width, 3000) for p in (points, shuffled))
    np.testing.assert_array_equal(one, other)


def lattice(turn: float) -> np.ndarray:
    """The spiral's surface at the places (250,000 of them) of a square grid, turned about its axis."""
    x, y = np.meshgrid(*2 * [0.2 * np.arange(500) - 50.0])
    c, s = np.cos(turn), np.sin(turn)
    flat = np.column_stack([x.ravel(), y.ravel()]) @ np.array([[c, s], [-s, c]])
    return np.column_stack([flat, SPIRAL.elevation(flat)])


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_the_points_that_are_taken_lie_more_evenly_than_by_chance(turn):
    path = path_frame(spiral_ridge(), False)
    grid, reach = build_grid(lattice(turn)), 0.6 * path.width
    whole, uneven = points_along(grid, path, reach, 10**6), []
    for most in (500, 1000, 2000, 5000, 15000):
        some = points_along(grid, path, reach, most)
        assert 0.5 * most < len(some) < most
        for column in range(3):
            edges = np.quantile(whole[:, column], np.linspace(0, 1, 13)[1:-1])
            all_, found = (np.bincount(np.searchsorted(edges, p[:, column])) for p in (whole, some))
            expected = all_ * len(some) / len(whole)
            uneven.append(float(((found - expected) ** 2 / expected).mean()))
    assert max(uneven) < 1.4 and np.mean(uneven) < 0.6  # 0.9 by chance


def test_a_path_runs_on_as_it_bends():
    path = path_frame(spiral_ridge(), False, (10.0, 10.0))
    radius = np.linalg.norm(path.origin[:, :2], axis=1)
    assert np.abs(radius - SPIRAL.radius).max() < 0.8  # ten further on, with noise
    outside = (path.at < 0) | (path.at > spiral_ridge().length)
    assert outside.sum() > 10 and not path.height[outside].any()


# What it is good for


def test_the_whole_fit_is_better_than_its_templates():
    errors = {"whole": [], "templates": []}
    for seed in range(1, 7):
        whole = spiral_ridge(seed=seed)
        for name, found in (
            ("whole", whole),
            ("templates", lay_out(whole.templates, whole.settings)),
        ):
            s = SPIRAL.path_coordinates(found.spine[:, :2])[0]
            on = (s > 0) & (s < SPIRAL.arc_length)
            errors[name].append(((found.height - SPIRAL.height(s)) / SPIRAL.height(s))[on])
    whole, templates = (np.sqrt(np.mean(np.concatenate(e) ** 2)) for e in errors.values())
    assert whole < 0.8 * templates


def test_too_few_points_leave_the_stations_as_they_are():
    ridge = spiral_ridge()
    far = build_grid(spiral_points(2000) + np.array([0.0, 0.0, 500.0]))
    found = refitted(far, ridge, bell(), False, (True, True), Settings())
    assert found.stations is ridge and found.joint is None and found.end_interval is None


def test_widths_are_never_negative_whatever_a_fit_says():
    """A fit that is no ridge's may have them: along its path no points would be found, and no end."""
    found = refitted(
        build_grid(spiral_points(3000)), spiral_ridge(), bell(), False, (False, False), Settings()
    )
    joint = found.joint
    assert joint is not None
    turned = replace(joint, smooth=joint.smooth.changed(np.diag([1.0, 1.0, 1.0, 1.0, 1.0, -1.0])))
    assert (stations_of(turned, 41, Settings()).width > 0).all()


def test_nothing_is_left_of_a_ridge_that_ends_before_it_starts():
    """So its ends are told of a fit that is no ridge's: they stay, for the caller to refuse."""
    joint = refitted(
        build_grid(spiral_points(3000)), spiral_ridge(), bell(), False, (False, False), Settings()
    ).joint
    assert joint is not None
    start, end = 0.5001 * joint.path.at[-1], 0.5 * joint.path.at[-1]
    assert not ((joint.path.at > end) & (joint.path.at < start)).any()
    assert ends_of(joint, joint, start, end, (True, True), 1.0) == (start, end)


# Sections


def cosine_scan(seed: int) -> np.ndarray:
    """Points (30000, 3) of a winding ridge 4 + 0.03 x high and 12 wide, its section exactly a cosine."""
    random, t = np.random.default_rng(seed), np.linspace(-60, 60, 6001)
    xy = random.uniform(-50, 50, (30_000, 2))
    eta = cKDTree(np.column_stack([t, 10 * np.sin(t / 20)])).query(xy)[0] / 12
    z = (4 + 0.03 * xy[:, 0]) * np.where(eta < 0.5, 0.5 + 0.5 * np.cos(2 * np.pi * eta), 0.0)
    return np.column_stack([xy, z]) + random.normal(0, 0.2, (30_000, 3))


def test_a_section_that_is_only_near_the_points_does_not_spoil_the_height():
    """The section named cosine is off by 2 % near the feet, less than any one point's noise."""
    for seed in (1, 2, 7):
        ridge = rf.register(cosine_scan(seed), at=(0, 0, 4))
        inner = np.abs(ridge.spine[:, 0]) < 46
        off = (ridge.height - 4 - 0.03 * ridge.spine[:, 0])[inner].mean()
        assert abs(off) < 2.0 * np.median(ridge.height_std[inner])
        assert ridge.height_std[inner].max() < 0.06


def test_an_asymmetric_section_is_found():
    ridge = asymmetric()
    assert ridge.section.name == "learned"
    eta = np.linspace(-0.5, 0.5, 401)
    assert abs(eta[np.argmax(ridge.section(eta))]) == pytest.approx(LEAN, abs=0.03)
    assert np.median(ridge.height) == pytest.approx(2.0, rel=0.01)
    assert np.median(ridge.half_height_width) == pytest.approx(5.0, rel=0.01)


def test_a_section_that_has_a_name_is_not_learned():
    found = rf.register(strip(plateau()), at=(30, 0, 2))
    assert found.section.name == "plateau"


def test_a_learned_section_adds_to_the_deviations_what_the_ridge_has_in_common():
    ridge = asymmetric()
    known = ridge.half_height_width_std / ridge.half_height_width
    assert (known < ridge.width_std / ridge.width).all()  # the feet are less sure than the flanks
    errors = [(ridge.half_height_width / 5.0 - 1.0) / known, (ridge.height - 2.0) / ridge.height_std]
    assert np.abs(errors).max() < 4.5
    assert (ridge.spine_std > 0).all() and (ridge.spine_std < 0.05 * ridge.width).all()


@pytest.mark.parametrize("make", [plateau, cosine], ids=["plateau", "cosine"])
def test_a_section_within_a_wider_one_is_trimmed_to_its_feet(make):
    eta, wider = np.linspace(-0.5, 0.5, 801), 1.25
    columns = np.stack([Section(unit, "x")(eta) for unit in np.eye(29)], axis=1)
    wide = Section(np.linalg.lstsq(columns, make()(eta * wider), rcond=None)[0], "wide")
    found, middle, breadth = trimmed(wide)
    assert middle == pytest.approx(0.0, abs=0.01)
    assert breadth == pytest.approx(1 / wider, rel=0.08)  # where a foot begins is hardly seen
    half = found.half_height_width * breadth
    assert half == pytest.approx(make().half_height_width / wider, rel=0.01)


# Ends


def test_an_abrupt_end_lies_in_its_interval_which_is_short():
    for seed in range(1, 7):
        ridge = rf.register(strip(bell(), seed=seed), at=(30, 0, 2), direction=(1, 0, 0))
        places = ridge.spine[0, 0] + ridge.end_interval
        assert places[0, 0] <= 0.0 <= places[0, 1] and places[1, 0] <= 60.0 <= places[1, 1]
        assert np.ptp(places, axis=1).max() < 10.0


def test_a_fading_end_has_a_longer_interval_and_is_followed_far():
    ridge = rf.register(strip(bell(), fade=40.0), at=(10, 0, 2), direction=(1, 0, 0))
    start, end = np.ptp(ridge.end_interval, axis=1)
    assert end > start
    assert ridge.spine[-1, 0] > 50.0
    places = ridge.spine[0, 0] + ridge.end_interval[1]
    assert places[0] < 60.0 and places[1] > 55.0


def test_an_end_that_was_not_looked_for_has_no_interval():
    assert rf.register(spiral_points(), at=apex(), max_templates=4).end_interval is None


def test_interval_and_deviations_go_where_the_ridge_goes():
    ridge = asymmetric()
    half = ridge.stretched(0.5 * ridge.length, "scale")
    np.testing.assert_allclose(half.end_interval, 0.5 * ridge.end_interval)
    np.testing.assert_allclose(half.spine_std, 0.5 * ridge.spine_std)
    wide = ridge.resized(w=1.1)
    np.testing.assert_allclose(wide.half_height_width_std, 1.1 * ridge.half_height_width_std)
    assert ridge.stretched(20.0, "trim").end_interval is None
