"""The ridge feature: resizing, sections, distances, and that nothing changes in place."""

from __future__ import annotations

import warnings
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from oracles import spiral_points, spiral_ridge

import ridgefeature as rf


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge()


# Resized: rates and absolute values


@pytest.mark.parametrize(("h", "w"), [(1.5, 0.8), (0.5, 1.2), (-1.0, 1.0), (0.0, 1.0)])
def test_rates_multiply_height_width_and_their_deviations(ridge, h, w):
    other = ridge.resized(h=h, w=w)
    np.testing.assert_allclose(other.height, h * ridge.height, rtol=1e-14)
    np.testing.assert_allclose(other.width, w * ridge.width, rtol=1e-14)
    np.testing.assert_allclose(other.height_std, abs(h) * ridge.height_std, rtol=1e-12)
    np.testing.assert_allclose(other.width_std, w * ridge.width_std, rtol=1e-12)


def test_only_height_and_width_change(ridge):
    other = ridge.resized(h=1.5, w=0.8)
    for name in ("arc_length", "spine", "tangent", "normal", "border", "templates", "section", "pick"):
        assert getattr(other, name) is getattr(ridge, name)


def test_absolute_numbers_hold_everywhere(ridge):
    other = ridge.resized(height=2.0, width=5.0)
    np.testing.assert_allclose(other.height, 2.0)
    np.testing.assert_allclose(other.width, 5.0)
    np.testing.assert_allclose(other.height_std, ridge.height_std * 2.0 / ridge.height)


def test_absolute_values_may_be_functions_of_arc_length(ridge):
    other = ridge.resized(height=lambda s: 1 + s / 100, width=lambda s: 5.0 + 0 * s)
    np.testing.assert_allclose(other.height, 1 + ridge.arc_length / 100)
    np.testing.assert_allclose(other.width, 5.0)


def test_a_rate_for_one_and_a_value_for_the_other(ridge):
    other = ridge.resized(h=2.0, width=5.0)
    np.testing.assert_allclose(other.height, 2 * ridge.height)
    np.testing.assert_allclose(other.width, 5.0)


def test_nothing_given_changes_nothing(ridge):
    np.testing.assert_array_equal(ridge.resized().height, ridge.height)
    np.testing.assert_array_equal(ridge.resized(h=1, w=1).surface().poles, ridge.surface().poles)


# Resized: a stretch


def test_a_stretch_changes_inside_in_full_and_not_at_all_outside(ridge):
    low, high = 40.0, 100.0
    rate = ridge.resized(h=1.5, w=0.8, between=(low, high)).height / ridge.height
    s, ramp = ridge.arc_length, float(np.median(ridge.width))
    outside, inside = (s <= low) | (s >= high), (s >= low + ramp) & (s <= high - ramp)
    assert outside.any() and inside.any()
    np.testing.assert_array_equal(rate[outside], 1.0)
    np.testing.assert_allclose(rate[inside], 1.5)
    assert ((rate >= 1.0) & (rate <= 1.5 + 1e-12)).all()
    assert np.abs(np.diff(rate)).max() < 0.25  # no step between neighbouring stations


def test_a_stretch_reaches_the_surface_inside_and_leaves_it_alone_outside(ridge):
    other = ridge.resized(h=1.5, between=(40.0, 100.0))
    u = np.linspace(0, ridge.length, 801)
    moved = np.linalg.norm(other.surface()(u, 0 * u) - ridge.surface()(u, 0 * u), axis=-1)
    far = (u < 30) | (u > 110)
    assert moved[far].max() < 1e-4 * ridge.height.max()
    assert moved[(u > 60) & (u < 80)].min() > 0.4 * ridge.height.min()


def test_a_stretch_to_an_end_needs_no_ramp_there(ridge):
    whole = ridge.resized(h=1.5, between=(0.0, ridge.length))
    np.testing.assert_allclose(whole.height, 1.5 * ridge.height)
    to_end = ridge.resized(h=1.5, between=(100.0, ridge.length))
    assert to_end.height[-1] == pytest.approx(1.5 * ridge.height[-1])
    assert to_end.height[0] == ridge.height[0]


def test_deviations_follow_along_a_stretch(ridge):
    other = ridge.resized(h=2.0, between=(40.0, 100.0))
    np.testing.assert_allclose(other.height_std / ridge.height_std, other.height / ridge.height)
    np.testing.assert_array_equal(other.width_std, ridge.width_std)


