"""Foot points on a surface."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import bell, inner

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS, st.sampled_from([0.0, 1e5]), st.floats(-1.0, 1.0))
@settings(max_examples=12, deadline=None)
def test_project_recovers_points_offset_along_normals(seed: int, origin: float, reach: float) -> None:
    surface, rng = bell(origin=origin), np.random.default_rng(seed)
    u, v = inner(rng, surface, 200)
    u[:4], v[:4] = (0.0, 1.0, 0.5, 0.5), (0.0, 0.0, -6.0, 6.0)  # the border itself belongs to the surface
    d = reach * rng.uniform(-0.5, 0.5, 200)  # below the smallest radius of curvature
    found = surface.project(surface(u, v) + d[:, None] * surface.normal(u, v))
    rounding = 1e-15 * origin + 1e-12
    np.testing.assert_allclose(found[2], d, atol=10 * rounding)
    np.testing.assert_allclose(surface(found[0], found[1]), surface(u, v), atol=1e3 * rounding)
    np.testing.assert_allclose(found[0], u, atol=1e3 * rounding)


def test_project_agrees_with_a_dense_search() -> None:
    surface, rng = bell(), np.random.default_rng(5)
    u, v = inner(rng, surface, 300)
    points = surface(u, v) + rng.normal(scale=3.0, size=(300, 3))
    _, _, distance = surface.project(points)
    dense = surface.grid(801, 401).reshape(-1, 3)
    nearest = np.array([np.linalg.norm(dense - p, axis=1).min() for p in points])
    has = ~np.isnan(distance)
    assert 100 < has.sum() < 300
    excess = nearest[has] ** 2 - distance[has] ** 2
    assert excess.max() < 0.05**2  # the spacing of the dense samples, squared
    assert excess.min() > -0.02  # near the medial axis two foot points are almost equally far


def test_project_beyond_the_border_is_nan() -> None:
    surface = bell()
    off = [-np.cross(surface.normal(0.0, 0.0), surface.derivatives(0.0, 0.0)[1])]
    points = surface([0.0], [0.0]) + 0.01 * np.array(off)
    ahead = surface([0.0], [0.0]) - 0.01 * np.array(off)
    behind = np.isnan(surface.project(points)[2]), np.isnan(surface.project(ahead)[2])
    assert behind[0].all() != behind[1].all()
    assert np.isnan(np.array(surface.project([[500.0, 0.0, 0.0], [np.nan, 0, 0], [np.inf, 0, 0]]))).all()


def test_project_runs_over_the_seam_of_a_closed_surface() -> None:
    surface, rng = bell(turn=2 * np.pi), np.random.default_rng(6)
    poles = surface.poles.copy()
    poles[..., 2] -= 2.0 * np.linspace(0, 1, poles.shape[0])[:, None] ** 2 * (2 * np.pi) ** 2
    poles[-1] = poles[0]
    ring = dataclasses.replace(surface, poles=poles)
    assert ring.closed == (True, False)
    assert bell().closed == (False, False)
    a, y = rng.uniform(-0.02, 0.02, 100), rng.uniform(-4, 4, 100)
    points = np.stack([(40 - y) * np.sin(a), 40 - (40 - y) * np.cos(a), np.full(100, 3.0)], axis=-1)
    u, _, d = ring.project(points)
    assert np.isfinite(d).mean() > 0.9  # a crease in the seam may take a few
    assert (u < 0.1).any() and (u > 6.1).any()


def test_project_takes_a_start_and_any_shape() -> None:
    surface = bell()
    u, v = np.full((2, 3), 0.4), np.full((2, 3), 1.0)
    points = surface(u, v) + 0.2 * surface.normal(u, v)
    for found in (surface.project(points), surface.project(points, start=(0.41, 0.9))):
        np.testing.assert_allclose(found, [u, v, np.full((2, 3), 0.2)], atol=1e-10)
    assert surface.project(np.empty((0, 3)))[2].shape == (0,)
    with pytest.raises(ValueError, match="start with v"):
        surface.project(points, start=(0.4, 99.0))
    with pytest.raises(ValueError, match=r"\(\.\.\., 3\)"):
        surface.project([1.0, 2.0])
