"""What `register` refuses, and how clearly it says why."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from oracles import apex, spiral_points, spiral_ridge

import ridgefeature as rf
from ridgefeature.io.feature import to_document

TOO_FEW = "at least 16 distinct"


def refuses(message: str, scan=None, at=None, **arguments) -> str:
    """`register` raises one ValueError with this message (not that there is no ridge)."""
    with pytest.raises(ValueError, match=message) as caught:
        rf.register(spiral_points() if scan is None else scan, apex() if at is None else at, **arguments)
    assert not isinstance(caught.value, rf.NoRidgeError)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# The scan


@pytest.mark.parametrize(
    ("scan", "message"),
    [
        (np.zeros((20, 2)), r"an \(n, 3\) array .* got shape \(20, 2\)"),
        (np.zeros((3, 20)), r"transpose"),
        (np.zeros((20, 3, 1)), r"an \(n, 3\) array"),
        (np.zeros(60), r"an \(n, 3\) array"),
        (np.array(5.0), r"an \(n, 3\) array"),
        (np.empty((0, 3)), "at least 16"),
        ([], r"an \(n, 3\) array"),
        ([[1, 2, 3], [4, 5]], r"an \(n, 3\) array"),
        ("clay.ply", "read_scan"),
        (np.full((20, 3), "x"), r"an \(n, 3\) array"),
        (np.random.default_rng(0).random((15, 3)), TOO_FEW),
        (np.ones((500, 3)), TOO_FEW),
        (np.repeat(np.eye(3), 100, axis=0), TOO_FEW),
        (np.outer(np.arange(100.0), [1.0, 2.0, 3.0]), "on one line"),
    ],
    ids=lambda x: None,
)
def test_a_scan_that_is_none_is_refused(scan, message):
    refuses(message, scan, at=(0.0, 0.0, 0.0))


@pytest.mark.filterwarnings("ignore:dropped")
def test_a_scan_of_nothing_finite_is_refused():
    refuses(TOO_FEW, np.full((100, 3), np.nan), at=(0.0, 0.0, 0.0))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_rows_that_are_not_finite_are_dropped_with_a_warning_and_change_nothing(bad):
    points = spiral_points()
    random = np.random.default_rng(7)
    rows = random.normal(size=(50, 3))
    rows[np.arange(50), random.integers(0, 3, 50)] = bad
    dirty = np.insert(points, np.sort(random.integers(0, len(points), 50)), rows, axis=0)
    with pytest.warns(UserWarning, match=f"dropped 50 of {len(points) + 50} points"):
        found = rf.register(dirty, apex())
    assert to_document(found) == to_document(spiral_ridge())


def test_a_clean_scan_gives_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rf.register(spiral_points(), apex())


# The pick


@pytest.mark.parametrize("at", [(0.0, 0.0, 500.0), (400.0, 0.0, 0.0), (0.0, 1e9, 0.0)])
def test_a_pick_away_from_the_scan_is_refused_with_its_distance(at):
    message = refuses("at: expected a point on or near the scan", at=at)
    distance = np.linalg.norm(spiral_points() - at, axis=1).min()
    assert f"{distance:.4g} from the nearest point" in message
    assert "pick a point of the scan" in message


@pytest.mark.parametrize(
    "at",
    [
        (np.nan, 0, 0),
        (0, np.inf, 0),
        (1, 2),
        (1, 2, 3, 4),
        [[1, 2, 3]],
        5.0,
        "abc",
        (),
        ("x", "y", "z"),
        {"x": 1},
    ],
)
def test_a_pick_that_is_no_point_is_refused(at):
    refuses("at: expected three finite numbers x, y, z", at=at)


# Guesses and limits


@pytest.mark.parametrize("name", ["width", "height", "roi", "max_templates"])
@pytest.mark.parametrize("value", [-1, 0, -0.5, np.nan, np.inf, "wide", [1.0, 2.0], 1j])
def test_sizes_that_are_not_above_zero_are_refused(name, value):
    refuses(f"{name}: expected a (whole )?number above 0, got", **{name: value})


def test_max_templates_is_a_whole_number():
    refuses("max_templates: expected a whole number above 0, got 2.5", max_templates=2.5)


def test_a_region_that_holds_too_few_points_is_refused():
    refuses("larger radius", roi=0.5)


@pytest.mark.parametrize("kind", ["bump", "", "Ridge", None, 3])
def test_an_unknown_kind_is_refused_with_the_known(kind):
    refuses("kind: expected one of ridge, groove, auto", kind=kind)


@pytest.mark.parametrize(
    ("direction", "message"),
    [
        ((0, 0, 0), "direction: .*zero"),
        ((np.nan, 0, 1), "direction: expected three finite"),
        ((1, 2), "direction: expected three finite"),
        ("north", "direction: expected three finite"),
    ],
)
def test_a_direction_that_is_none_is_refused(direction, message):
    refuses(message, direction=direction)


def test_a_direction_of_any_length_will_do():
    usual = rf.register(spiral_points(), apex(), direction=(1.0, 1.0, 0.0))
    for length in (1e-6, 1e6):
        found = rf.register(spiral_points(), apex(), direction=(length, length, 0.0))
        np.testing.assert_array_equal(found.height, usual.height)


def test_a_direction_along_the_normal_is_no_exception():
    with pytest.warns(UserWarning, match="direction: expected one along the ridge"):
        found = rf.register(spiral_points(), apex(), direction=(0.0, 0.0, 1.0))
    assert found.length == pytest.approx(spiral_ridge().length, rel=0.03)


@pytest.mark.parametrize(
    "bad", [{"loss": "nope"}, {"optimiser": "LD_NOPE"}, {"measure": "x"}, {"length": -1.0}]
)
def test_unknown_settings_are_refused_by_name(bad):
    with pytest.raises(ValueError, match=f"{next(iter(bad))}: expected .* got"):
        rf.register(spiral_points(), apex(), settings=rf.Settings(**bad))


def test_settings_of_another_type_are_refused():
    refuses("settings: expected", settings={"loss": "huber"})


# Anything else: a ridge or one clear error


def cloud(seed: int) -> np.ndarray:
    """Random points of many kinds: blobs, sheets, spikes, lattices, repeats, sizes from 1e-6 to 1e6."""
    random = np.random.default_rng(seed)
    n = int(random.integers(10, 800))
    points = random.normal(size=(n, 3)) if seed % 2 else random.uniform(-1, 1, (n, 3))
    points *= (
        10.0 ** random.integers(-2, 3, 3)
        if seed % 3 == 0
        else [1.0, 1.0, random.choice([0.0, 1e-9, 0.05, 0.5])]
    )
    if seed % 5 == 0:
        points = np.round(points, 1)
    if seed % 7 == 0:
        points = np.concatenate([points, points, 50 * points[:3]])
    if seed % 11 == 0:
        points[:, 2] += np.exp(-((points[:, 1] / 0.3) ** 2))
    return points * 10.0 ** random.integers(-6, 7) + random.choice([0.0, 1e3])


@given(st.integers(0, 10**7), st.sampled_from(["ridge", "groove", "auto"]))
@settings(max_examples=100, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
def test_any_points_give_a_ridge_or_a_value_error(seed, kind):
    points = cloud(seed)
    at = points[seed % len(points)]
    try:
        found = rf.register(points, at, kind=kind, max_templates=20)
    except ValueError as error:
        assert len(str(error)) > 20
        return
    assert found.length > 0 and (found.width > 0).all() and np.isfinite(found.height).all()
    assert all(found.stop) and len(found.templates) <= 20
    assert np.isfinite(found.surface().poles).all()


@pytest.mark.parametrize("kind", ["ridge", "groove"])
@pytest.mark.parametrize("first", [1200])
def test_a_groove_is_never_found_as_a_ridge_nor_a_ridge_as_a_groove(first, kind):
    wrong = []
    for seed in range(first, first + 40):
        points = cloud(seed)
        try:
            found = rf.register(points, points[seed % len(points)], kind=kind, max_templates=3)
        except ValueError:
            continue
        if ((found.height < 0) != (kind == "groove")).any():
            wrong.append((seed, float(found.height.min())))
    assert wrong == []