def test_a_short_stretch_changes_something_or_is_refused(ridge):
    at = 0.5 * (ridge.arc_length[12] + ridge.arc_length[13])
    try:
        other = ridge.resized(h=2.0, between=(at - 0.2, at + 0.2))
    except ValueError:
        return
    assert (other.height != ridge.height).any()


# Resized: bad input

BAD = [
    ({"h": np.nan}, "h: expected finite"),
    ({"h": "tall"}, "h: expected finite"),
    ({"w": np.inf}, "w: expected finite"),
    ({"height": lambda s: s * np.nan}, "height: expected finite"),
    ({"h": 1.0, "height": 2.0}, "either the rate h or the absolute height"),
    ({"w": 1.0, "width": 2.0}, "either the rate w or the absolute width"),
    ({"w": 0.0}, "w: expected a rate above 0"),
    ({"w": -1.0}, "w: expected a rate above 0"),
    ({"width": lambda s: 0 * s}, "width: expected values above 0"),
    ({"width": 500.0}, "width: expected at most .* flanks"),
    ({"w": 3.0}, "use a smaller w"),
    ({"h": 2.0, "between": (0.0, 1e4)}, "between: expected .* arc length"),
    ({"h": 2.0, "between": (-1.0, 20.0)}, "between: expected"),
    ({"h": 2.0, "between": (30.0, 20.0)}, "between: expected"),
    ({"h": 2.0, "between": (20.0, 20.0)}, "between: expected"),
    ({"h": 2.0, "between": (np.nan, 20.0)}, "between: expected finite"),
]
UNCLEAR = [
    ({"h": 2.0, "between": 5.0}, "between: expected"),
    ({"h": 2.0, "between": (1.0, 2.0, 3.0)}, "between: expected"),
    ({"h": [1.0, 2.0]}, "h: expected"),
    ({"height": lambda s: s[:3]}, "height: expected"),
    ({"height": np.ones(7)}, "height: expected"),
]


@pytest.mark.parametrize(("values", "message"), BAD)
def test_bad_values_are_refused_with_what_was_expected(ridge, values, message):
    with pytest.raises(ValueError, match=message):
        ridge.resized(**values)


@pytest.mark.parametrize(("values", "message"), UNCLEAR)
def test_values_of_the_wrong_shape_are_refused_with_what_was_expected(ridge, values, message):
    with pytest.raises(ValueError, match=message):
        ridge.resized(**values)


def test_the_message_names_the_widest_that_goes(ridge):
    with pytest.raises(ValueError, match="expected at most") as caught:
        ridge.resized(width=500.0)
    most = float(str(caught.value).split("at most ")[1].split()[0])
    assert np.isfinite(ridge.resized(width=0.999 * most).surface().poles).all()


def test_what_is_told_of_a_rate_is_allowed(ridge):
    """The limit of a rate is a rate, also along a stretch, where the blend takes part of it only."""
    for between in (None, (0.0, 0.5 * ridge.length), (0.25 * ridge.length, 0.75 * ridge.length)):
        with pytest.raises(ValueError, match="w: expected at most") as caught:
            ridge.resized(w=50, between=between)
        most = float(str(caught.value).split("at most ")[1].split()[0])
        assert most > 1
        ridge.resized(w=most, between=between)
        with pytest.raises(ValueError, match="w: expected at most"):
            ridge.resized(w=1.01 * most, between=between)


# Surface and sections


@pytest.mark.parametrize(("h", "w"), [(1.0, 1.0), (1.5, 0.8), (-0.5, 1.1)])
def test_section_at_a_station_is_the_section_over_the_base(ridge, h, w):
    for i in (0, 30, len(ridge.height) - 1):
        y, z = ridge.section_at(ridge.arc_length[i], 201, h, w).T
        expected = h * ridge.height[i] * ridge.section(y / (w * ridge.width[i]))
        np.testing.assert_allclose(z, expected, atol=1e-9)
        assert y[0] == pytest.approx(-ridge.border[i]) and y[-1] == pytest.approx(ridge.border[i])
        assert (np.diff(y) > 0).all()


def test_section_at_takes_the_stretch_of_a_resized_ridge(ridge):
    tall = ridge.resized(h=2.0, between=(40.0, 100.0))
    assert tall.section_at(70.0)[:, 1].max() == pytest.approx(
        2 * ridge.section_at(70.0)[:, 1].max(), rel=1e-6
    )
    assert tall.section_at(10.0)[:, 1].max() == pytest.approx(ridge.section_at(10.0)[:, 1].max(), rel=1e-4)


