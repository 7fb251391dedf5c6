"""The ground does not turn with the ridge: its curvature as templates see it that face another way."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import template_at, window_on
from scipy.spatial.transform import Rotation
from test_curved_base import H, W, cylinder_along

import ridgefeature as rf
from ridgefeature.continuation import append, corners
from ridgefeature.curvature import Found
from ridgefeature.improve import improve
from ridgefeature.kernels.base import flattened, seen_from, turning
from ridgefeature.kernels.base_terms import summed
from ridgefeature.section import bell, dome

RADIUS = 50.0
CURVATURE = st.floats(-0.02, 0.02)
ANGLE = st.floats(-3.1, 3.1)


def about_z(angle: float) -> np.ndarray:
    return Rotation.from_rotvec([0, 0, angle]).as_matrix()


@settings(deadline=None, max_examples=50)
@given(CURVATURE, CURVATURE, CURVATURE, ANGLE)
def test_a_base_is_the_same_surface_seen_from_a_turned_frame(xx, xy, yy, angle):
    terms, turn = np.array([xx, xy, yy]), about_z(angle)
    points = np.random.default_rng(1).uniform([-5, -5, -1], [5, 5, 3], (40, 3))
    seen, as_before = flattened(points @ turn, seen_from(terms, turn)), flattened(points, terms) @ turn
    np.testing.assert_allclose(seen[:, 2], as_before[:, 2], atol=1e-9)
    np.testing.assert_allclose(seen, as_before, atol=0.05)  # along the base to third order


@given(ANGLE, ANGLE)
def test_turns_add_up(one, other):
    np.testing.assert_allclose(turning(one) @ turning(other), turning(one + other), atol=1e-12)


@given(ANGLE)
def test_what_is_known_of_terms_turns_with_them(angle):
    random = np.random.default_rng(3)
    root = random.normal(size=(3, 3))
    found = Found(random.normal(size=(1, 3)), (root @ root.T)[None], np.ones(1))
    turned = found.seen_from(about_z(angle))
    np.testing.assert_allclose(turned.terms[0], seen_from(found.terms[0], about_z(angle)), atol=1e-12)
    there = turning(angle)
    np.testing.assert_allclose(
        np.linalg.inv(turned.information[0]), there @ np.linalg.inv(found.information[0]) @ there.T, atol=1e-6
    )


@given(st.integers(1, 6), st.integers(0, 99))
def test_what_several_templates_know_is_summed_as_dense_algebra_does(n, seed):
    random = np.random.default_rng(seed)
    terms, roots = random.normal(size=(n, 3)), random.normal(size=(n, 3, 3))
    known, degrees = roots @ roots.swapaxes(1, 2) + 0.1 * np.eye(3), random.uniform(1, 50, n)
    known[:: n + 1] *= seed % 3 > 0
    mean, of_mean, of_all, told = summed(terms, known, degrees)
    whole = known.sum(axis=0)
    expected = np.zeros(3) if not whole.any() else np.linalg.solve(whole, np.einsum("nij,nj", known, terms))
    np.testing.assert_allclose(mean, expected, rtol=1e-6, atol=1e-9)
    assert of_mean == pytest.approx(degrees.sum() * np.log1p(mean @ whole @ mean / degrees.sum()), rel=1e-9)
    each = np.einsum("ni,nij,nj->n", terms, known, terms)
    assert of_all == pytest.approx((degrees * np.log1p(each / degrees)).sum(), rel=1e-9)
    assert told == (each > 0).sum()


def scan(distance, half, n, noise, share, section, height):
    """A ridge on a pipe about the x axis, where the chart's distance (n,) to its path tells its height."""
    random = np.random.default_rng(5)
    u, v = random.uniform(-half, half, (2, n))
    z = height * np.asarray(section(distance(u, v) / W))
    strays = random.uniform(size=n) < share
    z[strays] = random.uniform(-height, 3 * height, strays.sum())
    return cylinder_along(u, v, z, RADIUS) + random.normal(0, noise, (n, 3))


def test_a_template_that_turns_keeps_to_the_ground():
    """Begun 20 degrees off; the base is that of the direction that it ends in."""
    angle, terms = np.radians(20.0), np.array([0.0, 0.0, -1.0 / RADIUS])
    points = scan(lambda u, v: v, 20.0, 20_000, 0.02, 0.0, bell(), H)
    start = template_at(H, W).changed(rotation=about_z(angle), base=seen_from(terms, about_z(angle)))
    found = improve(window_on(points), start, rf.Settings())
    assert found.rotation[0, 0] > np.cos(np.radians(1.0))
    np.testing.assert_allclose(found.base, terms, atol=3e-4)
    assert found.scale < 0.05


def test_starts_of_the_next_template_stand_on_the_same_ground():
    last = template_at(H, W).changed(base=np.array([0.0, 0.0, -1.0 / RADIUS]))
    for start in (*append([last], rf.Settings()), *corners([last], rf.Settings())):
        ways = last.rotation.T @ start.rotation
        np.testing.assert_allclose(start.base, seen_from(last.base, ways), atol=1e-12)
    turned = next(s for s in corners([last], rf.Settings(), (90.0,)))
    np.testing.assert_allclose(turned.base, [-1.0 / RADIUS, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("pick", [0.4, 2.2, 4.0])
def test_a_ring_on_a_pipe_is_found_whole(pick):
    """Low, of another section than the march's, among strays: the base is along it what it was across."""
    around = 35.0
    points = scan(lambda u, v: np.hypot(u, v) - around, 58.0, 40_000, 0.02, 0.15, dome(), 0.9)
    u, v = around * np.cos(pick), around * np.sin(pick)
    at = cylinder_along(*np.array([[u], [v], [0.9]]), RADIUS)[0]
    ridge = rf.register(points, at=at)
    assert ridge.closed
    # Each frame is told from the transpose of the last: errors of rounding must not double with each.
    for template in ridge.templates:
        np.testing.assert_allclose(template.rotation.T @ template.rotation, np.eye(3), atol=1e-12)
    assert ridge.length == pytest.approx(2 * np.pi * around, rel=0.01)
    assert np.median(np.abs(ridge.height - 0.9)) < 0.03
