"""Rings: recognised, closed by a periodic C2 surface; never where the ridge is open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_paths import Scene, circle, ellipse, inward_spiral, rounded_rectangle, u_turn
from scipy.spatial.transform import Rotation

import ridgefeature as rf
from ridgefeature.base import registered_base
from ridgefeature.basis import basis_matrix, periodic_interpolation
from ridgefeature.commands.output import rows
from ridgefeature.fitting import joined
from ridgefeature.neighbours import advances
from ridgefeature.rings import _largest_run

W = 8.0
"""Width of the ridges, where it does not vary."""


def wave(mean: float, amplitude: float, times: int):
    return lambda u: mean + amplitude * np.sin(2 * np.pi * times * np.asarray(u) + 0.7)


def on_sphere(radius: float):
    """Maps the plane onto a sphere: distances from the origin stay."""

    def lift(points):
        r = np.hypot(points[:, 0], points[:, 1])
        out = points[:, :2] / np.maximum(r, 1e-12)[:, None]
        a, q = r / radius, radius + points[:, 2]
        return np.column_stack([(q * np.sin(a))[:, None] * out, q * np.cos(a) - radius])

    return lift


def on_cylinder(radius: float):
    """Rolls the plane onto a cylinder along y."""

    def lift(points):
        a, q = points[:, 0] / radius, radius + points[:, 2]
        return np.column_stack([q * np.sin(a), points[:, 1], q * np.cos(a) - radius])

    return lift


RINGS = {
    "circle": Scene(circle(30)),
    "circle of radius 2 w": Scene(circle(2 * W)),
    "heights and widths vary": Scene(circle(30), height=wave(3, 1, 2), width=wave(8, 1.5, 3)),
    "heights vary threefold": Scene(circle(25), height=wave(3, 1.5, 1), width=wave(8, 2, 1)),
    "ellipse": Scene(ellipse(40, 22)),
    "rounded rectangle": Scene(rounded_rectangle(40, 28, 14)),
    "on a sphere": Scene(circle(30), lift=on_sphere(60.0)),
    "on a cylinder": Scene(circle(30), lift=on_cylinder(60.0)),
}
OPEN = {
    "a gap of 1 w": Scene(circle(30, gap=W), closed=False),
    "a small one with a gap of 1 w": Scene(circle(2 * W, gap=W), closed=False),
    "rounded ends that face each other": Scene(circle(30, gap=2 * W), closed=False, ends="rounded"),
    "legs 0.2 w apart": Scene(u_turn(60, 1.2 * W), closed=False),
    "legs 2 w apart": Scene(u_turn(60, 3 * W), closed=False),
    "a spiral that ends beside its start": Scene(inward_spiral(35, 1.2 * W, 1.0), closed=False),
    "a spiral that runs beside itself": Scene(inward_spiral(35, 1.2 * W, 1.3), closed=False),
}
NOISE = (0.03, 0.1, 0.24)


def scan(scene: Scene, noise: float, seed: int, outliers: float = 0.0) -> np.ndarray:
    size = np.ptp(scene.path, axis=0) + 2 * scene.margin
    return scene.points(int(1.2 * size.prod()), noise, seed, outliers)


def registered(scene: Scene, noise: float, seed: int, u: float | None = None) -> rf.Ridge:
    """The ridge after a click at a share u of its length, by default one at random; odd seeds have strays."""
    u = float(np.random.default_rng(seed + 1000).uniform(0.03, 0.97)) if u is None else u
    return rf.register(scan(scene, noise, seed, 0.1 * (seed % 2)), at=scene.pick(u))


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(circle(30), height=wave(3, 0.8, 2), width=wave(8, 1.0, 3))


@pytest.fixture(scope="module")
def ring(scene) -> rf.Ridge:
    return registered(scene, 0.1, 2)


# Recognised, and only where it is one


@pytest.mark.parametrize("name", RINGS)
@pytest.mark.parametrize("seed", range(6))  # every noise without and with strays
def test_a_ring_is_closed_and_as_long_as_its_path(name, seed):
    found = registered(RINGS[name], NOISE[seed % 3], seed)
    assert found.closed and found.stop == ("closed", "closed")
    assert found.length == pytest.approx(RINGS[name].true_length, rel=0.01)


def test_a_ring_of_radius_one_and_a_half_widths_is_closed_more_often_than_not():
    """2 of 100 are not: the march loses the ridge in the bend."""
    found = [registered(Scene(circle(1.5 * W)), NOISE[seed % 3], seed) for seed in range(10)]
    assert sum(r.closed for r in found) >= 9


@pytest.mark.parametrize("name", OPEN)
@pytest.mark.parametrize("seed", range(4))
def test_what_is_open_stays_open(name, seed):
    # not in the turn itself: its radius is 0.6 w
    u = float(np.random.default_rng(seed).uniform(0.03, 0.4))
    found = registered(OPEN[name], NOISE[seed % 3], seed, u)
    assert not found.closed
    assert "closed" not in found.stop


@pytest.mark.parametrize("u", [0.05, 0.3, 0.5, 0.7, 0.95])
def test_an_almost_closed_c_ends_at_both_sides_of_its_gap_whatever_the_click(u):
    scene = OPEN["a gap of 1 w"]
    found = registered(scene, 0.1, 4, u)
    gap = 0.5 * W / 30
    angles = np.arctan2(found.spine[[0, -1], 1], found.spine[[0, -1], 0])
    np.testing.assert_allclose(np.sort(angles), [-gap, gap], atol=0.5 * W / 30)
    assert found.length == pytest.approx(scene.length, rel=0.02)


def test_a_hole_in_the_data_does_not_open_a_ring():
    points = scan(RINGS["circle"], 0.1, 2)
    seen = np.abs(np.arctan2(points[:, 1], points[:, 0])) > 0.4 * W / 30
    found = rf.register(points[seen], at=RINGS["circle"].pick(0.4))
    assert found.closed
    assert found.length == pytest.approx(2 * np.pi * 30, rel=0.01)


# The same ring


@pytest.mark.parametrize("name", ["height", "width"])
def test_any_click_gives_the_same_ring_within_its_bands(scene, name):
    points, angle = scan(scene, 0.1, 2), np.linspace(0, 2 * np.pi, 60)
    values, stds = [], []
    for u in (0.1, 0.35, 0.6, 0.85):
        found = rf.register(points, at=scene.pick(u))
        assert found.closed
        values.append(round_the_centre(found, name, angle))
        stds.append(round_the_centre(found, name + "_std", angle))
    values, std = np.array(values), np.mean(stds, axis=0)
    assert np.sqrt(np.mean((values.std(axis=0) / std) ** 2)) < 0.7
    truth = getattr(scene, name)(angle / (2 * np.pi))
    assert np.abs((values - truth) / std).max() < 4.5
    assert 0.6 < np.sqrt(np.mean(((values - truth) / std) ** 2)) < 1.5


def round_the_centre(ridge: rf.Ridge, name: str, angle: np.ndarray) -> np.ndarray:
    at = np.arctan2(ridge.spine[:-1, 1], ridge.spine[:-1, 0])
    return np.interp(angle, at, getattr(ridge, name)[:-1], period=2 * np.pi)


def test_the_spine_is_the_circle(ring):
    assert np.abs(np.hypot(*ring.spine.T[:2]) - 30).max() < 0.02 * W
    assert np.abs(ring.spine[:, 2]).max() < 0.02 * W


def test_a_direction_turns_the_ring(scene):
    points, at = scan(scene, 0.1, 2), scene.pick(0.0)
    for sign in (-1.0, 1.0):
        found = rf.register(points, at=at, direction=(0, sign, 0))
        assert found.closed
        assert found.tangent[0, 1] * sign > 0.9
        assert np.linalg.norm(found.spine[0] - scene.pick(0.0)) < W


def test_a_ring_in_other_order_of_points_is_the_same_to_the_last_bit(scene, ring):
    points = scan(scene, 0.1, 2)
    again = rf.register(np.random.default_rng(0).permutation(points), at=ring.pick)
    for name in ("spine", "height", "width", "height_std"):
        np.testing.assert_array_equal(getattr(again, name), getattr(ring, name))


@pytest.mark.parametrize("scale", [1.0, 1e-3, 40.0])
def test_a_ring_moves_turns_and_grows_with_its_scan(scene, ring, scale):
    turn, shift = Rotation.from_rotvec([0.4, -1.1, 0.6]).as_matrix(), np.array([300.0, -20.0, 7.0])

    def move(points):
        return scale * (points @ turn.T + shift)

    found = rf.register(move(scan(scene, 0.1, 2)), at=move(ring.pick))
    assert found.closed
    np.testing.assert_allclose(found.spine, move(ring.spine), atol=1e-6 * scale * W)
    np.testing.assert_allclose(found.height, scale * ring.height, rtol=1e-6)
    np.testing.assert_allclose(found.width, scale * ring.width, rtol=1e-6)


def test_templates_advance_round_the_ring(ring):
    for before, after in zip(ring.templates, (*ring.templates[1:], ring.templates[0]), strict=True):
        assert advances(before, after)


# Periodic


def test_the_last_station_is_the_first_again(ring):
    for name in ("spine", "tangent", "normal", "height", "width", "height_std", "width_std", "border"):
        first, *_, last = getattr(ring, name)
        np.testing.assert_array_equal(first, last)
    assert ring.arc_length[0] == 0
    np.testing.assert_allclose(np.diff(ring.arc_length), ring.arc_length[1])


@pytest.mark.parametrize(
    "change", [{}, {"h": 1.4}, {"w": 0.7}, {"h": 2.0, "between": (180.0, 200.0)}], ids=str
)
@pytest.mark.parametrize("on_base", [False, True])
def test_the_surface_is_c2_over_the_seam(ring, change, on_base):
    ridge = ring.resized(**change)
    surface = ridge.surface(registered_base(ridge) if on_base else None)
    assert surface.closed == (True, False)
    v = np.linspace(*surface.domain[1], 41)
    for order in range(3):
        first, last = (surface.on_grid(np.array([u]), v, (order, 0)) for u in surface.domain[0])
        assert np.abs(first - last).max() <= 1e-9


def test_periodic_splines_reproduce_their_values_and_repeat():
    sites = np.array([0.0, 1.0, 2.5, 3.1, 4.0, 6.0])
    values = np.append(np.random.default_rng(1).normal(size=5), 0.0)
    values[-1] = values[0]
    knots, inverse = periodic_interpolation(sites)
    np.testing.assert_allclose(basis_matrix(knots, 3, sites) @ inverse @ values, values, atol=1e-12)
    for order in (1, 2):
        first, last = basis_matrix(knots, 3, np.array([0.0, 6.0]), order) @ inverse @ values
        assert first == pytest.approx(last, abs=1e-11)


# What is done with it


def test_a_stretch_may_run_over_the_seam(ring):
    total = ring.length
    taller = ring.resized(h=2.0, between=(total - 15, total + 15))
    rate = taller.height / ring.height
    near = np.minimum(ring.arc_length, total - ring.arc_length)
    np.testing.assert_allclose(rate[near < 6], 2.0, rtol=1e-12)
    np.testing.assert_allclose(rate[near > 15], 1.0, rtol=1e-12)
    np.testing.assert_allclose(ring.resized(h=2.0, between=(0, total)).height, 2 * ring.height)
    with pytest.raises(ValueError, match="s1 <= s0"):
        ring.resized(h=2.0, between=(10, 11 + total))


def test_a_stretch_from_the_seam_is_blended_there(ring):
    rate = ring.resized(h=2.0, between=(0, 40)).height / ring.height
    assert rate[0] == rate[-1] == pytest.approx(1.0)
    assert rate.max() == pytest.approx(2.0)


def test_an_absolute_profile_has_to_repeat(ring):
    total = ring.length
    found = ring.resized(height=lambda s: 3 + np.cos(2 * np.pi * s / total))
    assert found.height[0] == found.height[-1] == pytest.approx(4.0)
    with pytest.raises(ValueError, match=r"height: expected the same value at both ends.*got 1 at 0 and 2"):
        ring.resized(height=lambda s: 1 + s / total)


def test_sections_and_distances_know_the_seam(scene, ring):
    np.testing.assert_allclose(ring.section_at(0.0), ring.section_at(ring.length), atol=1e-12)
    for s in (0.0, 50.0):
        y, z = ring.section_at(s).T
        assert z.max() == pytest.approx(np.interp(s, ring.arc_length, ring.height), rel=0.01)
        assert y[z.argmax()] == pytest.approx(0, abs=0.01 * W)
    points = scan(scene, 0.1, 2)
    off = ring.distance(points)
    near = np.abs(np.hypot(*points.T[:2]) - 30) < 0.5 * W
    assert np.isfinite(off[near]).all()
    assert np.nanstd(off[near]) == pytest.approx(0.1, rel=0.1)


def test_it_stays_closed_on_disk(ring, tmp_path):
    ring.save(tmp_path / "ring.ridge.json")
    again = rf.load(tmp_path / "ring.ridge.json")
    assert again.closed and again.stop == ("closed", "closed")
    np.testing.assert_array_equal(again.surface().poles, ring.surface().poles)


def test_a_stretched_ring_is_closed_and_a_trimmed_one_is_not(ring):
    longer = ring.stretched(1.3 * ring.length)
    assert longer.closed and longer.surface().closed == (True, False)
    short = ring.stretched(0.7 * ring.length, fit="trim")
    assert not short.closed and short.surface().closed == (False, False)


def test_a_ring_pasted_on_a_plane_is_a_ring(ring):
    import cadquery as cq

    from cad_export.face_base import face_base

    box = cq.Workplane().box(200, 200, 10)
    base, fitted = face_base(box.faces(">Z").val(), ring)
    assert base.closed and fitted is ring
    assert ring.surface(base).closed == (True, False)
    eta = np.linspace(-0.5, 0.5, 2001)
    area = np.trapezoid(ring.section(eta), eta) * ring.height * ring.width
    part = box.faces(">Z").pasteRidge(ring).val()
    assert part.isValid() and len(part.Faces()) == 8
    assert part.Volume(1e-5) - 4e5 == pytest.approx(np.trapezoid(area, ring.arc_length), rel=1e-3)


def test_a_ring_is_refused_on_a_face_where_its_path_does_not_close(ring):
    import cadquery as cq

    from cad_export.face_base import face_base

    ball = cq.Workplane().sphere(150).faces().val()
    with pytest.raises(ValueError, match="keeps clear of itself"):
        face_base(ball, ring, at=(150, 0, 0), direction=(0, 1, 0))


def test_a_ring_needs_no_blending_to_be_joined(ring):
    assert joined(ring) is ring


def test_it_says_closed_instead_of_why_its_ends_stopped(ring):
    said = dict(rows(ring))
    assert said["ends"] == "none, the ridge is closed"
    assert not any("stopped because" in name for name in said)
    opened = dict(rows(replace(ring, closed=False, stop=("here", "there"))))
    assert (opened["start stopped because"], opened["end stopped because"]) == ("here", "there")


def test_the_picture_marks_one_place(scene, ring, tmp_path, monkeypatch):
    from matplotlib.axes import Axes

    from ridgefeature import plot

    said, annotate = [], Axes.annotate

    def listen(self, text, *args, **kwargs):
        said.append(text)
        return annotate(self, text, *args, **kwargs)

    monkeypatch.setattr(Axes, "annotate", listen)
    plot.view(rf.Scan(scan(scene, 0.1, 2)), ring, tmp_path / "view.png")
    assert any(text.startswith("closed, s = 0 and s = ") for text in said)
    assert not any(text.startswith(("start", "end")) for text in said)


# Kernels of the decision


@pytest.mark.parametrize("seed", range(20))
def test_the_largest_run_on_a_circle_is_that_of_all_runs(seed):
    gain = np.random.default_rng(seed).normal(-0.3, 1.0, 17)
    twice = np.concatenate([gain, gain])
    runs = [twice[i:j].sum() for i in range(17) for j in range(i + 1, i + 18)]
    low, high, most = _largest_run(gain)
    assert most == pytest.approx(max(*runs, 0.0))
    assert 0 <= high - low <= 17
    assert twice[low : low + (high - low)].sum() == pytest.approx(most)


def test_a_run_that_loses_everywhere_is_none():
    assert _largest_run(-np.ones(9)) == (0, 0, 0.0)
