"""How the whole fit of a steep ridge ends: by the likelihood of its points itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_steep_start import HEIGHT, WIDTH, scanned, straight, terms

import ridgefeature as rf
from ridgefeature.grid import build_grid
from ridgefeature.kernels.strip import TERMS
from ridgefeature.refit import refitted
from ridgefeature.section import Section, bell, box, plateau
from ridgefeature.smearing import likelihood_scores, likelihood_section_scores, log_likelihood

NOISE, EVEN, STRAYS, SPAN = 0.4, 0.7, 0.05, 40.0
TOLD = NOISE, EVEN, STRAYS, SPAN


def seen_points() -> np.ndarray:
    rng = np.random.default_rng(6)
    points = np.column_stack([rng.uniform(0, 4, 400), rng.uniform(-9, 9, 400), rng.uniform(-1, 10, 400)])
    points[::2, 2] = 0.2 + 9.0 * box()((points[::2, 1] - 0.4) / 8.0) + rng.normal(0, NOISE, 200)
    return points


@pytest.mark.parametrize("section", [bell(), box()], ids=lambda s: s.name)
def test_scores_are_the_derivatives_of_the_likelihood(section):
    points, step = seen_points(), 1e-5
    matrix, right = likelihood_scores(points, terms(), section, *TOLD)
    for k in range(TERMS):
        aside = [terms(), terms()]
        for moved, sign in zip(aside, (1, -1), strict=True):
            moved[:, k] += sign * step
        after, before = (log_likelihood(points, moved, section, *TOLD) for moved in aside)
        size = np.sqrt(matrix[:, k, k].sum())
        # Quadratures for so many points and for so many nodes differ a little.
        assert abs((after - before) / (2 * step) - right[:, k].sum()) < 0.02 * size, k
    assert np.linalg.eigvalsh(matrix).min() > -1e-6 * matrix.max()


def test_scores_of_a_section_are_the_derivatives_too():
    points, step, section = seen_points(), 1e-5, box()
    matrix, right = likelihood_section_scores(points, terms(), section, *TOLD, section.spans, 1.0)
    assert matrix.shape == (section.spans + 6,) * 2
    raised, own = section.coefficients, terms()
    for k in (0, 1, 3, 8, 16):
        chances = []
        for sign in (1, -1):
            moved = raised.copy()
            moved[k] += sign * step
            new, own = Section(moved), terms()
            own[:, 4] *= moved[8] / new.coefficients[8]  # a section's apex is 1: what it lost has the height
            chances.append(log_likelihood(points, own, new, *TOLD))
        found = (chances[0] - chances[1]) / (2 * step)
        assert abs(found - right[3 + k]) < 0.02 * np.sqrt(matrix[3 + k, 3 + k]), k


@pytest.mark.parametrize(("noise", "most"), [(0.4, 0.012), (0.9, 0.027)])
def test_noisy_steep_flanks_have_the_right_width_at_half_height(noise, most):
    """Mean heights leave a box, or a section whose flanks lean."""
    grid = build_grid(scanned(noise))
    found = refitted(grid, straight(1.2 * HEIGHT, 0.9 * WIDTH), box(), False, (False, False), rf.Settings())
    assert found.joint is not None
    at, half = found.stations, found.joint.section.half_height_width
    inner = slice(3, -3)
    wide = half * at.width[inner] / (0.92 * WIDTH) - 1.0
    assert np.sqrt(np.mean(wide**2)) < most
    assert np.abs(wide).max() < 0.05
    assert np.abs(at.height[inner] / HEIGHT - 1.0).max() < 0.03


def test_the_last_stations_of_a_wall_that_ends_are_as_wide_as_the_others():
    """Beyond its end the noise carries ground among the points of the top."""
    grid = build_grid(scanned(0.9))
    found = refitted(grid, straight(), box(), False, (False, False), rf.Settings())
    width = found.stations.width
    assert np.abs(width[[0, -1]] / np.median(width) - 1.0).max() < 0.05


def test_a_section_that_is_asked_for_stays():
    grid, settings = build_grid(scanned(0.4)), replace(rf.Settings(), section="plateau")
    found = refitted(grid, straight(), plateau(), False, (False, False), settings)
    assert found.joint is not None and found.joint.section is plateau()
