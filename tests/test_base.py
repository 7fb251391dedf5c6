"""A ridge's surface on any base, and ridges of other lengths."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
import pytest
from made_ridges import made_ridge
from oracles import spiral_ridge
from scipy.spatial.transform import Rotation

import ridgefeature as rf
from ridgefeature.base import Base, developed, geodesic_curvature, plane_base, registered_base
from ridgefeature.fitting import joined, mirrored
from ridgefeature.on_base import surfaces_on
from ridgefeature.section import Section

TURN = Rotation.from_rotvec([0.3, -0.8, 1.7]).as_matrix()


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A helix on a cylinder about z; y along the helices square to it."""

    radius: float
    length: float
    slope: float = 0.5
    closed: bool = False

    def __call__(self, s, y):
        a = (s[:, None] * np.cos(self.slope) - y * np.sin(self.slope)) / self.radius
        z = s[:, None] * np.sin(self.slope) + y * np.cos(self.slope)
        normal = np.stack([np.cos(a), np.sin(a), 0 * a], axis=-1)
        return self.radius * normal + z[..., None] * [0, 0, 1.0], normal

    def off(self, points):
        return np.abs(np.linalg.norm(points[..., :2], axis=-1) - self.radius)


@dataclass(frozen=True, eq=False)
class Sphere:
    """The equator of a sphere, y along its meridians."""

    radius: float
    length: float
    closed: bool = False

    def __call__(self, s, y):
        a, b = s[:, None] / self.radius + 0 * y, y / self.radius
        normal = np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=-1)
        return self.radius * normal, normal

    def off(self, points):
        return np.abs(np.linalg.norm(points, axis=-1) - self.radius)


def frame(surface, u, v=0.0):
    return surface(np.asarray(u), v + 0 * np.asarray(u))


BENT = made_ridge(bend=0.08)
CURVED = [Cylinder(15.0, 60.0), Cylinder(60.0, 60.0, slope=1.5), Sphere(20.0, 60.0), Sphere(80.0, 60.0)]


# On a plane


@pytest.mark.parametrize("section", [None, Section(np.array([0.2, 1.0, 0.4, -0.1]))])
def test_the_ridges_own_flat_base_gives_its_own_poles(section):
    ridge = made_ridge(bend=0.08, section=section)
    on_base, plain = ridge.surface(registered_base(ridge)), ridge.surface()
    np.testing.assert_allclose(on_base.poles, plain.poles, rtol=0, atol=1e-12 * 60)
    np.testing.assert_allclose(on_base.knots_u, plain.knots_u, rtol=1e-14)
    np.testing.assert_array_equal(on_base.knots_v, plain.knots_v)


def test_a_flat_ridge_developed_on_another_plane_is_moved_rigidly():
    origin = np.array([5.0, -3.0, 8.0])
    base = plane_base(BENT, origin, TURN[:, 0], TURN[:, 2])
    np.testing.assert_allclose(
        BENT.surface(base).poles, origin + BENT.surface().poles @ TURN.T, rtol=0, atol=1e-4
    )
    moved = replace(BENT, spine=base.spine, tangent=base.tangent, normal=base.normal)
    np.testing.assert_allclose(BENT.surface(base).poles, moved.surface().poles, rtol=0, atol=1e-12 * 60)


def test_a_registered_ridge_stands_on_its_own_base():
    ridge = spiral_ridge()
    surface, base = ridge.surface(registered_base(ridge)), ridge.surface()
    u = np.linspace(0, ridge.length, 301)
    np.testing.assert_allclose(frame(surface, u), frame(base, u), atol=1e-3 * ridge.width.min())


def test_without_a_base_nothing_changes():
    ridge = spiral_ridge()
    assert ridge.surface() is ridge.surface(None) is ridge.surface()


def test_developing_a_plane_path_keeps_its_shape():
    points, angle = developed(BENT)
    np.testing.assert_allclose(points, BENT.spine[:, :2], atol=1e-4)
    np.testing.assert_allclose(np.cos(angle), BENT.tangent[:, 0], atol=1e-5)
    s = BENT.arc_length
    np.testing.assert_allclose(geodesic_curvature(BENT), 0.08 * np.sin(2 * np.pi * s / 60), atol=1e-4)


# On curved bases


@pytest.mark.parametrize("base", CURVED, ids=repr)
@pytest.mark.parametrize("w", [0.5, 1.0, 1.5])
def test_spine_feet_and_borders_lie_on_the_base(base, w):
    flat = made_ridge().resized(h=0, w=w)
    surface = flat.surface(base)
    (u0, u1), (v0, v1) = surface.domain
    u = np.linspace(u0, u1, 777)
    least = flat.width.min()
    for v in (v0, 0.0, v1):
        assert base.off(frame(surface, u, v)).max() < 2e-6 * least
    for v in (-0.5, 0.5):
        assert base.off(frame(surface, u, v)).max() < 8e-6 * least
    assert base.off(surface.grid(300, 200)).max() < 1e-5 * least


