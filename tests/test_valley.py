"""Ridges in valleys: their height is over the ground at their feet, not over a parabola below it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import ridgefeature as rf
from ridgefeature.section import cosine

HEIGHT, WIDTH, SPACING, LENGTH = 160.0, 1000.0, 83.0, 10_000.0
WIND = 80.0


def scene(seed: int, left: tuple[float, float], right: tuple[float, float]) -> np.ndarray:
    """A ridge with a cosine section that winds along a valley, on a grid with rough ground.

    left, right: how far from the feet, in widths, the slopes beside the valley begin, and how steep they are.
    """
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(0, LENGTH, SPACING), np.arange(-3.5 * WIDTH, 3.5 * WIDTH, SPACING))
    d = y - WIND * np.sin(2 * np.pi * x / LENGTH)
    z = np.where(np.abs(d) < WIDTH / 2, HEIGHT * 0.5 * (1 + np.cos(2 * np.pi * d / WIDTH)), 0.0)
    for side, (far, slope) in ((-1, left), (1, right)):
        z += slope * np.maximum(side * d - (0.5 + far) * WIDTH, 0.0)
    rough = gaussian_filter(random.normal(size=z.shape), 2.0)
    z += 0.075 * HEIGHT * rough / rough.std() + random.normal(size=z.shape)
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()])


def registered(points: np.ndarray, crest: np.ndarray) -> rf.Ridge:
    return rf.register(points, at=points[np.argmin(np.linalg.norm(points - crest, axis=1))])


@pytest.mark.parametrize(
    ("left", "right"),
    [((0.1, 0.25), (0.7, 0.12)), ((0.1, 0.25), (0.1, 0.3)), ((0.0, 0.4), (0.0, 0.4))],
    ids=["one side far", "both near", "no floor"],
)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_slopes_beside_a_valley_do_not_raise_the_ridge_in_it(left, right, seed):
    points = scene(seed, left, right)
    ridge = registered(points, np.array([LENGTH / 2, 0.0, HEIGHT]))
    assert np.median(ridge.height) == pytest.approx(HEIGHT, rel=0.15)
    assert np.median(ridge.half_height_width) == pytest.approx(WIDTH / 2, rel=0.08)
    assert not ridge.curvature.any()


def test_turned_and_scaled_the_ridge_in_a_valley_is_the_same():
    points = scene(1, (0.1, 0.25), (0.7, 0.12))
    crest = np.array([LENGTH / 2, 0.0, HEIGHT])
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    one, other = registered(points, crest), registered(0.01 * points @ turn.T, 0.01 * turn @ crest)
    np.testing.assert_allclose(np.median(other.height), 0.01 * np.median(one.height), rtol=0.02)
    np.testing.assert_allclose(np.median(other.width), 0.01 * np.median(one.width), rtol=0.05)


def in_pipe(x: np.ndarray, y: np.ndarray, z: np.ndarray, radius: float) -> np.ndarray:
    """Points at heights z over the inside of a pipe along x."""
    return np.column_stack([x, (radius - z) * np.sin(y / radius), radius - (radius - z) * np.cos(y / radius)])


@pytest.mark.parametrize("noise", [0.005, 0.015])
@pytest.mark.parametrize(("radius", "height"), [(3.0, 0.2), (6.0, 0.15)])
def test_the_inside_of_a_pipe_stays_curved(radius, height, noise):
    random = np.random.default_rng(4)
    n = 26_000
    x, y = random.uniform(0, 14, n), random.uniform(-3, 3, n)
    points = in_pipe(x, y, height * cosine()(y), radius) + noise * random.normal(size=(n, 3))
    ridge = registered(points, np.array([7.0, 0.0, height]))
    assert np.median(ridge.curvature) == pytest.approx(1 / radius, rel=0.15)
    assert np.median(ridge.height) == pytest.approx(height, rel=0.05)


@pytest.mark.parametrize("lines", [1, 4])
def test_the_inside_of_a_pipe_stays_curved_where_the_noise_is_in_bands(lines):
    """Each scan line across the pipe is off by as much as its neighbours, or not."""
    random, spacing = np.random.default_rng(3), 0.08
    x, y = (v.ravel() for v in np.meshgrid(np.arange(0, 14, spacing), np.arange(-3, 3, spacing)))
    off = np.convolve(random.normal(size=400), np.ones(lines) / np.sqrt(lines), "same")
    z = 0.2 * cosine()(y) + 0.01 * off[(x / spacing).round().astype(int)]
    points = in_pipe(x, y, z, 4.0) + 0.005 * random.normal(size=(len(x), 3))
    ridge = registered(points, np.array([7.0, 0.0, 0.2]))
    assert np.median(ridge.curvature) == pytest.approx(1 / 4.0, rel=0.15)
    assert np.median(ridge.height) == pytest.approx(0.2, rel=0.05)
