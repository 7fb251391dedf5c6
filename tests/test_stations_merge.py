"""CONSTRUCT: stations of a chain of templates, and the one surface merged from them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import bell, spiral_ridge, template_at
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from ridgefeature import Settings
from ridgefeature.bspline import Surface
from ridgefeature.kernels.natural_spline import natural_spline_matrix
from ridgefeature.merge import LEAST_BORDER, along, merged_surface, template_surface
from ridgefeature.section import plateau
from ridgefeature.stations import Stations, border_of, interpolating_curve, lay_out

TURN = Rotation.from_rotvec([0.3, -0.8, 1.7]).as_matrix()


def chain(
    n: int = 6, radius: float = np.inf, sizes=lambda i: (3.0, 8.0), frame=TURN, place=(10.0, -20.0, 5.0)
):
    """n templates end to end on a straight line or an arc in the x, y plane of the frame."""
    templates = []
    for i in range(n):
        height, width = sizes(i)
        length, s = 6.4, 6.4 * (i + 0.5)
        angle = s / radius
        where = (
            np.array([s, 0, 0])
            if radius == np.inf
            else radius * np.array([np.sin(angle), 1 - np.cos(angle), 0])
        )
        turn = Rotation.from_rotvec([0, 0, angle]).as_matrix()
        std = np.array([0, 0.1, 0.1, 0.1, 0.1, 0.1, 0.05, 0.07])
        template = template_at(height, width, length=length, std=std, trend=np.array([1 / radius, 0, 0]))
        templates.append(template.changed(position=place + frame @ where, rotation=frame @ turn))
    return tuple(templates)


def surface_of(stations: Stations, section=None, **changes) -> Surface:
    fields = {**vars(stations), **changes}
    return merged_surface(
        fields["arc_length"],
        fields["spine"],
        np.cross(fields["normal"], fields["tangent"]),
        fields["normal"],
        fields["height"],
        fields["width"],
        fields["border"],
        section or bell(),
    )


@pytest.fixture(scope="module")
def arc() -> Stations:
    return lay_out(chain(8, 40.0, lambda i: (3.0 - 0.2 * i, 8.0 - 0.3 * i)), Settings())


# The natural spline


SITES = st.lists(st.floats(0.1, 5.0), min_size=1, max_size=9).map(lambda steps: np.cumsum([0.0, *steps]))


@given(SITES, st.integers(0, 10**6))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_the_natural_spline_is_scipys(sites, seed):
    values = np.random.default_rng(seed).normal(size=len(sites))
    at = np.linspace(sites[0], sites[-1], 41)
    found = natural_spline_matrix(sites, at) @ values
    np.testing.assert_allclose(found, CubicSpline(sites, values, bc_type="natural")(at), atol=1e-9)


@given(SITES, st.integers(0, 10**6))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_beyond_its_sites_the_natural_spline_goes_on_straight(sites, seed):
    values = np.random.default_rng(seed).normal(size=len(sites))
    spline = CubicSpline(sites, values, bc_type="natural")
    for end, step in ((sites[0], np.array([-1e-6, -0.3, -7.0])), (sites[-1], np.array([1e-6, 0.3, 7.0]))):
        found = natural_spline_matrix(sites, end + step) @ values
        np.testing.assert_allclose(found, spline(end) + step * spline(end, 1), atol=1e-8)


def test_one_site_gives_a_constant():
    np.testing.assert_array_equal(
        natural_spline_matrix(np.array([3.0]), np.array([-1.0, 3.0, 9.0])), np.ones((3, 1))
    )


def test_the_rows_of_the_natural_spline_reproduce_straight_lines():
    sites, at = np.array([0.0, 1.0, 2.5, 4.0, 4.2]), np.linspace(-2, 7, 31)
    matrix = natural_spline_matrix(sites, at)
    np.testing.assert_allclose(matrix.sum(axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(matrix @ (2 * sites - 1), 2 * at - 1, atol=1e-12)


@pytest.mark.parametrize("n", [2, 3, 4, 5, 9])
def test_the_interpolating_curve_is_scipys_not_a_knot_spline(n):
    sites = np.cumsum(np.random.default_rng(n).uniform(0.5, 2.0, n))
    points = np.random.default_rng(n + 1).normal(size=(n, 3))
    t = np.linspace(sites[0], sites[-1], 50)
    curve = interpolating_curve(sites, points)
    np.testing.assert_allclose(curve(sites), points, atol=1e-11)
    if n >= 4:
        np.testing.assert_allclose(curve(t), CubicSpline(sites, points, bc_type="not-a-knot")(t), atol=1e-9)


# Stations


def test_stations_are_even_and_ascend_from_zero(arc):
    assert arc.arc_length[0] == 0
    np.testing.assert_allclose(np.diff(arc.arc_length), arc.arc_length[1], rtol=1e-12)
    for name in ("height", "width", "height_std", "width_std", "border"):
        assert getattr(arc, name).shape == arc.arc_length.shape


def test_stations_on_an_arc_have_its_length_centre_and_direction(arc):
    assert arc.arc_length[-1] == pytest.approx(8 * 6.4, rel=1e-3)
    centre = np.array([10.0, -20.0, 5.0]) + TURN @ [0, 40.0, 0]
    np.testing.assert_allclose(np.linalg.norm(arc.spine - centre, axis=1), 40.0, rtol=1e-3)
    np.testing.assert_allclose(arc.normal, np.tile(TURN[:, 2], (len(arc.spine), 1)), atol=1e-9)
    outward = (arc.spine - centre) / 40
    assert np.abs((arc.tangent * outward).sum(axis=1)).max() < 0.02


def test_height_and_width_pass_through_the_templates(arc):
    middle = np.array([6.4 * (i + 0.5) for i in range(8)])
    heights, widths = 3.0 - 0.2 * np.arange(8), 8.0 - 0.3 * np.arange(8)
    np.testing.assert_allclose(np.interp(middle, arc.arc_length, arc.height), heights, atol=5e-3)
    np.testing.assert_allclose(np.interp(middle, arc.arc_length, arc.width), widths, atol=5e-3)


def test_deviations_follow_by_the_same_linear_map():
    """Templates' errors are independent, so simulated ones spread at the stations as height_std says."""
    random, draws = np.random.default_rng(1), []
    for _ in range(400):
        errors = random.normal(0, 0.05, 6)
        draws.append(lay_out(chain(6, sizes=lambda i, e=errors: (3 + e[i], 8.0)), Settings()).height)
    expected = lay_out(chain(6), Settings()).height_std
    np.testing.assert_allclose(np.std(draws, axis=0), expected, rtol=0.15)


