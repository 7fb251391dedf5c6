"""Settling: templates stay at their places along the ridge; none is left where it does not advance."""

from __future__ import annotations

import os
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from closed_paths import Scene, circle
from oracles import straight_ridge, template_at, window_on
from scipy.spatial.transform import Rotation

import ridgefeature as rf
from ridgefeature.continuation import FLAT
from ridgefeature.improve import limits_of, refine
from ridgefeature.march import RAN_BACK, Track
from ridgefeature.neighbours import advances, alike, between, comes_home, follows, tipped
from ridgefeature.settle import finish_ends, mend, settle
from ridgefeature.template import Template

SETTINGS = rf.Settings()
BOW = 1 / 400


def weld_wall(seed: int, noise: float = 0.08) -> np.ndarray:
    """A wall 14 high along x from 0 to 85 on a bowed plate: of its flanks 3.5 mm on both sides are unseen."""
    random = np.random.default_rng(seed)
    points = random.uniform([-12, -28, 0], [97, 28, 0], (9000, 3))
    x, y = points[:, 0], np.abs(points[:, 1])
    on = (x > 0) & (x < 85)
    points[:, 2] = np.where(on & (y < 4), 14 - 2.1 * (y / 2.5) ** 2, 0.0) - BOW * ((x - 40) ** 2 + y * y) / 2
    points = points[~on | (y < 2.5) | (y > 6.0)]
    points += random.normal(0, noise, points.shape)
    strays = random.choice(len(points), len(points) // 20, replace=False)
    points[strays, 2] += random.uniform(-4, 14, len(strays))
    return points


def on_wall(x: float, **values) -> Template:
    return template_at(
        **{
            "height": 14.0,
            "width": 10.0,
            "position": (x, 0, -BOW * (x - 40) ** 2 / 2),
            "turn": (0, np.arctan(BOW * (x - 40)), 0),
            "length": 9.0,
            **values,
        }
    )


def steps(templates) -> list[float]:
    """Advance from centre to centre along the common direction, in mean lengths."""
    out = []
    for a, b in pairwise(templates):
        way = a.rotation[:, 0] + b.rotation[:, 0]
        ahead = (b.position - a.position) @ way / np.linalg.norm(way)
        out.append(ahead / (0.5 * (a.length + b.length)))
    return out


# On a weld wall


@pytest.mark.parametrize("pitch", [-0.7, 0.7])
@pytest.mark.parametrize("height", [3.0, 6.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_tipped_template_does_not_slide_onto_its_neighbour(pitch, height, seed):
    """Its start stands 8 too high and tipped over: downwards is along the wall too."""
    chain = [on_wall(4 + 8.5 * i) for i in range(6)]
    low = {"height": height, "width": 13.0, "flank": 3.9, "turn": (0, pitch, 0)}
    chain[1] = on_wall(12.5, **low, position=(12.5, 0, 8 - BOW * 27.5**2 / 2))
    found = settle(window_on(weld_wall(seed)), Track(tuple(chain), ("", "")), SETTINGS).templates
    assert len(found) == 6
    assert min(steps(found)) > 0.4
    assert abs(found[1].height / 14 - 1) < 0.35 and found[1].rotation[2, 2] > 0.97
    for before, after in zip(chain[2:], found[2:], strict=True):
        assert abs(before.position[0] - after.position[0]) < 0.1 * before.length


@pytest.mark.parametrize("at", [1.0, 6.0, 40.0, 80.0])
def test_a_weld_wall_is_registered_with_templates_that_advance(at):
    points = weld_wall(3)
    crest = points[(np.abs(points[:, 1]) < 1) & (points[:, 2] > 8)]
    found = rf.register(points, at=crest[np.argmin(np.abs(crest[:, 0] - at))])
    assert min(steps(found.templates)) > 0.4
    assert found.length == pytest.approx(85, abs=5)
    assert (np.diff(found.spine[:, 0] * np.sign(found.tangent[0, 0])) > 0).all()


SCANS = Path(os.environ.get("RIDGE_SCANS") or "/nowhere")


@pytest.mark.skipif(not (SCANS / "waam_weld_wall.npz").is_file(), reason="RIDGE_SCANS holds no such scan")
def test_a_real_weld_wall_does_not_fold():
    with np.load(SCANS / "waam_weld_wall.npz") as scan:
        points, seed, path = scan["points"], scan["seed"], scan["ref_path"]
    found = rf.register(points, at=seed)
    assert min(steps(found.templates)) > 0.4
    chord = (found.spine[-1] - found.spine[0]) / np.linalg.norm(found.spine[-1] - found.spine[0])
    assert (found.tangent @ chord > 0.7).all()
    apart = np.linalg.norm(found.spine[None] - path[:, None], axis=2).min(axis=1)
    assert (apart < 20).all()


@pytest.mark.skipif(not (SCANS / "waam_weld_wall.npz").is_file(), reason="RIDGE_SCANS holds no such scan")
def test_a_real_weld_wall_has_one_crest():
    """What few points tell of its unseen flanks is no crest of its own."""
    with np.load(SCANS / "waam_weld_wall.npz") as scan:
        points = scan["points"]
    found = rf.register(points, at=(12.026470184326172, -11.725231170654297, -235.6444549560547))
    height = found.section(np.linspace(-0.5, 0.5, 1001))
    rises = np.sign(np.diff(height))
    assert (np.diff(rises[rises != 0]) < 0).sum() == 1


# A refit keeps its place


@pytest.mark.parametrize("pitch", [-0.6, -0.3, 0.3, 0.6])
def test_a_refit_stays_beside_its_start_however_that_was_tipped(pitch):
    points, _ = straight_ridge(height=8.0, width=8.0, noise=0.05, half=(30, 10))
    start = template_at(height=4.0, position=(0, 0, 4.0), turn=(0, pitch, 0))
    found = refine(window_on(points), start, limits_of(8.0, 8.0, SETTINGS), SETTINGS)
    assert found.height == pytest.approx(8.0, rel=0.05)
    assert found.rotation[2, 2] > 0.999
    assert abs(found.apex[0] - start.apex[0]) < 0.15 * start.length


def test_a_template_slides_along_its_bent_path():
    radius = 20.0
    bent = template_at(trend=np.array([1 / radius, 0.1, -0.2]))
    x = 1.0
    slid = bent.slid(x)
    assert np.linalg.norm(slid.position - [0, radius, 0]) == pytest.approx(radius, rel=1e-5)
    np.testing.assert_allclose(slid.rotation[:, 0], [np.cos(x / radius), np.sin(x / radius), 0], atol=1e-12)
    assert (slid.height, slid.width) == pytest.approx((3.1, 7.8))
    back = slid.slid(-x)
    assert (back.height, back.width) == pytest.approx((3.0, 8.0))
    np.testing.assert_allclose(back.position, bent.position, atol=1e-3)


def test_slopes_change_height_and_width_by_no_more_than_a_half():
    far = template_at(trend=np.array([0.0, -1.0, 2.0])).slid(50.0)
    assert (far.height, far.width) == pytest.approx((1.5, 12.0))


# Chains that do not advance


def line(n: int, step: float = 6.4, **values) -> list[Template]:
    std = np.array([0.0, *[0.01] * 7])
    return [template_at(position=(step * i, 0, 0), std=std, evidence=200.0, **values) for i in range(n)]


def ridge_window(hole: tuple[float, float] = (0.0, 0.0)):
    points, _ = straight_ridge(12000, noise=0.05, half=(40, 10))
    x = points[:, 0] + 15
    return window_on(np.column_stack([x, points[:, 1:]])[(x <= hole[0]) | (x >= hole[1])])


def mended(window, before, after, closed=False):
    return mend(window, before, after, closed, SETTINGS.marching())


def test_a_chain_that_advances_is_left_as_it_is():
    chain = line(5)
    assert mended(ridge_window(), chain, chain) == chain


def test_a_template_on_its_neighbour_is_fitted_again_between_its_neighbours():
    before = line(5)
    after = [*before[:2], before[2].changed(position=before[1].slid(0.5).position), *before[3:]]
    found = mended(ridge_window(), before, after)
    assert [t is b for t, b in zip(found, before, strict=True)] == [True, True, False, True, True]
    assert found[2].position[0] == pytest.approx(12.8, abs=1.0)
    assert found[2].status != "interpolated" and found[2].evidence > SETTINGS.going_on
    assert (found[2].height, found[2].width) == pytest.approx((3.0, 8.0), rel=0.05)


def test_where_there_are_no_data_it_is_interpolated_and_says_so():
    before = line(5)
    before[3] = before[3].changed(height=3.4, width=7.6)
    after = [*before[:2], before[2].changed(position=before[1].slid(0.5).position), *before[3:]]
    found = mended(ridge_window(hole=(7.0, 18.0)), before, after)
    assert found[2].status == "interpolated"
    np.testing.assert_allclose(found[2].position, [12.8, 0, 0], atol=1e-9)
    assert (found[2].height, found[2].width) == pytest.approx((3.2, 7.8))
    np.testing.assert_allclose(found[2].std[1:6], 0.02)
    np.testing.assert_allclose(found[2].std[6:], [0.22, 0.22])


def test_it_is_dropped_where_its_neighbours_follow_each_other_without_it():
    before = [*line(3), template_at(position=(13.5, 0, 0)), *(t.slid(7.0) for t in line(5)[2:])]
    found = mended(ridge_window(), before, before)
    assert len(found) == len(before) - 1
    assert min(steps(found)) > 0.4


@pytest.mark.parametrize("end", [0, -1])
def test_at_an_end_it_is_dropped(end):
    before = line(5)
    after = list(before)
    after[end] = before[end].changed(position=before[1 if end == 0 else 3].position)
    assert mended(ridge_window(), before, after) == (before[1:] if end == 0 else before[:-1])


def test_a_base_that_tips_over_is_levelled_where_the_data_say_so():
    chain = line(5)
    chain[2] = chain[2].changed(rotation=Rotation.from_rotvec([0, 0.8, 0]).as_matrix())
    found = mended(ridge_window(), chain, chain)
    assert tipped(chain[2], [chain[1], chain[3]])
    assert found[2].rotation[2, 2] > 0.999
    assert found[2].position[0] == pytest.approx(12.8, abs=1.0)


# Neighbours


def arc(radius: float, n: int, step: float) -> list[Template]:
    out = []
    for a in step / radius * np.arange(n):
        frame = Rotation.from_rotvec([0, 0, a]).as_matrix()
        place = radius * np.array([np.sin(a), 1 - np.cos(a), 0.0])
        out.append(template_at().changed(position=place, rotation=frame))
    return out


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 0.8, 1.0])
def test_between_two_templates_of_a_circle_lies_one_of_the_circle(share):
    a, b = arc(20.0, 2, 8.0)
    found = between(a, b, share)
    angle = share * 8.0 / 20.0
    np.testing.assert_allclose(
        found.position, 20 * np.array([np.sin(angle), 1 - np.cos(angle), 0]), atol=0.02
    )
    np.testing.assert_allclose(found.rotation[:, 0], [np.cos(angle), np.sin(angle), 0], atol=0.02)
    np.testing.assert_allclose(found.rotation.T @ found.rotation, np.eye(3), atol=1e-12)


def test_between_moves_along_with_its_neighbours():
    turn, shift = Rotation.from_rotvec([0.3, -0.8, 1.7]).as_matrix(), np.array([5.0, -9.0, 2.0])
    a, b = arc(20.0, 2, 8.0)
    moved = [t.changed(position=turn @ t.position + shift, rotation=turn @ t.rotation) for t in (a, b)]
    plain, other = between(a, b, 0.3), between(*moved, 0.3)
    np.testing.assert_allclose(other.position, turn @ plain.position + shift, atol=1e-12)
    np.testing.assert_allclose(other.rotation, turn @ plain.rotation, atol=1e-12)


def test_what_advances_and_what_does_not():
    here = template_at()
    assert advances(here, here.slid(6.4)) and advances(here, here.slid(2.6))
    assert not advances(here, here.slid(2.5)) and not advances(here, here.slid(-6.4))
    for turn, on in ((1.9, True), (2.3, False)):  # behind a tight bend; back
        turned = here.slid(6.4).changed(rotation=Rotation.from_rotvec([0, 0, turn]).as_matrix())
        ahead = turned.changed(position=here.position + 6.4 * (here.rotation[:, 0] + turned.rotation[:, 0]))
        assert advances(here, ahead) == on
    chain = line(4)
    assert follows(chain, 0, closed=False) and not follows(chain, 0, closed=True)


def test_coming_home_asks_for_the_same_way_and_a_ridge_alike():
    ring = arc(20.0, 12, 6.4)
    again = ring[0].slid(1.0)
    assert comes_home(again, ring, 0) and comes_home(ring[1], ring, 1)
    assert not comes_home(ring[5], ring, 5)
    assert not comes_home(again, ring[:3], 0)
    facing_back = again.rotation * np.array([-1.0, -1.0, 1.0])
    assert not comes_home(again.changed(rotation=facing_back), ring, 0)
    assert not comes_home(again.changed(height=-3.0), ring, 0)
    assert not comes_home(again.changed(width=16.0), ring, 0)
    odd = [ring[0].changed(width=2.0), *ring[1:]]
    assert comes_home(again, odd, 0) and not alike(odd[0], odd[1:6])


def test_an_end_that_ran_back_did_not_where_what_lay_there_dropped_out():
    points, _ = straight_ridge(12000, noise=0.05, half=(40, 12))
    window = window_on(points)
    straight = tuple(template_at(position=(x, 0, 0)) for x in np.arange(-28.8, 0.0, 6.4))
    track = settle(window, Track(straight, (RAN_BACK, RAN_BACK)), SETTINGS)
    assert finish_ends(window, track, SETTINGS).stop == (FLAT, FLAT)


def test_an_end_that_still_lies_before_its_own_ridge_ran_back():
    scene = Scene(circle(24.0), margin=14.0)
    window = window_on(scene.points(20000, noise=0.05, seed=1))
    turns = np.arange(23.0) * 2 * np.pi / 23.6
    chain = tuple(
        template_at(position=(24 * np.cos(a), 24 * np.sin(a), 0), turn=(0, 0, a + np.pi / 2)) for a in turns
    )
    track = settle(window, Track(chain, (FLAT, RAN_BACK)), SETTINGS)
    assert finish_ends(window, track, SETTINGS).stop == (FLAT, RAN_BACK)