@pytest.mark.parametrize("base", CURVED, ids=repr)
def test_height_and_width_keep_their_meaning(base):
    ridge = made_ridge()
    surface, s = ridge.surface(base), ridge.arc_length
    spine, normal = (x[:, 0] for x in base(s, 0 * s[:, None]))
    apex = frame(surface, s)
    np.testing.assert_allclose(apex, spine + ridge.height[:, None] * normal, atol=1e-4 * ridge.width.min())
    for side in (-0.5, 0.5):
        foot = base(s, side * ridge.width[:, None])[0][:, 0]
        np.testing.assert_allclose(frame(surface, s, side), foot, atol=1e-5 * ridge.width.min())
    (_, _), (v0, v1) = surface.domain
    for v, side in ((v0, -1), (v1, 1)):
        border = base(s, side * ridge.border[:, None])[0][:, 0]
        np.testing.assert_allclose(frame(surface, s, v), border, atol=1e-9)


@pytest.mark.parametrize("base", CURVED, ids=repr)
def test_poles_are_affine_in_height(base):
    ridge = made_ridge()
    low, one, high = (ridge.resized(h=h).surface(base) for h in (-2.0, 1.0, 3.0))
    np.testing.assert_allclose(one.poles, 0.4 * low.poles + 0.6 * high.poles, atol=1e-10)
    np.testing.assert_array_equal(low.knots_v, high.knots_v)


def test_the_surface_does_not_depend_on_what_was_made_on_the_base_before():
    ridge = made_ridge()
    fresh, used = Sphere(20.0, 60.0), Sphere(20.0, 60.0)
    for rate in (0.3, 1.5, 0.8):
        ridge.resized(w=rate).surface(used)
    np.testing.assert_array_equal(ridge.surface(used).poles, ridge.surface(fresh).poles)


def test_a_rigid_motion_of_the_base_moves_the_surface():
    ridge, base, place = made_ridge(), Sphere(20.0, 60.0), np.array([100.0, -50.0, 7.0])

    class Moved(Sphere):
        def __call__(self, s, y):
            points, normals = base(s, y)
            return points @ TURN.T + place, normals @ TURN.T

    moved = ridge.surface(Moved(20.0, 60.0))
    np.testing.assert_allclose(moved.poles, ridge.surface(base).poles @ TURN.T + place, atol=1e-10)


def test_scale_goes_through():
    small, large = made_ridge(), made_ridge(600.0, width=60.0, border=60.0)
    large = replace(large, height=10 * small.height, width=10 * small.width)
    np.testing.assert_allclose(
        large.surface(Sphere(200.0, 600.0)).poles, 10 * small.surface(Sphere(20.0, 60.0)).poles, atol=1e-9
    )


def test_another_height_and_width_cost_at_most_a_tenth():
    ridge, base = made_ridge(), Sphere(20.0, 60.0)
    start = perf_counter()
    ridge.surface(base)
    first, again = perf_counter() - start, []
    for rate in (0.8, 0.9, 1.1, 1.2, 1.3):
        other = ridge.resized(h=rate, w=rate)
        start = perf_counter()
        other.surface(base)
        again.append(perf_counter() - start)
    assert min(again) <= 0.1 * first


def test_a_ring_on_a_closed_base_closes_smoothly():
    ridge, base = joined(made_ridge()), Sphere(60.0 / (2 * np.pi), 60.0, closed=True)
    surface = ridge.surface(base)
    assert surface.closed == (True, False)
    np.testing.assert_array_equal(surface.poles[0], surface.poles[-1])
    v = np.linspace(*surface.domain[1], 41)
    ends = np.array([0.0, 60.0])
    for order in (1, 2):
        first, last = surface.on_grid(ends, v, (order, 0))
        np.testing.assert_allclose(first, last, atol=1e-9)
    assert base.off(ridge.resized(h=0).surface(base).grid(300, 50)).max() < 1e-5 * ridge.width.min()


def test_a_ring_leaves_the_middle_alone():
    ridge = made_ridge()
    ring = joined(ridge)
    assert ring.closed and not ridge.closed
    for name in ("height", "width", "border"):
        values = getattr(ring, name)
        assert values[0] == values[-1] == pytest.approx(0.5 * np.sum(getattr(ridge, name)[[0, -1]]))
        np.testing.assert_array_equal(values[10:-10], getattr(ridge, name)[10:-10])


# Bad bases


class Broken(Sphere):
    """A base that gives what it should not."""

    def __call__(self, s, y):
        points, normals = super().__call__(s, y)
        return np.where(s[:, None, None] > 30, np.nan, points), normals


class Flat(Sphere):
    def __call__(self, s, y):
        return np.zeros((3, 3)), np.zeros((3, 3))


