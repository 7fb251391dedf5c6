"""The march on the paper's spiral: what it covers, how it goes on, where and why it stops."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from oracles import (
    PICK,
    SPIRAL,
    apex,
    bell,
    spiral_points,
    spiral_ridge,
    straight_ridge,
    template_at,
    window_on,
)

import ridgefeature as rf
from ridgefeature.continuation import append
from ridgefeature.guess import guess
from ridgefeature.march import march, march_one_way, reverse
from ridgefeature.starts import Hints
from ridgefeature.synthetic import Spiral
from ridgefeature.template import Template

SETTINGS = rf.Settings()


def on_path(ridge: rf.Ridge, spiral: Spiral = SPIRAL) -> np.ndarray:
    """Arc length on the true path of every station."""
    return spiral.path_coordinates(ridge.spine[:, :2])[0]


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge()


@pytest.fixture(scope="module")
def marched():
    """Window, first template, track and the templates that the progress callback was told of."""
    window, told = window_on(spiral_points()), []
    first = guess(window, apex(), 100.0, Hints(), bell(), SETTINGS)
    return window, first, march(window, window, first, SETTINGS, told.append), told


# What is found


@pytest.mark.parametrize(
    ("n", "noise", "seed"),
    [(12000, 0.1, 1), (12000, 0.1, 2), (10000, 0.0, 4), *((10000, 0.3, seed) for seed in range(20))],
)
def test_the_spiral_is_covered_and_both_ends_lie_within_one_width(n, noise, seed):
    found = spiral_ridge(n, noise, seed)
    low, high = np.sort(on_path(found)[[0, -1]])
    total = SPIRAL.arc_length
    assert min(high, total) - max(low, 0.0) >= 0.97 * total
    assert abs(low) < SPIRAL.width(0.0)
    assert abs(high - total) < SPIRAL.width(total)


def test_height_and_width_agree_with_the_truth_within_their_bands():
    """Errors are smooth along a ridge, so that one alone does not tell whether the bands are right."""
    pooled = []
    for seed in range(1, 9):
        found = spiral_ridge(seed=seed)
        s = on_path(found)
        inside = (s > 0) & (s < SPIRAL.arc_length)
        height = (found.height - SPIRAL.height(s)) / found.height_std
        width = (found.width - SPIRAL.width(s)) / found.width_std
        pooled.append(np.stack([height, width])[:, inside])
    deviation = np.concatenate(pooled, axis=1)
    assert np.abs(deviation).max() < 4.5
    # Of some ten independent values a ridge: a standard deviation is known to 8 %.
    assert ((deviation.std(axis=1) > 0.8) & (deviation.std(axis=1) < 1.2)).all()
    assert (np.abs(deviation.mean(axis=1)) < 0.35).all()


def test_the_spine_follows_the_circle_and_the_frame_is_orthonormal(ridge):
    s, off = SPIRAL.path_coordinates(ridge.spine[:, :2])
    inside = (s > 0) & (s < 0.95 * SPIRAL.arc_length)
    assert np.abs(off / ridge.width)[inside].max() < 0.05
    assert np.abs(ridge.spine[:, 2] / ridge.width)[inside].max() < 0.05
    for axis in (ridge.tangent, ridge.normal, ridge.across):
        np.testing.assert_allclose(np.linalg.norm(axis, axis=1), 1, atol=1e-12)
    assert np.abs((ridge.tangent * ridge.normal).sum(axis=1)).max() < 1e-12
    assert (ridge.normal[:, 2] > 0.9).all()


def test_arc_length_starts_at_zero_and_is_even(ridge):
    assert ridge.arc_length[0] == 0
    np.testing.assert_allclose(np.diff(ridge.arc_length), ridge.arc_length[1])
    assert ridge.length == pytest.approx(SPIRAL.arc_length, rel=0.03)


def test_every_template_tells_how_its_fit_went(ridge):
    for template in ridge.templates:
        assert template.status in ("converged", "limit")
        assert template.evidence >= SETTINGS.going_on
        assert np.isfinite(template.std).all() and template.inliers <= template.points
        assert 0 < template.M < 10 * template.M_floor


# APPEND


def test_the_first_row_after_a_single_template_is_its_last_row(marched):
    _, first, _, _ = marched
    for start in append([first], SETTINGS):
        np.testing.assert_allclose(start.start, first.end, atol=1e-12)
        np.testing.assert_allclose(start.rotation, first.rotation, atol=1e-12)
        assert (start.height, start.width) == (first.height, first.width)


def test_the_first_row_of_every_next_start_lies_on_the_last_row_before(marched):
    _, _, track, _ = marched
    for n in range(2, len(track.templates)):
        last = track.templates[n - 1]
        for start in append(list(track.templates[:n]), SETTINGS):
            along, across, up = last.rotation.T @ (start.start - last.position)
            assert along == pytest.approx(0.5 * last.length, rel=0.02)
            assert (
                abs(across) < 0.1 * last.width
            )  # the chord of a bend does not end on the straight row's middle
            assert abs(up) < 0.02 * last.width
            assert start.status == "start" and start.std is None


def test_fitted_templates_follow_each_other_row_on_row(marched):
    track = marched[2].templates
    for before, after in pairwise(track):
        assert np.linalg.norm(after.start - before.end) < 0.05 * before.length
        assert before.rotation[:, 0] @ after.rotation[:, 0] > 0.9


def test_reversed_twice_is_the_same_template(marched):
    template = marched[1]
    back = reverse(template)
    np.testing.assert_array_equal(back.start, template.end)
    np.testing.assert_array_equal(back.rotation[:, 2], template.rotation[:, 2])
    np.testing.assert_array_equal(reverse(back).rotation, template.rotation)


# Where it stops, in words


def test_the_end_of_the_ridge_is_told(ridge):
    assert all("no ridge" in why for why in ridge.stop)
    assert ridge.closed is False


def test_the_edge_of_the_data_is_told():
    points = spiral_points()
    cropped = rf.register(points[points[:, 0] > -10], at=apex(s=20.0))
    s = on_path(cropped)
    edge = -1 if s[-1] > s[0] else 0
    assert "the data end" in cropped.stop[edge]
    assert "no ridge" in cropped.stop[-1 - edge]
    assert cropped.spine[edge, 0] == pytest.approx(-10, abs=0.5 * cropped.width[edge])


RING = Spiral(turns=1.0, heights=(3.0, 3.0), widths=(8.0, 8.0))


@pytest.fixture(scope="module")
def ring() -> rf.Ridge:
    return rf.register(RING.points(10000, noise=0.1, seed=3), at=apex(RING))


def test_a_ring_comes_back_to_where_it_began(ring):
    assert np.abs(ring.height - 3).max() < 0.3
    assert np.abs(np.hypot(*ring.spine.T[:2]) - RING.radius).max() < 0.3


def test_a_ring_is_a_closed_ridge_as_long_as_its_path(ring):
    assert ring.closed and ring.stop == ("closed", "closed")
    assert ring.length == pytest.approx(RING.arc_length, rel=0.01)


def test_max_templates_are_told():
    found = rf.register(spiral_points(), at=apex(), max_templates=5)
    assert len(found.templates) == 5
    assert any("max_templates (5)" in why for why in found.stop)


def test_one_template_makes_a_ridge():
    found = rf.register(spiral_points(), at=apex(), max_templates=1)
    assert len(found.templates) == 1
    assert found.length > 0 and np.isfinite(found.surface().poles).all()


@pytest.mark.parametrize("kind", ["ridge", "groove", "auto"])
@pytest.mark.parametrize("noise", [0.0, 0.1])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_plane_has_no_ridge(kind, noise, seed):
    random = np.random.default_rng(seed)
    plane = np.column_stack([random.uniform(-20, 20, (6000, 2)), noise * random.normal(size=6000)])
    with pytest.raises(rf.NoRidgeError, match=r"no ridge at .*evidence"):
        rf.register(plane, at=(2.0, 1.0, 0.0), kind=kind)


def registers(points: np.ndarray, at) -> bool:
    try:
        rf.register(points, at=at)
    except rf.NoRidgeError:
        return False
    return True


def test_a_sphere_has_no_ridge():
    found = []
    for seed in range(6):
        random = np.random.default_rng(seed)
        ball = random.normal(size=(6000, 3))
        ball *= 20 / np.linalg.norm(ball, axis=1)[:, None]
        found.append(registers(ball + random.normal(0.0, 0.1, ball.shape), (0.0, 0.0, 20.0)))
    assert found == [False] * 6


def test_beside_the_ridge_there_is_none():
    with pytest.raises(rf.NoRidgeError, match="flat base"):
        rf.register(spiral_points(), at=(0.0, 0.0, 0.0), width=6.0)
    assert issubclass(rf.NoRidgeError, ValueError)


# Progress and interruption


def test_progress_is_told_each_template_once_in_the_order_of_the_march(marched):
    _, first, track, told = marched
    assert told[0] is first
    assert len(told) == len(track.templates)
    at = next(i for i, t in enumerate(track.templates) if t is first)
    ahead, back = track.templates[at + 1 :], track.templates[:at]
    assert told[1 : 1 + len(ahead)] == list(ahead)
    walked_back = [reverse(t).position.tolist() for t in reversed(back)]
    assert [t.position.tolist() for t in told[1 + len(ahead) :]] == walked_back


def test_register_hands_progress_on():
    told = []
    found = rf.register(spiral_points(), at=apex(), progress=told.append)
    assert len(told) >= len(found.templates)
    assert all(isinstance(t, rf.Template) for t in told)


@pytest.mark.parametrize("calls", [1, 2, 6, 20])
def test_an_interrupt_keeps_what_is_there_and_says_so(calls):
    told = []

    def stop_after(template):
        told.append(template)
        if len(told) == calls:
            raise KeyboardInterrupt

    found = rf.register(spiral_points(), at=apex(), progress=stop_after)
    assert "interrupted" in found.stop
    assert 1 <= len(found.templates) <= calls
    assert len(found.templates) >= calls - 2
    assert np.isfinite(found.surface().poles).all()
    s = on_path(found)
    assert s.min() - 1 < PICK < s.max() + 1


def test_a_march_ends_where_strays_alone_go_on():
    points, _ = straight_ridge(12000, noise=0.05, half=(40, 10))
    random = np.random.default_rng(7)
    strays = random.uniform([40, -10, -3], [90, 10, 6], (400, 3))
    window = window_on(np.concatenate([points, strays]))
    chain = [template_at(position=(6.4 * i, 0, 0), points=300, evidence=200.0) for i in range(5)]
    found: list[Template] = []
    march_one_way(window, window, chain, found, SETTINGS.marching())
    assert found and max(t.position[0] for t in found) < 42.0


def test_a_march_climbs_faster_than_one_fit_may():
    """From a click where the ridge is low, at an end that fades, at low noise."""
    random = np.random.default_rng(3)
    n = 40000
    x, y = random.uniform(-40, 100, n), random.uniform(-30, 30, n)
    height = 4.0 * np.clip(x / 14.0, 0.0, 1.0) ** 2 * (x < 80)
    points = np.column_stack([x, y, height * bell()(y / 10.0) + random.normal(0, 0.004, n)])
    found = rf.register(points, at=(4.0, 0.0, 0.33))
    assert found.spine[:, 0].min() < 4.0
    assert found.spine[:, 0].max() == pytest.approx(80.0, abs=2.0)
    assert np.median(found.height) == pytest.approx(4.0, rel=0.02)
