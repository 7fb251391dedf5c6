"""Flanks that no point was seen on: what their width may be, and what a seen flank tells of the other."""

from __future__ import annotations

import numpy as np
import pytest

import ridgefeature as rf
from ridgefeature.kernels.strip import TERMS, H, W
from ridgefeature.section import Section, cosine
from ridgefeature.smearing import smear
from ridgefeature.unseen import unseen_std

HEIGHT, CAP, FOOT, EDGE = 6.4, 2.0, 3.3, 5.5
NOISE, SPACING, LENGTH = 0.08, 0.46, 70.0
HALF = 2 * (FOOT - HEIGHT / 2 / EDGE * (FOOT - CAP))


def bead(seed: int, unseen: str) -> np.ndarray:
    """A bead with a domed cap and straight steep flanks, without the points of its right or both flanks."""
    random = np.random.default_rng(seed)
    n = int(LENGTH * 24 / SPACING**2)
    x, y = random.uniform(0, LENGTH, n), random.uniform(-12, 12, n)
    a = np.abs(y)
    flank = EDGE * (FOOT - a) / (FOOT - CAP)
    z = np.where(a < CAP, HEIGHT - (HEIGHT - EDGE) * (a / CAP) ** 2, np.where(a < FOOT, flank, 0.0))
    hidden = (a > CAP) & (a < FOOT) & {"none": False, "right": y < 0, "both": True}[unseen]
    points = np.column_stack([x, y, z])[~hidden]
    return points + NOISE * random.normal(size=points.shape)


def registered(points: np.ndarray) -> rf.Ridge:
    crest = np.array([LENGTH / 2, 0.0, HEIGHT])
    return rf.register(points, at=points[np.argmin(np.linalg.norm(points - crest, axis=1))])


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_seen_flank_tells_of_the_other(seed):
    ridge = registered(bead(seed, "right"))
    std = np.median(ridge.half_height_width_std)
    assert np.median(ridge.half_height_width) == pytest.approx(HALF, rel=0.04)
    assert np.median(ridge.half_height_width) == pytest.approx(HALF, abs=3 * std)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_where_both_flanks_are_unseen_the_band_holds_all_that_they_may_be(seed):
    ridge, seen = registered(bead(seed, "both")), registered(bead(seed, "none"))
    width, std = np.median(ridge.half_height_width), np.median(ridge.half_height_width_std)
    # They fall somewhere between the cap's edge and the foot, evenly likely.
    assert width - 2.5 * std < 2 * CAP
    assert width + 2.5 * std > 2 * FOOT
    assert std < FOOT - CAP
    assert np.median(seen.half_height_width_std) < 0.2 * std


@pytest.mark.parametrize("seen", [0.1, 0.25])
def test_of_a_ridge_seen_from_one_side_the_symmetric_section_carries_over(seen):
    """Nothing is seen beyond so many widths from the spine, neither the flank nor the ground."""
    random = np.random.default_rng(1)
    x, y = random.uniform(-40, 40, 60_000), random.uniform(-30, 30, 60_000)
    points = np.column_stack([x, y, 3.0 * cosine()(y / 10.0)]) + random.normal(0, 0.02, (60_000, 3))
    ridge = rf.register(points[points[:, 1] < 10.0 * seen], at=(0.0, 0.0, 3.0))
    assert ridge.length > 78
    assert np.median(ridge.height) == pytest.approx(3.0, rel=0.01)
    assert np.median(ridge.half_height_width) == pytest.approx(5.0, rel=0.02)
    assert abs(np.median(ridge.spine[:, 1])) < 0.2


def seen_section(hidden: tuple[float, float], symmetric: bool = True) -> float:
    """What gaps in one flank of a section leave; hidden: places without points, in widths."""
    random = np.random.default_rng(5)
    section = cosine() if symmetric else Section(np.array([0.2, 0.5, 1.0, 0.3, 0.1]), "learned")
    terms = np.zeros((41, TERMS))
    terms[:, H], terms[:, W] = 0.5, 1.0
    y = random.uniform(-0.8, 0.8, 6000)
    y = y[(y < hidden[0]) | (y > hidden[1])]
    points = np.column_stack([random.uniform(0, 40, len(y)), y, 0.5 * section(y)])
    return unseen_std(points, terms, smear(section, terms, 0.01, 0.0), 0.01)


def test_only_gaps_at_half_height_count():
    assert seen_section((9.0, 9.0)) == 0.0
    assert seen_section((0.35, 0.45), symmetric=False) == 0.0
    low, high = Section(np.array([0.2, 0.5, 1.0, 0.3, 0.1]), "learned").half_height_places
    assert low < 0 < high
    found = seen_section((high - 0.05, high + 0.05), symmetric=False)
    assert found == pytest.approx(0.1 / np.sqrt(12), rel=0.1)


def test_a_gap_in_one_flank_of_a_symmetric_section_is_filled_by_the_other():
    assert seen_section((0.2, 0.3)) == 0.0


def test_no_points_leave_everything_open():
    terms = np.zeros((41, TERMS))
    terms[:, H], terms[:, W] = 0.5, 1.0
    found = unseen_std(np.empty((0, 3)), terms, smear(cosine(), terms, 0.01, 0.0), 0.01)
    assert found == pytest.approx(2 * 0.25 / np.sqrt(3), rel=1e-2)
