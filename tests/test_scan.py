import pickle
import warnings
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ridgefeature.scan import MILLIMETRES, MIN_POINTS, Scan, Source, as_scan, millimetres_per


def cloud(n=200, seed=0):
    return np.random.default_rng(seed).normal(size=(n, 3))


def line(n=50):
    return np.linspace(0, 1, n)[:, None] * [1.0, 2.0, -0.7]


# What is kept


def test_points_are_shared_read_only_and_the_callers_array_stays_writeable():
    points = cloud()
    scan = Scan(points)
    assert np.shares_memory(scan.points, points)
    assert not scan.points.flags.writeable
    assert points.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        scan.points[0, 0] = 1


@pytest.mark.parametrize(
    "make",
    [
        lambda p: p.astype(np.float32),
        lambda p: np.asfortranarray(p),
        lambda p: p.astype(">f8"),
        lambda p: p[::-1],
        lambda p: p.tolist(),
        lambda p: (p * 1000).astype(np.int16),
    ],
)
def test_other_layouts_become_float64_in_c_order(make):
    given_points = make(cloud())
    scan = as_scan(given_points)
    assert scan.points.dtype == np.dtype("=f8")
    assert scan.points.flags.c_contiguous and scan.points.flags.aligned
    np.testing.assert_array_equal(scan.points, np.asarray(given_points, dtype=np.float64))


def test_read_only_input_is_accepted():
    points = cloud()
    points.flags.writeable = False
    assert len(as_scan(points)) == 200


def test_a_scan_passes_through_with_its_unit():
    scan = Scan(cloud(), "in")
    assert as_scan(scan) is scan
    assert as_scan(cloud(), "cm").unit == "cm"


def test_bounds_len_and_repr():
    points = cloud()
    scan = Scan(points, "m", Source("clay.ply", "00"))
    np.testing.assert_array_equal(scan.bounds, [points.min(axis=0), points.max(axis=0)])
    assert not scan.bounds.flags.writeable
    assert len(scan) == 200
    assert repr(scan) == "Scan(200 points in m, from clay.ply)"


def test_a_scan_is_frozen_and_replaceable():
    scan = Scan(cloud())
    with pytest.raises(FrozenInstanceError):
        scan.unit = "m"
    other = replace(scan, unit="m")
    assert other.unit == "m" and scan.unit == "mm"
    assert np.shares_memory(other.points, scan.points)


def test_pickle_keeps_points_and_unit():
    scan = Scan(cloud(), "cm", Source("a.xyz", "ff"))
    back = pickle.loads(pickle.dumps(scan))
    np.testing.assert_array_equal(back.points, scan.points)
    assert (back.unit, back.source) == ("cm", scan.source)


# What is dropped


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e200])
def test_rows_that_are_not_finite_are_dropped_with_a_warning(bad):
    points = cloud()
    points[[0, 7, 199], [0, 1, 2]] = bad
    with pytest.warns(UserWarning, match="dropped 3 of 200 points"):
        scan = Scan(points)
    np.testing.assert_array_equal(scan.points, np.delete(points, [0, 7, 199], axis=0))
    assert np.isfinite(scan.bounds).all()
    assert not scan.points.flags.writeable


def test_masked_rows_are_dropped():
    points = np.ma.masked_array(cloud(), mask=False)
    points[5, 1] = np.ma.masked
    with pytest.warns(UserWarning, match="dropped 1 of 200"):
        assert len(as_scan(points)) == 199


def test_clean_points_give_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(Scan(cloud())) == 200


# What is refused


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (None, "got NoneType"),
        ("clay.ply", "read_scan"),
        (b"clay.ply", "read_scan"),
        ({}, "got dict"),
        (3.0, r"got shape \(\)"),
        ([], r"got shape \(0,\)"),
        (np.zeros((0, 3)), "got 0"),
        (np.zeros(30), r"got shape \(30,\)"),
        (np.zeros((30, 2)), r"got shape \(30, 2\)"),
        (np.zeros((30, 6)), r"points\[:, :3\]"),
        (np.zeros((3, 30)), "transpose"),
        (np.zeros((5, 6, 3)), r"got shape \(5, 6, 3\)"),
        ([[1, 2, 3], [1, 2]], "different lengths"),
        (np.ones((30, 3), complex), "complex128"),
        (np.ones((30, 3), bool), "bool"),
        (np.ones((30, 3), object), "object"),
        (np.full((30, 3), "1"), "<U1"),
        (np.full((30, 3), np.datetime64("2020-01-01")), "datetime64"),
        (cloud(MIN_POINTS - 1), "got 15"),
        (np.ones((30, 3)), "16 distinct finite points; got 1"),
        (np.repeat(cloud(15), 4, axis=0), "got 15"),
        (line(), "on one line"),
    ],
)
@pytest.mark.parametrize("make", [Scan, as_scan])
def test_bad_points_are_refused_with_one_clear_error(make, points, words):
    with pytest.raises(ValueError, match=words) as caught:
        make(points)
    assert "\n" not in str(caught.value)


