"""The FreeCAD macro: its data, and its plain Python without FreeCAD."""

from __future__ import annotations

import ast
import dataclasses
import json
import math
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from freecad_stub import StubObject, run_stubbed
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import spiral_ridge

import ridgefeature as rf
from cad_export.freecad import write_macro
from cad_export.freecad.affine import affine_poles
from ridgefeature.io.feature import to_document

BAD_WIDTHS = (0.0, -1.0, math.nan, math.inf, 50.0)


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge()


@pytest.fixture(scope="module")
def macro(ridge, tmp_path_factory) -> Path:
    return write_macro(ridge, tmp_path_factory.mktemp("macro") / "spiral.FCMacro")


@pytest.fixture(scope="module")
def stub(macro) -> StubObject:
    return run_stubbed(macro).Objects[0]


def shape_at(stub: StubObject, h: float, w: float) -> Any:
    stub.Height, stub.Width = h, w
    stub.Proxy.execute(stub)
    return stub.Shape


def test_the_macro_needs_nothing_but_freecad_and_the_standard_library(macro):
    tree = ast.parse(macro.read_text(encoding="ascii"))
    names = [a.name for node in tree.body if isinstance(node, ast.Import) for a in node.names]
    assert not [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert {"FreeCAD", "Part"} < set(names)
    assert set(names) - {"FreeCAD", "Part"} <= sys.stdlib_module_names
    head = ast.get_docstring(tree)
    assert head is not None and len(head.splitlines()) == 3
    assert "menu Macro" in head and "freecadcmd" in head


@given(h=st.floats(-5, 5), w=st.floats(0.05, 1.7))
@settings(max_examples=30, deadline=None)
def test_the_macro_makes_the_ridges_own_poles(ridge, stub, h, w):
    surface = ridge.resized(h=h, w=w).surface()
    poles, *rest = shape_at(stub, h, w)
    size = np.abs(surface.poles).max()
    np.testing.assert_allclose(poles, surface.poles, rtol=0, atol=1e-12 * size)
    counts_u, counts_v, knots_u, knots_v, *periodic, degree_u, degree_v = rest
    np.testing.assert_array_equal(np.repeat(knots_u, counts_u), surface.knots_u)
    np.testing.assert_array_equal(np.repeat(knots_v, counts_v), surface.knots_v)
    assert (degree_u, degree_v) == (surface.degree_u, surface.degree_v)
    assert periodic == [False, False]


def test_the_border_of_the_flanks_does_not_move(ridge):
    poles = affine_poles(ridge)
    for part in (poles.per_height, poles.per_width):
        assert (part[:, [0, -1]] == 0).all()
        assert (part != 0).any()


def test_the_box_grows_with_the_height(ridge, stub):
    heights = [np.ptp(np.array(shape_at(stub, h, 1.0)[0])[..., 2]) for h in (1.0, 2.0)]
    wanted = [np.ptp(ridge.resized(h=h).surface().poles[..., 2]) for h in (1.0, 2.0)]
    assert heights == pytest.approx(wanted, rel=1e-12)
    assert heights[1] > 1.8 * heights[0]


def test_what_resized_refuses_the_macro_refuses_and_keeps_the_shape(ridge, stub):
    largest = affine_poles(ridge).largest_width
    good = shape_at(stub, 1.0, largest * (1 - 1e-9))
    ridge.resized(w=largest * (1 - 1e-9))
    for w in (*BAD_WIDTHS, largest * (1 + 1e-9)):
        with pytest.raises(ValueError):
            ridge.resized(w=w)
        with pytest.raises(ValueError, match="Width: expected a rate above 0 and at most"):
            shape_at(stub, 1.0, w)
        assert stub.Shape is good
    for h in (math.nan, math.inf, -math.inf):
        with pytest.raises(ValueError):
            ridge.resized(h=h)
        with pytest.raises(ValueError, match="Height: expected a finite rate"):
            shape_at(stub, h, 1.0)
        assert stub.Shape is good


def test_poles_are_in_millimetres_also_far_from_the_origin(ridge, tmp_path):
    for unit, factor, offset in (("cm", 10.0, 0.0), ("in", 25.4, 3e5), ("um", 1e-3, -40.0)):
        other = dataclasses.replace(ridge, unit=unit, spine=ridge.spine + offset)
        stub = run_stubbed(write_macro(other, tmp_path / "unit.FCMacro")).Objects[0]
        wanted = factor * other.resized(h=-2, w=0.3).surface().poles
        np.testing.assert_allclose(
            shape_at(stub, -2, 0.3)[0], wanted, rtol=0, atol=1e-12 * np.abs(wanted).max()
        )


def test_the_macro_carries_the_feature_and_its_source(ridge, tmp_path):
    hash_ = "0123456789abcdef" * 4
    name = 'it\'s """odd""" $data \\\' ü.ply'
    known = dataclasses.replace(ridge, source=rf.scan.Source(name, hash_))
    for one, words in ((ridge, "unknown"), (known, f"{name}, SHA-256 {hash_}")):
        stub = run_stubbed(write_macro(one, tmp_path / "source.FCMacro")).Objects[0]
        assert json.loads(stub.RidgeFeature) == json.loads(json.dumps(to_document(one)))
        assert stub.RidgeSource == words
        assert set(stub.tips) == {"Height", "Width", "RidgeSource", "RidgeFeature", "RidgeSurface"}
        assert all(stub.tips.values())


def test_a_second_run_adds_nothing_and_another_ridge_adds_itself(ridge, macro, tmp_path):
    document = run_stubbed(macro)
    document.Objects[0].Width = 1.25
    document.Objects[0].Proxy = None  # as after opening a document
    assert len(run_stubbed(macro, document).Objects) == 1
    assert document.Objects[0].Width == 1.25 and document.Objects[0].Proxy is not None
    other = write_macro(ridge.resized(h=1.5), tmp_path / "other.FCMacro")
    assert len(run_stubbed(other, document).Objects) == 2
    assert len(run_stubbed(macro, document).Objects) == 2


def test_writing_is_the_same_every_time_and_leaves_one_file(ridge, macro, tmp_path):
    path = write_macro(ridge, str(tmp_path / "again.fcmacro"))
    assert path.read_bytes() == macro.read_bytes()
    write_macro(ridge.resized(h=2), path)
    assert path.read_bytes() != macro.read_bytes()
    assert [p.name for p in tmp_path.iterdir()] == ["again.fcmacro"]


def test_bad_input_is_one_clear_error(ridge, tmp_path):
    for other in (None, "ridge.json", ridge.surface(), float("nan")):
        with pytest.raises(ValueError, match="expected a Ridge, got"):
            write_macro(other, tmp_path / "x.FCMacro")
    for name in ("x.py", "x", "FCMacro"):
        with pytest.raises(ValueError, match=r"ends in \.FCMacro"):
            write_macro(ridge, tmp_path / name)
    with pytest.raises(OSError, match="create it first"):
        write_macro(ridge, tmp_path / "missing" / "x.FCMacro")
    (tmp_path / "taken.FCMacro").mkdir()
    with pytest.raises(OSError):
        write_macro(ridge, tmp_path / "taken.FCMacro")
    assert [p.name for p in tmp_path.iterdir()] == ["taken.FCMacro"]


def test_a_ridge_whose_poles_are_not_affine_is_refused(ridge):
    class Bent(rf.Ridge):
        def surface(self) -> Any:
            surface = super().surface()
            return SimpleNamespace(poles=surface.poles * (1 + 1e-9 * self.height.max() ** 2))

    bent = Bent(**{f.name: getattr(ridge, f.name) for f in dataclasses.fields(ridge)})
    with pytest.raises(ValueError, match="affine in h and w"):
        affine_poles(bent)