@pytest.mark.parametrize(
    ("base", "message"),
    [
        (Sphere(20.0, 61.0), r"ridge.stretched\(61"),
        (Sphere(20.0, 60.001), "expected the ridge's length"),
        (Sphere(20.0, np.nan), "expected the ridge's length"),
        (Sphere(20.0, 60.0, closed=True), "ends meet"),
        (Broken(20.0, 60.0), "expected finite points"),
        (Flat(20.0, 60.0), "expected points of shape"),
        ("plane", "expected a map"),
        (3.0, "expected a map"),
    ],
)
def test_a_bad_base_is_refused_in_words(base, message):
    with pytest.raises(ValueError, match=message):
        made_ridge().surface(base)


def test_what_serves_as_a_base():
    assert isinstance(Sphere(1.0, 1.0), Base) and isinstance(registered_base(BENT), Base)
    assert not isinstance(BENT, Base)


@pytest.mark.parametrize(
    "values",
    [
        {"origin": (0, 0)},
        {"origin": (0, 0, np.nan)},
        {"direction": (0, 0, 1)},
        {"direction": (0, 0, 0)},
        {"normal": (0, 0, 0)},
    ],
)
def test_a_bad_plane_is_refused_in_words(values):
    with pytest.raises(ValueError, match=f"{next(iter(values))}: expected"):
        plane_base(BENT, **values)


# Stretched


def test_stretching_along_keeps_sizes_and_lengthens_the_path():
    other = BENT.stretched(90.0)
    assert other.length == 90.0
    np.testing.assert_allclose(np.diff(other.arc_length), 1.5, rtol=1e-12)
    for name in ("height", "width", "border", "height_std", "width_std", "tangent"):
        np.testing.assert_array_equal(getattr(other, name), getattr(BENT, name))
    np.testing.assert_allclose(np.diff(other.spine, axis=0), 1.5 * np.diff(BENT.spine, axis=0))


def test_scaling_scales_everything():
    other = BENT.stretched(90.0, "scale")
    for name in ("height", "width", "border", "height_std", "width_std", "arc_length"):
        np.testing.assert_allclose(getattr(other, name), 1.5 * getattr(BENT, name), rtol=1e-12)
    np.testing.assert_allclose(other.surface().poles, 1.5 * BENT.surface().poles, atol=1e-10)


@pytest.mark.parametrize("length", [60.0, 37.3, 12.0, 0.5])
def test_trimming_cuts_and_leaves_the_rest(length):
    other = BENT.stretched(length, "trim")
    assert other.length == length and len(other.arc_length) >= 13
    u = np.linspace(0, length, 50)
    for v in (0.0, 0.3):
        np.testing.assert_allclose(frame(other.surface(), u, v), frame(BENT.surface(), u, v), atol=2e-4)
    np.testing.assert_allclose(np.linalg.norm(other.tangent, axis=1), 1)
    np.testing.assert_allclose((other.tangent * other.normal).sum(axis=1), 0, atol=1e-12)


def test_unknown_deviations_stay_unknown():
    unknown = replace(BENT, height_std=np.full(61, np.inf), width_std=np.full(61, np.inf))
    assert np.isinf(unknown.stretched(30.0, "trim").height_std).all()
    assert np.isinf(unknown.stretched(90.0, "scale").width_std).all()


def test_the_same_length_is_the_same_ridge():
    for fit in ("length", "scale"):
        np.testing.assert_array_equal(BENT.stretched(60.0, fit).surface().poles, BENT.surface().poles)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0,), "length: expected"),
        ((-3.0,), "length: expected"),
        ((np.nan,), "length: expected"),
        (("long",), "length: expected"),
        ((None,), "length: expected"),
        ((90.0, "cut"), "fit: expected"),
        ((90.0, "trim"), "length: expected at most 60"),
    ],
)
def test_a_bad_length_is_refused_in_words(arguments, message):
    with pytest.raises(ValueError, match=message):
        BENT.stretched(*arguments)


def test_a_mirrored_ridge_is_its_reflection_and_twice_itself():
    ridge = made_ridge(bend=0.08, section=Section(np.array([0.2, 1.0, 0.4])))
    mirror = mirrored(ridge)
    assert isinstance(mirror, rf.Ridge)
    np.testing.assert_allclose(geodesic_curvature(mirror), -geodesic_curvature(ridge), atol=1e-12)
    i = len(ridge.arc_length) // 2
    across = ridge.across[i]
    points = ridge.surface().grid(50, 20)
    reflected = points - 2 * ((points - ridge.spine[i]) @ across)[..., None] * across
    np.testing.assert_allclose(mirror.surface().grid(50, 20)[:, ::-1], reflected, atol=1e-9)
    np.testing.assert_allclose(mirrored(mirror).surface().poles, ridge.surface().poles, atol=1e-10)


def test_the_surface_and_its_base_come_as_they_do_one_by_one():
    ridge = made_ridge(40.0, 41)
    base = Cylinder(30.0, ridge.length)
    surface, flat = surfaces_on(base, ridge, ridge.section)
    assert np.array_equal(surface.poles, ridge.surface(base).poles)
    assert np.array_equal(flat.poles, ridge.resized(h=0).surface(base).poles)
    assert np.array_equal(surface.poles[:, [0, -1]], flat.poles[:, [0, -1]])