def test_unknown_deviations_stay_infinite():
    templates = tuple(t.changed(std=None) for t in chain(1))
    assert np.isinf(lay_out(templates, Settings()).height_std).all()


def test_the_width_never_falls_to_nothing_between_templates():
    stations = lay_out(chain(6, sizes=lambda i: (3.0, (9.0, 0.3)[i % 2])), Settings())
    assert stations.width.min() > 0


@pytest.mark.parametrize("n", [1, 2, 3, 40])
def test_any_number_of_templates_makes_a_surface(n):
    stations = lay_out(chain(n), Settings())
    assert 13 <= len(stations.arc_length) <= 401
    assert np.isfinite(surface_of(stations).poles).all()


# The merged surface


@pytest.mark.parametrize("section", [bell(), plateau()], ids=lambda s: s.name)
@pytest.mark.parametrize("n", [1, 2, 5, 9])
def test_equal_templates_in_line_give_the_straight_template_exactly(n, section):
    templates = chain(n)
    stations = lay_out(templates, Settings())
    whole = surface_of(stations, section)
    np.testing.assert_allclose(stations.height, 3.0, atol=1e-12)
    np.testing.assert_allclose(stations.width, 8.0, atol=1e-12)
    for i, template in enumerate(templates):
        patch = template_surface(template.changed(section=section))
        u, v = np.linspace(0, template.length, 7), np.linspace(-0.5, 0.5, 61)
        end = stations.arc_length[-1]
        np.testing.assert_allclose(
            whole.on_grid(np.clip(u + 6.4 * i, 0, end), v), patch.on_grid(u, v), atol=1e-9
        )


