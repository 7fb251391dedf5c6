"""One ridge, however its scan is ordered or placed and wherever it is picked; and what the hints do."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import PICK, SPIRAL, apex, spiral_points, spiral_ridge
from scipy.spatial.transform import Rotation

import ridgefeature as rf
from ridgefeature.io.feature import to_document
from ridgefeature.section import SECTIONS
from ridgefeature.synthetic import Spiral

MIRROR = np.array([1.0, 1.0, -1.0])
TURN = Rotation.from_rotvec([0.4, -1.1, 2.0]).as_matrix()


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge()


def on_path(ridge: rf.Ridge) -> np.ndarray:
    return SPIRAL.path_coordinates(ridge.spine[:, :2])[0]


# Same input, same output


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_order_of_the_points_does_not_matter_to_the_last_bit(ridge, seed):
    points = spiral_points()
    shuffled = points[np.random.default_rng(seed).permutation(len(points))]
    assert to_document(rf.register(shuffled, at=apex())) == to_document(ridge)


def test_a_second_run_gives_the_same_to_the_last_bit(ridge):
    assert to_document(rf.register(spiral_points(), at=apex())) == to_document(ridge)


def test_the_scan_is_left_as_it_was():
    points = spiral_points().copy()
    rf.register(points, at=apex())
    np.testing.assert_array_equal(points, spiral_points())


def assert_same(found: rf.Ridge, ridge: rf.Ridge, place, size: float = 1.0) -> None:
    assert len(found.templates) == len(ridge.templates)
    assert found.stop == ridge.stop
    length = size * ridge.length
    assert found.length == pytest.approx(length, rel=1e-6)
    np.testing.assert_allclose(found.spine, place(ridge.spine), atol=1e-6 * length)
    np.testing.assert_allclose(found.height, size * ridge.height, rtol=1e-6)
    np.testing.assert_allclose(found.width, size * ridge.width, rtol=1e-6)


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_moved_scan_gives_the_same_ridge(noise):
    shift = np.array([1000.0, -500.0, 200.0])
    found = rf.register(spiral_points(noise=noise) + shift, at=apex() + shift)
    assert_same(found, spiral_ridge(noise=noise), lambda x: x + shift)


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_scan_a_thousand_times_smaller_gives_the_same_ridge(noise):
    found = rf.register(spiral_points(noise=noise) * 1e-3, at=apex() * 1e-3)
    assert_same(found, spiral_ridge(noise=noise), lambda x: x * 1e-3, 1e-3)


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_scan_a_thousand_times_larger_gives_the_same_ridge(noise):
    found = rf.register(spiral_points(noise=noise) * 1e3, at=apex() * 1e3)
    assert_same(found, spiral_ridge(noise=noise), lambda x: x * 1e3, 1e3)


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_turned_scan_gives_the_same_ridge(noise):
    found = rf.register(spiral_points(noise=noise) @ TURN.T, at=apex() @ TURN.T)
    assert_same(found, spiral_ridge(noise=noise), lambda x: x @ TURN.T)


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_turned_scan_gives_a_ridge_within_the_bands(noise):
    found = rf.register(spiral_points(noise=noise) @ TURN.T, at=apex() @ TURN.T)
    s = SPIRAL.path_coordinates((found.spine @ TURN)[:, :2])[0]
    inside = (s > 0.1 * SPIRAL.arc_length) & (s < 0.9 * SPIRAL.arc_length)
    slack = 4.5 * found.height_std + 1e-3 * found.height
    assert (np.abs(found.height - SPIRAL.height(s)) < slack)[inside].all()
    assert found.length == pytest.approx(SPIRAL.arc_length, rel=0.03)


# Where it is picked


@pytest.mark.parametrize("pick", [15.0, 100.0, 150.0])
def test_two_picks_on_one_ridge_agree_within_their_bands(ridge, pick):
    other = rf.register(spiral_points(), at=apex(s=pick))
    s, t = on_path(ridge), on_path(other)
    at = np.linspace(0.1, 0.9, 60) * SPIRAL.arc_length

    def along(where, values):
        order = np.argsort(where)
        return np.interp(at, where[order], values[order])

    for name in ("height", "width"):
        difference = along(s, getattr(ridge, name)) - along(t, getattr(other, name))
        assert (np.abs(difference) < 3 * along(s, getattr(ridge, name + "_std"))).all()
    assert other.length == pytest.approx(ridge.length, rel=0.03)


def test_a_pick_at_the_foot_finds_the_same_ridge(ridge):
    foot = SPIRAL.spine(PICK) * (1 + 0.3 * SPIRAL.width(PICK) / SPIRAL.radius)
    found = rf.register(spiral_points(), at=foot)
    assert found.length == pytest.approx(ridge.length, rel=0.03)


def test_a_list_a_scan_and_an_array_serve_alike(ridge):
    scan = rf.Scan(spiral_points(), "cm")
    found = rf.register(scan, at=tuple(apex().tolist()))
    assert found.unit == "cm"
    np.testing.assert_array_equal(found.height, ridge.height)
    np.testing.assert_array_equal(found.pick, apex())


# Hints


@pytest.mark.parametrize("sign", [1, -1])
def test_the_direction_hint_orients_arc_length(sign):
    angle = PICK / SPIRAL.radius
    ahead = sign * np.array([-np.sin(angle), np.cos(angle), 0.0])
    s = on_path(rf.register(spiral_points(), at=apex(), direction=3.7 * ahead))
    assert sign * (s[-1] - s[0]) > 0.95 * SPIRAL.arc_length


def test_without_a_direction_arc_length_starts_at_the_end_nearer_to_the_pick():
    for pick in (20.0, 150.0):
        found = rf.register(spiral_points(), at=apex(s=pick))
        assert np.linalg.norm(found.spine[0] - apex(s=pick)) < np.linalg.norm(found.spine[-1] - apex(s=pick))


@pytest.mark.parametrize("hint", [{"width": 8.0}, {"height": 3.0}, {"width": 12.0, "height": 6.0}])
def test_width_and_height_hints_lead_to_the_same_ridge(ridge, hint):
    found = rf.register(spiral_points(), at=apex(), **hint)
    assert found.length == pytest.approx(ridge.length, rel=0.03)
    s = on_path(found)
    inside = (s > 0) & (s < SPIRAL.arc_length)
    assert (np.abs(found.height - SPIRAL.height(s)) < 4.5 * found.height_std)[inside].all()


def test_a_groove_is_a_ridge_of_negative_height(ridge):
    groove = rf.register(spiral_points() * MIRROR, at=apex() * MIRROR, kind="groove")
    assert (groove.height < 0).all()
    s = on_path(groove)
    inside = (s > 0) & (s < SPIRAL.arc_length)
    assert (np.abs(groove.height + SPIRAL.height(s)) < 4.5 * groove.height_std)[inside].all()
    assert (groove.normal[:, 2] > 0.9).all()
    assert groove.length == pytest.approx(ridge.length, rel=0.03)


def test_auto_takes_either(ridge):
    auto = rf.register(spiral_points(), at=apex(), kind="auto")
    np.testing.assert_allclose(np.abs(auto.height), np.abs(ridge.height))


@pytest.mark.parametrize("radius", [20.0, 30.0])
def test_the_region_of_interest_limits_the_ridge(radius):
    found = rf.register(spiral_points(), at=apex(), roi=radius)
    away = np.linalg.norm(found.spine - apex(), axis=1)
    assert 0.8 * radius < away.max() < 1.1 * radius
    assert all("the data end" in why for why in found.stop)


# Sections


@pytest.mark.parametrize("name", ["bell", "plateau"])
def test_the_section_of_the_scan_is_recognised(name):
    spiral = Spiral(section=SECTIONS[name]())
    found = rf.register(spiral.points(12000, noise=0.05, seed=2), at=apex(spiral))
    assert found.section.name == name
    assert found.length == pytest.approx(spiral.arc_length, rel=0.04)


def test_a_section_that_is_asked_for_is_used():
    found = rf.register(spiral_points(), at=apex(), settings=rf.Settings(section="plateau"))
    assert found.section.name == "plateau"
    assert all(t.section is found.section for t in found.templates)
