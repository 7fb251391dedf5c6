"""Surfaces that fold over themselves are told of."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
from made_ridges import made_ridge

import cad_export as cx
import ridgefeature as rf
from ridgefeature import diagnosis
from ridgefeature.folds import WHY, folds, with_folds


def hooked(radius: float, start: float = 50.0) -> rf.Ridge:
    """A straight ridge with borders of 6 whose last 10 mm turn sideways on an arc."""
    ridge = made_ridge(k=241)
    angle = np.maximum(ridge.arc_length - start, 0) / radius
    zero, bent = 0 * angle, angle > 0
    x = np.where(bent, start + radius * np.sin(angle), ridge.arc_length)
    spine = np.stack([x, radius * (1 - np.cos(angle)), zero], axis=1)
    tangent = np.stack([np.cos(angle), np.sin(angle), zero], axis=1)
    return replace(ridge, spine=spine, tangent=tangent)


def silent(ridge: rf.Ridge, path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cx.step(ridge, path)
        cx.face(ridge)


@pytest.mark.parametrize("radius", [8.0, 20.0])
def test_bends_wider_than_the_flanks_do_not_fold(radius: float, tmp_path: Path) -> None:
    assert folds(hooked(radius)) == ()
    silent(hooked(radius), tmp_path / "x.step")


def test_steep_flanks_do_not_fold(tmp_path: Path) -> None:
    steep = made_ridge(height=40.0, width=2.0, bend=0.1)
    assert folds(steep) == ()
    silent(steep, tmp_path / "x.step")


def test_a_bend_sharper_than_the_flanks_is_told(tmp_path: Path) -> None:
    ridge = hooked(4.0)
    ((low, high),) = folds(ridge)
    assert low == pytest.approx(50, abs=1) and high == pytest.approx(60, abs=0.1)
    for export in (
        lambda: cx.step(ridge, tmp_path / "x.step"),
        lambda: cx.face(ridge, h=1.5),
        lambda: cx.write(ridge, tmp_path / "x.stl"),
    ):
        with pytest.warns(UserWarning, match=f"{WHY} at arc length .* to 60 mm") as caught:
            export()
        assert len(caught) == 1
    # which nothing else tells
    assert cq.importers.importStep(str(tmp_path / "x.step")).val().isValid()


def test_it_is_in_doubt_in_the_summary(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(diagnosis, "_fits", lambda *_: ())  # made ridges have no templates
    ridge, rng = hooked(4.0), np.random.default_rng(0)
    points = ridge.surface().grid(400, 60).reshape(-1, 3)
    found = rf.diagnose(ridge, points + rng.normal(scale=0.02, size=points.shape))
    ((low, high, _),) = [doubt for doubt in found.doubts if doubt[2] == WHY]
    assert (low, high) == pytest.approx(folds(ridge)[0])
    assert list(found.doubts) == sorted(found.doubts)


def test_the_size_of_the_unit_does_not_matter() -> None:
    ridge, factor = hooked(4.0), 1e-3
    lengths = {n: factor * getattr(ridge, n) for n in ("arc_length", "spine", "height", "width", "border")}
    np.testing.assert_allclose(folds(replace(ridge, **lengths)), factor * np.array(folds(ridge)))


def test_a_doubt_of_the_whole_ridge_stays_first() -> None:
    ridge = hooked(3.0)
    whole, part = (0.0, ridge.length, "missed"), (0.0, 4.0, "unseen")
    found = with_folds((whole, part), ridge)
    assert found[:2] == (whole, part) and found[2][2] == WHY


def test_what_cannot_be_pasted_for_its_own_fold_says_so_and_goes_where_it_is_cut() -> None:
    ridge, host = hooked(4.0), cq.Workplane().box(200, 200, 20)
    with pytest.raises(
        ValueError, match=r"folds over itself at arc length .* to 60 mm; cut it there"
    ) as told:
        cx.paste(ridge, host, face=">Z")
    assert told.value.__cause__ is not None
    cut = ridge.stretched(49.0, "trim")
    assert folds(cut) == () and cx.paste(cut, host, face=">Z").isValid()
    with pytest.raises(ValueError, match="leaves the face") as other:
        cx.paste(cut, host, face=">Z", at=(99.0, 99.0, 10.0))
    assert "folds" not in str(other.value)
