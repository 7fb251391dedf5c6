"""The cross-section of a ridge, and a template as the B-spline patch that it is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import section_values, template_at
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from ridgefeature import Section, Template
from ridgefeature.kernels.smeared import smeared
from ridgefeature.learn import in_doubt
from ridgefeature.merge import LEAST_BORDER, section_knots, section_poles, template_surface
from ridgefeature.section import SECTIONS as NAMED
from ridgefeature.section import bell, plateau

SECTIONS = [bell(), plateau(), Section([0.2, 1.0, 0.7, 0.1]), Section([-0.1, 2.0, 0.4])]


@pytest.mark.parametrize("section", SECTIONS, ids=lambda s: f"{s.name}{len(s.coefficients)}")
class TestSection:
    def test_is_zero_with_zero_slope_and_curvature_at_both_feet(self, section):
        feet = np.array([-0.5, 0.5])
        inner = feet * (1 - 1e-12)
        for derivative, size in ((0, 1e-15), (1, 1e-14), (2, 1e-8)):
            assert np.abs(section(feet, derivative)).max() == 0
            assert np.abs(section(inner, derivative)).max() < size

    def test_is_zero_beyond_the_feet(self, section):
        beyond = np.array([-np.inf, -7.0, -0.5 - 1e-12, 0.5 + 1e-12, 7.0, np.inf])
        with np.errstate(invalid="ignore"):
            assert not section(beyond[1:-1]).any()

    def test_has_its_apex_at_one(self, section):
        eta = np.linspace(-0.5, 0.5, 100001)
        assert section(eta).max() == pytest.approx(1.0, abs=1e-9)
        assert section(eta).max() <= 1 + 1e-12

    def test_is_the_b_spline_of_its_coefficients(self, section):
        eta = np.linspace(-0.499999, 0.499999, 777)
        for derivative in range(3):
            expected = section_values(section, eta, derivative)
            np.testing.assert_allclose(section(eta, derivative), expected, atol=1e-9)

    def test_derivatives_are_those_of_differences(self, section):
        eta, step = np.linspace(-0.6, 0.6, 501), 1e-5
        for derivative in range(2):
            ends = section(eta + step, derivative), section(eta - step, derivative)
            slope = (ends[0] - ends[1]) / (2 * step)
            np.testing.assert_allclose(section(eta, derivative + 1), slope, atol=2e-2 if derivative else 1e-5)

    def test_half_height_width_spans_the_outer_crossings_of_one_half(self, section):
        eta = np.linspace(-0.5, 0.5, 2001)
        signs = np.flatnonzero(np.diff(section(eta) > 0.5))
        roots = [
            brentq(lambda e: float(section(e)) - 0.5, eta[i], eta[i + 1], xtol=1e-14)
            for i in (signs[0], signs[-1])
        ]
        assert section.half_height_width == pytest.approx(roots[1] - roots[0], abs=1e-10)

    def test_keeps_the_shape_of_its_argument(self, section):
        assert section(0.1).shape == ()
        assert section(np.zeros((2, 3, 4))).shape == (2, 3, 4)
        assert section([]).shape == (0,)

    def test_cannot_be_changed(self, section):
        for array in (section.coefficients, section.table):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 2


def test_the_bell_is_the_cubic_basis_function():
    assert bell()(0.0) == 1
    assert bell()(0.25) == pytest.approx(0.25)  # 1/6 over 4/6
    assert bell() is bell()


def test_the_plateau_has_half_height_at_half_width():
    assert plateau().half_height_width == pytest.approx(0.5, abs=1e-12)
    assert plateau()(0.0) == pytest.approx(1.0, abs=1e-15)


@given(st.lists(st.floats(0.01, 10.0), min_size=1, max_size=8))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_any_positive_coefficients_make_a_section_with_its_apex_at_one(coefficients):
    values = Section(np.array(coefficients))(np.linspace(-0.5, 0.5, 4001))
    assert values.max() == pytest.approx(1, abs=1e-4)
    assert values.min() >= 0


@pytest.mark.parametrize("coefficients", [[1.0], [0.2, 1.0, 0.7, 0.1], [1.0, 2.0], [-0.1, 2.0, 0.4]])
def test_only_the_ratio_of_the_coefficients_counts(coefficients):
    one, other = Section(np.array(coefficients)), Section(96.7 * np.array(coefficients))
    np.testing.assert_allclose(one.coefficients, other.coefficients, rtol=1e-12)


def test_only_the_ratio_of_a_plateaus_coefficients_counts():
    other = Section(3.125 * 30.94698586455003 * np.ones(3))
    np.testing.assert_allclose(other.coefficients, plateau().coefficients, rtol=1e-12)


@pytest.mark.parametrize(
    "bad", [[], [0.0], [-1.0, -2.0], [np.nan], [1.0, np.inf], [[1.0, 2.0]], 3.0], ids=str
)
def test_bad_coefficients_are_refused_with_what_was_expected(bad):
    with pytest.raises(ValueError, match="section coefficients: expected one or more finite numbers"):
        Section(bad)


# The template as a patch


@pytest.mark.parametrize("section", SECTIONS, ids=lambda s: f"{s.name}{len(s.coefficients)}")
@pytest.mark.parametrize("height", [3.0, -1.5])
def test_the_template_patch_is_the_section_over_the_base(section, height):
    width = 8.0
    template = template_at(height, width, (10, -20, 5), (0.3, -0.6, 1.1), section)
    surface = template_surface(template)
    u = np.linspace(*surface.domain[0], 9)
    v = np.linspace(-0.5, 0.5, 201)
    local = (surface.on_grid(u, v) - template.position) @ template.rotation
    y = np.broadcast_to(v * width, local.shape[:2])
    np.testing.assert_allclose(
        local[..., 0], np.broadcast_to(u[:, None] - 0.5 * template.length, y.shape), atol=1e-12
    )
    np.testing.assert_allclose(local[..., 1], y, atol=1e-12)
    np.testing.assert_allclose(local[..., 2], height * section(y / width), atol=1e-12)


def test_the_flanks_of_the_template_patch_are_flat_and_reach_the_border():
    template = template_at(3.0, 8.0, (1, 2, 3), (0.1, 0.2, 0.3))
    surface = template_surface(template)
    (u0, u1), (v0, v1) = surface.domain
    for side in (np.linspace(v0, -0.5, 30), np.linspace(0.5, v1, 30)):
        local = (surface.on_grid(np.linspace(u0, u1, 5), side) - template.position) @ template.rotation
        assert np.abs(local[..., 2]).max() < 1e-12
        assert (np.diff(local[..., 1], axis=1) > 0).all()
    edges = (surface(np.array([u0, u0]), np.array([v0, v1])) - template.position) @ template.rotation
    np.testing.assert_allclose(edges[:, 1], [-template.half_breadth, template.half_breadth], atol=1e-12)
    assert template.half_breadth > LEAST_BORDER * template.width


def test_the_first_and_last_row_are_start_and_end():
    template = template_at(3.0, 8.0, (1, 2, 3), (0.1, 0.2, 0.3))
    crest = template_surface(template)(np.array([0.0, template.length]), np.zeros(2))
    foot = crest - template.height * template.rotation[:, 2]
    np.testing.assert_allclose(foot, [template.start, template.end], atol=1e-12)


def test_the_knots_across_break_at_feet_and_between():
    for section in SECTIONS:
        knots, (across, raised) = section_knots(section), section_poles(section)
        assert len(knots) == len(across) + 4 == len(raised) + 4
        np.testing.assert_allclose(np.unique(knots)[1:-1], np.linspace(-0.5, 0.5, section.spans + 1))
        assert np.count_nonzero(raised) <= len(section.coefficients)


def test_changed_is_what_replace_gives():
    template = template_at()
    turn = Rotation.from_rotvec([0, 0, 1]).as_matrix()
    other = template.changed(height=2.0, rotation=turn)
    assert (other.height, other.width, template.height) == (2.0, 8.0, 3.0)
    np.testing.assert_array_equal(other.rotation, turn)
    with pytest.raises(AttributeError):
        other.height = 1.0


def test_a_flat_template_among_others_does_not_hinder_the_choice_of_the_section():
    flat = Template(np.zeros(3), np.eye(3), 8.0, 0.0, 6.0, 2.0, bell(), scale=0.1)
    misfit = np.array([np.full(16, 100.0), np.full(16, 50.0)])
    assert not in_doubt(misfit, (flat,))
    assert in_doubt(misfit, (flat, flat.changed(height=3.0)))


def test_a_template_changes_its_own_fields_alone():
    t = Template(np.zeros(3), np.eye(3), 8.0, 3.0, 6.4, 2.4, bell())
    assert t.changed(width=9.0).width == 9.0 and t.width == 8.0
    with pytest.raises(TypeError, match="widht"):
        t.changed(widht=9.0)


@pytest.mark.parametrize("name", sorted(NAMED))
def test_sections_with_a_name_are_symmetric_to_the_last_bit(name):
    section = NAMED[name]()
    assert section.symmetric
    lopsided = section.coefficients.copy()
    lopsided[0] *= 1 + 1e-12
    assert len(lopsided) == 1 or not Section(lopsided).symmetric


@pytest.mark.parametrize("even", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("blur", [0.01, 0.1])
@pytest.mark.parametrize("name", sorted(NAMED))
def test_half_of_a_smeared_symmetric_section_tells_the_other_half(name, blur, even):
    section, noise, steep = NAMED[name](), np.full(3, blur), np.linspace(0.1, 1.5, 3)
    places = np.linspace(-4, 4, 31)
    shares = np.exp(-0.5 * places**2)
    rule = places, shares / shares.sum()
    half, whole = (smeared(section.table, noise, steep, even, *rule, 0.8, 220, x) for x in (True, False))
    np.testing.assert_allclose(half, whole, atol=1e-9)
    bare = smeared(section.table, noise, steep, even, *rule, 0.8, 220, True)
    np.testing.assert_array_equal(bare[:, ::-1, 0], bare[:, :, 0])


@pytest.mark.parametrize("name", sorted(NAMED))
def test_the_top_of_a_section_is_what_is_higher_than_four_fifths(name):
    section = NAMED[name]()
    low, high = section.top
    eta = np.linspace(-0.5, 0.5, 999)
    above = section(eta) > 0.8
    assert (above == ((eta > low) & (eta < high)))[np.abs(np.abs(eta) - high) > 1e-3].all()
    assert low == pytest.approx(-high)
