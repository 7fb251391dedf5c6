"""The section a march begins with: a steeper one than the bell where flanks are steep."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import template_at, window_on

import ridgefeature as rf
from ridgefeature.learn import march_section, resettled
from ridgefeature.march import Track
from ridgefeature.section import Section, bell, box, plateau
from ridgefeature.settle import settle

SETTINGS = rf.Settings()


def walled(section: Section, height: float, noise: float) -> np.ndarray:
    """A straight ridge along x, 8 wide, its points even by area, flanks too."""
    random = np.random.default_rng(5)
    y = np.linspace(-12.0, 12.0, 4001)
    z = height * section(y / 8.0)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(y), np.diff(z)))])
    s = random.uniform(0.0, along[-1], 12000)
    points = np.column_stack(
        [random.uniform(-30, 30, len(s)), np.interp(s, along, y), np.interp(s, along, z)]
    )
    return points + random.normal(0.0, noise, points.shape)


def test_a_march_on_steep_flanks_takes_a_steeper_section():
    window = window_on(walled(box(), 8.0, 0.2))
    first = template_at(height=8.0, width=16.0)
    found = march_section(window, first, SETTINGS)
    assert found.section is plateau()
    assert found.width * found.section.half_height_width == pytest.approx(0.85 * 8.0, rel=0.2)


def test_a_march_on_a_bell_keeps_the_bell():
    window = window_on(walled(bell(), 3.0, 0.1))
    first = template_at(height=3.0, width=8.0)
    assert march_section(window, first, SETTINGS) is first
    named = rf.Settings(section="bell")
    assert march_section(window_on(walled(box(), 8.0, 0.2)), first, named) is first


@pytest.mark.parametrize(("own", "other", "kept"), [(bell(), box(), True), (plateau(), bell(), False)])
def test_a_settled_track_keeps_its_section_where_templates_of_another_tell_less(own, other, kept):
    window = window_on(walled(bell(), 3.0, 0.1))
    templates = tuple(template_at(position=(x, 0, 0), section=own) for x in np.arange(-24.0, 25.0, 6.4))
    track = settle(window, Track(templates, ("", "")), SETTINGS)
    found = resettled(window, track, other, SETTINGS)
    assert (found is track) == kept
    assert {t.section for t in found.templates} == {own if kept else other}
