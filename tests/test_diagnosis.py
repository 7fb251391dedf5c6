"""What a scan says of the ridge that was registered in it: where to trust it, and how far."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import ridgefeature as rf
from ridgefeature import diagnosis, plot
from ridgefeature.kernels.algebra import rotation_of
from ridgefeature.readable import rows
from ridgefeature.synthetic import Spiral

SPIRAL = Spiral()
NOISE = 0.1
Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def points() -> Array:
    return SPIRAL.points(15_000, NOISE, seed=3)


@pytest.fixture(scope="module")
def ridge(points: Array) -> rf.Ridge:
    return rf.register(points, (28.94, 7.906, 5.764))


@pytest.fixture(scope="module")
def found(ridge: rf.Ridge, points: Array) -> rf.Diagnosis:
    return rf.diagnose(ridge, points)


def test_a_good_ridge_leaves_nothing_but_the_noise(found: rf.Diagnosis) -> None:
    assert found.noise == pytest.approx(NOISE, rel=0.05)
    assert found.outliers < 0.003
    assert found.reduced_chi_square == pytest.approx(1, abs=0.12)
    assert found.coverage > 0.99
    assert found.doubts == ()


def test_every_point_over_the_surface_has_its_place_and_distance(
    ridge: rf.Ridge, points: Array, found: rf.Diagnosis
) -> None:
    expected = ridge.distance(points)
    assert len(found.deviation) == pytest.approx(np.isfinite(expected).sum(), rel=0.002)
    assert np.isin(found.deviation.round(9), expected.round(9)).mean() > 0.999
    assert (found.arc_length >= 0).all() and (found.arc_length <= ridge.length).all()
    border = np.interp(found.arc_length, ridge.arc_length, ridge.border)
    assert (np.abs(found.across) <= border).all()


def test_each_template_tells_how_its_fit_went(ridge: rf.Ridge, found: rf.Diagnosis) -> None:
    assert len(found.templates) == len(ridge.templates)
    for fit, template in zip(found.templates, ridge.templates, strict=True):
        assert (fit.status, fit.evaluations) == (template.status, template.evaluations)
        assert (fit.points, fit.inliers) == (template.points, template.inliers)
        assert (fit.M, fit.M_floor) == (template.M, template.M_floor)
        assert fit.deviation_rms == pytest.approx(NOISE, rel=0.35)


def test_strays_are_counted_and_left_out_of_the_noise(ridge: rf.Ridge, points: Array) -> None:
    on = np.flatnonzero(np.isfinite(ridge.distance(points)))
    random = np.random.default_rng(1)
    astray = random.choice(on, len(on) // 10, replace=False)
    moved = points.copy()
    moved[astray, 2] += random.choice([-1, 1], len(astray)) * random.uniform(1, 4, len(astray))
    found = rf.diagnose(ridge, moved)
    assert found.outliers == pytest.approx(0.1, abs=0.02)
    assert found.noise == pytest.approx(NOISE, rel=0.06)
    assert found.doubts == ()


def test_a_ridge_that_is_too_high_misses_its_points(ridge: rf.Ridge, points: Array) -> None:
    found = rf.diagnose(ridge.resized(h=1.15), points)
    assert found.reduced_chi_square > 3
    bump = rf.diagnose(ridge.resized(h=1.6, between=(60, 100)), points)
    assert bump.doubts
    for low, high, why in bump.doubts:
        assert 55 < low < high < 105 and "off the surface" in why


def test_a_stretch_without_points_is_in_doubt(ridge: rf.Ridge, points: Array) -> None:
    s, _ = SPIRAL.path_coordinates(points[:, :2])
    found = rf.diagnose(ridge, points[(s < 60) | (s > 90)])
    assert found.coverage == pytest.approx(1 - 30 / ridge.length, abs=0.04)
    places = (np.arange(len(found.seen)) + 0.5) / len(found.seen) * ridge.length
    assert not found.seen[(places > 64) & (places < 86)].any()
    assert found.seen[(places < 56) | (places > 94)].mean() > 0.99
    ((low, high, why),) = found.doubts
    assert low == pytest.approx(60, abs=4) and high == pytest.approx(90, abs=4) and "seen" in why


def test_a_stretch_whose_height_is_not_known_is_in_doubt(ridge: rf.Ridge, points: Array) -> None:
    loose = np.where(ridge.arc_length > 120, 2.0 * ridge.height, ridge.height_std)
    ((low, high, why),) = rf.diagnose(replace(ridge, height_std=loose), points).doubts
    assert low == pytest.approx(120, abs=5) and high == ridge.length and "known" in why


def test_it_does_not_depend_on_order_place_or_unit(
    ridge: rf.Ridge, points: Array, found: rf.Diagnosis
) -> None:
    shuffled = rf.diagnose(ridge, np.random.default_rng(0).permutation(points))
    assert shuffled.coverage == found.coverage
    assert shuffled.noise == pytest.approx(found.noise, rel=1e-9)
    assert shuffled.reduced_chi_square == pytest.approx(found.reduced_chi_square, rel=1e-9)
    turn, _ = rotation_of(np.array([0.4, -1.1, 0.7]))
    moved = replace(
        ridge,
        spine=1000 * (ridge.spine @ turn.T),
        tangent=ridge.tangent @ turn.T,
        normal=ridge.normal @ turn.T,
        **{
            name: 1000 * getattr(ridge, name)
            for name in ("arc_length", "height", "width", "height_std", "width_std", "border")
        },
        half_height_width_std=1000 * ridge.half_height_width_std,
        curvature=ridge.curvature / 1000,
        templates=tuple(
            t.changed(
                position=1000 * (turn @ t.position),
                rotation=turn @ t.rotation,
                length=1000 * t.length,
                flank=1e3,
            )
            for t in ridge.templates
        ),
    )
    there = rf.diagnose(moved, 1000 * (points @ turn.T))
    assert there.noise == pytest.approx(1000 * found.noise, rel=1e-6)
    assert there.reduced_chi_square == pytest.approx(found.reduced_chi_square, rel=0.02)
    assert there.coverage == pytest.approx(found.coverage, abs=1e-3)
    assert len(there.templates) == len(found.templates)


def test_of_very_many_points_some_tell_the_same(
    ridge: rf.Ridge, points: Array, found: rf.Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(diagnosis, "MOST", 5000)
    some, again = rf.diagnose(ridge, points), rf.diagnose(ridge, points)
    assert 1000 < len(some.deviation) < 0.5 * len(found.deviation)
    assert some.noise == pytest.approx(found.noise, rel=0.08)
    assert some.coverage > 0.99 and some.doubts == ()
    np.testing.assert_array_equal(some.deviation, again.deviation)


@pytest.mark.parametrize("scan", [np.full((20, 3), 1e5), np.array([[30.0, 0, 5]])])
def test_of_a_scan_elsewhere_nothing_is_known(scan: Array, ridge: rf.Ridge, tmp_path: Path) -> None:
    some = np.concatenate([scan, np.random.default_rng(0).normal(size=(20, 3)) + 1e5])
    found = rf.diagnose(ridge, some)
    assert found.coverage == 0 and np.isnan(found.noise) and np.isnan(found.reduced_chi_square)
    ((low, high, why),) = found.doubts
    assert (low, high) == (0, ridge.length) and "seen" in why
    plot.deviation(some, ridge, tmp_path / "d.png")
    assert (tmp_path / "d.png").stat().st_size > 10_000


@pytest.mark.parametrize("scan", [None, np.zeros((5, 2)), "scan", np.zeros((0, 3))])
def test_what_is_no_scan(scan: object, ridge: rf.Ridge) -> None:
    with pytest.raises(ValueError, match="scan"):
        rf.diagnose(ridge, scan)  # type: ignore[arg-type]


def test_the_summary_is_plain_and_says_all(found: rf.Diagnosis, ridge: rf.Ridge) -> None:
    told = json.loads(json.dumps(found.summary()))
    assert {"coverage", "outliers", "noise", "reduced_chi_square", "doubts", "templates"} == set(told)
    assert set(told["templates"][0]) == {
        *("arc_length", "status", "points", "inliers", "evaluations", "M", "M_floor", "deviation_rms")
    }
    names = [name for name, _ in rows(ridge, found)]
    assert names[:4] == ["coverage", "outliers", "noise level", "reduced chi-square"]
    assert {"start stopped because", "end stopped because", "in doubt"} < set(names)


def test_the_map_shows_the_deviations(
    ridge: rf.Ridge, points: Array, found: rf.Diagnosis, tmp_path: Path
) -> None:
    figure = plot.deviation(points, ridge, tmp_path / "d.png")
    from matplotlib.image import imread

    assert imread(tmp_path / "d.png").shape[:2] == (1000, 1700)
    dots = figure.axes[0].collections[0]
    at = np.asarray(dots.get_offsets())
    kept = ~found.stray
    np.testing.assert_array_equal(at, np.column_stack([found.arc_length[kept], found.across[kept]]))
    np.testing.assert_array_equal(np.asarray(dots.get_array()), found.deviation[kept])
    unseen = figure.axes[0].collections[1].get_array()
    np.testing.assert_array_equal(np.ma.getmaskarray(unseen).reshape(found.seen.shape), found.seen)
    feet = [line.get_ydata() for line in figure.axes[0].lines]
    assert any(np.array_equal(np.asarray(y), 0.5 * ridge.width) for y in feet)
    said = " ".join(text.get_text() for text in figure.texts)
    for name, _ in rows(ridge, found):
        assert name.upper() in said


def test_stretches_in_doubt_are_shaded(ridge: rf.Ridge, points: Array, tmp_path: Path) -> None:
    bump = ridge.resized(h=1.6, between=(60, 100))
    found = rf.diagnose(bump, points)
    figure = plot.deviation(points, bump, tmp_path / "d.png", found)
    for axes in figure.axes[:4]:
        shaded = [patch.get_extents().transformed(axes.transData.inverted()) for patch in axes.patches]
        spans = [(box.x0, box.x1) for box in shaded]
        for low, high, _ in found.doubts:
            assert any(np.allclose(span, (low, high)) for span in spans)