def test_section_at_gives_as_many_points_as_asked(ridge):
    assert ridge.section_at(3.0).shape == (101, 2)
    assert ridge.section_at(0, n=2).shape == (2, 2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((-1.0,), "s: expected"),
        ((1e4,), "s: expected"),
        ((np.nan,), "s: expected"),
        (("x",), "s: expected"),
        ((3.0, 1), "n: expected"),
        ((3.0, 11, np.nan), "h: expected"),
        ((3.0, 11, 1.0, -1.0), "w: expected"),
    ],
)
def test_section_at_refuses_what_is_not_on_the_ridge(ridge, arguments, message):
    with pytest.raises(ValueError, match=message):
        ridge.section_at(*arguments)


def test_half_height_width_is_where_the_section_is_half_as_high(ridge):
    y, z = ridge.section_at(ridge.arc_length[40], 20001).T
    above = y[z >= 0.5 * ridge.height[40]]
    assert above[-1] - above[0] == pytest.approx(ridge.half_height_width[40], abs=2e-3)


# Distance


def test_distance_is_zero_on_the_surface_and_signed_along_its_normals(ridge):
    random, surface = np.random.default_rng(3), ridge.surface()
    u, v = random.uniform(1, ridge.length - 1, 200), random.uniform(-0.55, 0.55, 200)
    points, normals = surface(u, v), surface.normal(u, v)
    assert (normals * ridge.normal[0]).sum(axis=1).mean() > 0
    np.testing.assert_allclose(ridge.distance(points), 0, atol=1e-9)
    for d in (0.2, -0.2):
        np.testing.assert_allclose(ridge.distance(points + d * normals), d, atol=1e-9)


def test_distance_is_nan_beyond_the_border_and_small_within(ridge):
    points = spiral_points()
    distance = ridge.distance(rf.Scan(points))
    assert distance.shape == (len(points),)
    radius = np.hypot(*points.T[:2])
    assert np.isnan(distance[radius < 10]).all()
    near = distance[~np.isnan(distance)]
    assert 500 < len(near) < len(points)
    assert np.median(np.abs(near)) * 1.4826 == pytest.approx(0.1, rel=0.15)


def test_distance_of_a_row_with_nan_is_nan(ridge):
    points = ridge.spine.copy()
    points[7] = np.nan
    distances = ridge.distance(points)
    assert np.isnan(distances[7]) and np.isfinite(distances[20])


def test_distance_takes_a_few_points(ridge):
    assert ridge.distance(ridge.spine[20:23]).shape == (3,)


# Nothing changes in place


@pytest.mark.parametrize("change", [{"h": 0}, {"height": 0.0}])
def test_a_height_made_zero_is_exact_also_where_its_deviation_was_infinite(ridge, change):
    std = ridge.height_std.copy()
    std[3] = np.inf
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        flat = replace(ridge, height_std=std).resized(**change)
        part = replace(ridge, height_std=std).resized(**change, between=(0.0, ridge.length / 2))
        twice = replace(ridge, height_std=std).resized(h=2)
    assert not flat.height.any() and not flat.height_std.any()
    assert not part.height_std[:4].any()
    np.testing.assert_array_equal(part.height_std[-4:], std[-4:])
    np.testing.assert_array_equal(twice.height_std, 2 * std)


def test_a_ridge_is_frozen_and_resizing_leaves_it_as_it_was(ridge):
    height, poles = ridge.height.copy(), ridge.surface().poles.copy()
    ridge.resized(h=3.0, w=0.5, between=(10.0, 50.0)).surface()
    np.testing.assert_array_equal(ridge.height, height)
    np.testing.assert_array_equal(ridge.surface().poles, poles)
    with pytest.raises(FrozenInstanceError):
        ridge.height = height


def test_the_arrays_of_a_ridge_cannot_be_written_to(ridge):
    fresh = replace(ridge)
    assert not any(
        getattr(fresh, name).flags.writeable for name in ("height", "width", "spine", "arc_length")
    )


def test_the_surface_is_made_once_and_read_only(ridge):
    assert ridge.surface() is ridge.surface()
    assert not ridge.surface().poles.flags.writeable


def test_the_summary_is_plain_and_agrees_with_the_ridge(ridge):
    summary = ridge.summary()
    assert summary["length"] == ridge.length
    assert summary["templates"] == len(ridge.templates)
    assert (summary["height_min"], summary["height_max"]) == (ridge.height.min(), ridge.height.max())
    assert (summary["stop_start"], summary["stop_end"]) == ridge.stop
    assert summary["noise"] == pytest.approx(0.1, rel=0.2)