def test_the_surface_is_twice_continuously_differentiable(arc):
    surface = surface_of(arc)
    step = 1e-9
    for knots, axis in ((surface.knots_u, 0), (surface.knots_v, 1)):
        at = np.unique(knots)[1:-1]
        other = np.linspace(*surface.domain[1 - axis], 9)
        for order in range(3):
            derivative = (order, 0) if axis == 0 else (0, order)
            sides = [
                surface.on_grid(*((x, other) if axis == 0 else (other, x)), derivative)
                for x in (at - step, at + step)
            ]
            scale = np.abs(sides[0]).max() + 1e-3
            np.testing.assert_allclose(sides[0], sides[1], atol=1e-6 * scale)


def test_u_is_arc_length_along_the_spine(arc):
    total = arc.arc_length[-1]
    u = np.linspace(0, total, 2001)
    speed = np.linalg.norm(along(arc.arc_length, arc.spine, u, 1), axis=1)
    assert np.abs(speed - 1).max() < 1e-3
    surface = surface_of(arc, height=0 * arc.height)
    assert surface.domain[0] == (0, total)
    np.testing.assert_allclose(np.linalg.norm(surface.derivatives(u, 0 * u)[0], axis=-1), speed, atol=1e-9)


def test_u_is_arc_length_on_a_registered_ridge():
    ridge = spiral_ridge()
    u = np.linspace(0, ridge.length, 2001)
    speed = np.linalg.norm(along(ridge.arc_length, ridge.spine, u, 1), axis=1)
    assert np.abs(speed - 1).max() < 1e-3


def test_v_is_the_distance_from_the_spine_in_widths(arc):
    surface = surface_of(arc, height=0 * arc.height)
    base = surface.on_grid(arc.arc_length, np.linspace(-0.5, 0.5, 11)) - arc.spine[:, None]
    across = np.cross(arc.normal, arc.tangent)
    y = (base * across[:, None]).sum(axis=-1)
    np.testing.assert_allclose(y, arc.width[:, None] * np.linspace(-0.5, 0.5, 11), atol=1e-9)


@pytest.mark.parametrize("name", ["height", "width"])
def test_the_poles_are_affine_in_height_and_in_width(arc, name):
    value = getattr(arc, name)
    one, two, three = (surface_of(arc, **{name: f * value}).poles for f in (0.6, 0.8, 1.0))
    assert np.abs(two - one).max() > 0.1
    np.testing.assert_allclose(three - two, two - one, atol=1e-12)


@pytest.mark.parametrize("changes", [{"height": 2.0}, {"width": 0.7}, {"height": -1.0, "width": 1.1}])
def test_the_border_does_not_move_with_height_or_width(arc, changes):
    changed = {name: rate * getattr(arc, name) for name, rate in changes.items()}
    before, after = surface_of(arc), surface_of(arc, **changed)
    assert np.abs(before.poles - after.poles).max() > 0.1
    for side in (0, -1):
        np.testing.assert_array_equal(before.poles[:, side], after.poles[:, side])
    np.testing.assert_array_equal(before.knots_u, after.knots_u)


def test_turning_all_stations_turns_the_poles(arc):
    shift = np.array([5.0, 6.0, -7.0])
    turned = surface_of(
        arc, spine=arc.spine @ TURN.T + shift, normal=arc.normal @ TURN.T, tangent=arc.tangent @ TURN.T
    )
    np.testing.assert_allclose(turned.poles, surface_of(arc).poles @ TURN.T + shift, atol=1e-11)


def test_borders_in_bends_leave_room_for_the_width_as_it_is():
    """Else a ridge with a sharp bend could be made neither taller nor wider."""
    width, radius = np.array([10.0, 10.0, 10.0]), np.array([100.0, 7.0, 1.0])
    border = border_of(width, 1.0 / radius, Settings())
    assert (border > 1.005 * LEAST_BORDER * width).all()
    assert (np.diff(border) <= 0).all()