def test_only_nan_is_refused():
    """One error says it: a warning beside it would say the same."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ValueError, match="got 30 that are not finite"):
            Scan(np.full((30, 3), np.nan))


def test_a_bad_source_is_refused():
    with pytest.raises(ValueError, match="source"):
        Scan(cloud(), source="clay.ply")


def test_sixteen_points_are_enough():
    assert len(Scan(cloud(MIN_POINTS))) == MIN_POINTS


def test_one_point_off_the_line_is_enough_wherever_it_stands():
    for i in (0, 1, 25, 49):
        points = line()
        points[i] += [0.1, 0, 0]
        assert len(Scan(points)) == 50


@pytest.mark.parametrize("i", [0, 100, 199])
def test_a_wild_point_does_not_make_a_scan_a_line(i):
    points = cloud()
    points[i] = 1e8
    assert len(Scan(points)) == 200


scales = st.sampled_from([1e-6, 1e-3, 1.0, 1e3, 1e6])
offsets = st.sampled_from([0.0, 1.0, -1e3, 1e6])
seeds = st.integers(0, 2**32 - 1)


@given(scale=scales, offset=offsets, seed=seeds)
@settings(deadline=None)
def test_points_on_a_line_are_found_at_any_scale_and_offset(scale, offset, seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (60, 1)) * rng.normal(size=3) * scale + offset * scale * rng.normal(size=3)
    with pytest.raises(ValueError, match="line"):
        Scan(points)


@given(scale=scales, offset=offsets, seed=seeds)
@settings(deadline=None)
def test_a_thin_strip_is_a_surface_at_any_scale_and_offset(scale, offset, seed):
    rng = np.random.default_rng(seed)
    strip = rng.uniform(-1, 1, (60, 3)) * [10, 0.01, 0] @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    scan = Scan((strip + offset) * scale)
    assert len(scan) == 60


# Units


@pytest.mark.parametrize(
    ("unit", "mm"),
    [("um", 0.001), ("mm", 1), ("cm", 10), ("m", 1000), ("km", 1e6), ("in", 25.4), ("ft", 304.8)],
)
def test_millimetres_per_unit(unit, mm):
    assert millimetres_per(unit) == pytest.approx(mm, rel=1e-15)
    assert Scan(cloud(), unit).unit == unit


@pytest.mark.parametrize("unit", ["furlong", "MM", "", None, 1, ["mm"]])
def test_unknown_units_are_refused_and_the_known_ones_listed(unit):
    with pytest.raises(ValueError, match=", ".join(MILLIMETRES)):
        millimetres_per(unit)
    with pytest.raises(ValueError, match="expected a length unit"):
        as_scan(cloud(), unit)


# crop


@given(seed=seeds, radius=st.floats(0.8, 3))
@settings(deadline=None)
def test_crop_keeps_exactly_the_points_in_the_ball_in_order(seed, radius):
    points = cloud(500, seed)
    scan = Scan(points, "cm", Source("a.xyz", "ff"))
    cropped = scan.crop((0, 0.1, 0), radius)
    inside = points[((points - [0, 0.1, 0]) ** 2).sum(axis=1) <= radius**2]
    np.testing.assert_array_equal(cropped.points, inside)
    assert (cropped.unit, cropped.source) == (scan.unit, scan.source)


def test_crop_says_how_far_the_nearest_point_is():
    plane = np.array([(x, y, 0) for x in range(10) for y in range(10)], float)
    with pytest.raises(ValueError, match=r"found 0; the nearest point is 7 mm away"):
        Scan(plane).crop((4, 4, 7), 2)


def test_crop_of_points_on_a_line_is_refused():
    points = np.concatenate([line() * 10, [[0.0, 0.0, 1000.0]]])
    with pytest.raises(ValueError, match="on one line"):
        Scan(points).crop((0, 0, 0), 100)


@pytest.mark.parametrize(
    "at", [None, "here", (1, 2), (1, 2, 3, 4), (1, 2, np.nan), [[1, 2, 3]], (1, 2, "z"), [1, [2]]]
)
def test_crop_refuses_a_bad_point(at):
    with pytest.raises(ValueError, match="point of three"):
        Scan(cloud()).crop(at, 1)


@pytest.mark.parametrize("radius", [0, -1, np.nan, np.inf, None, "2", True])
def test_crop_refuses_a_bad_radius(radius):
    with pytest.raises(ValueError, match="radius above 0"):
        Scan(cloud()).crop((0, 0, 0), radius)
