"""The FreeCAD macro of ridges on curved bases: the ridge's own poles at any rates."""

from __future__ import annotations

import ast
import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from freecad_stub import StubObject, run_stubbed
from freecad_tools import needs_freecad, run_freecad
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import spiral_ridge

import ridgefeature as rf
from cad_export.freecad import write_macro
from cad_export.freecad.curved import LEAST_WIDTH
from ridgefeature.fitting import room_for_width
from ridgefeature.on_base import knot_changes

EXACT = 1e-12
"""Largest difference of poles, in parts of the largest coordinate."""


def spiral() -> rf.Ridge:
    """A spiral on a base that is hollow at its start and bulges at its end."""
    ridge = spiral_ridge()
    bend = 0.3 / ridge.border.max()
    return dataclasses.replace(ridge, curvature=bend * np.cos(3 * ridge.arc_length / ridge.length), unit="cm")


def slightly_bent() -> rf.Ridge:
    ridge = spiral_ridge()
    return dataclasses.replace(ridge, curvature=np.full_like(ridge.curvature, 1e-5))


def ring() -> rf.Ridge:
    """A closed ridge round a bulge."""
    angle = np.linspace(0.0, 2 * np.pi, 41)
    x, y, zero = np.cos(angle), np.sin(angle), np.zeros(41)
    frame = {
        "spine": 30.0 * np.column_stack([x, y, zero]),
        "tangent": np.column_stack([-y, x, zero]),
        "normal": np.column_stack([0.3 * x, 0.3 * y, 1 + zero]) / math.hypot(1.0, 0.3),
        "height": 2.0 + 0.3 * np.cos(2 * angle),
        "width": 7.0 + 0.5 * np.sin(angle),
        "curvature": -0.03 + 0.01 * np.cos(angle),
    }
    for values in frame.values():
        values[-1] = values[0]
    other = {
        name: np.full(41, 0.1) for name in ("height_std", "width_std", "half_height_width_std", "spine_std")
    }
    return dataclasses.replace(
        spiral_ridge(), arc_length=30.0 * angle, border=np.full(41, 9.0), closed=True, **frame, **other
    )


def largest(ridge: rf.Ridge) -> float:
    """The largest rate of the width."""
    return float(room_for_width(ridge).min())


RIDGES = {f.__name__: f for f in (spiral, slightly_bent, ring)}


@pytest.fixture(scope="module", params=RIDGES)
def made(request: Any, tmp_path_factory: Any) -> tuple[rf.Ridge, StubObject]:
    ridge = RIDGES[request.param]()
    macro = write_macro(ridge, tmp_path_factory.mktemp("macro") / "curved.FCMacro")
    return ridge, run_stubbed(macro).Objects[0]


def shape_at(stub: StubObject, h: float, w: float) -> Any:
    stub.Height, stub.Width = h, w
    stub.Proxy.execute(stub)
    return stub.Shape


def check(ridge: rf.Ridge, shape: Any, h: float, w: float) -> None:
    factor = rf.scan.millimetres_per(ridge.unit)
    surface = ridge.resized(h=h, w=w).surface()
    poles, counts_u, counts_v, knots_u, knots_v, *_ = shape
    np.testing.assert_array_equal(np.repeat(knots_u, counts_u), surface.knots_u)
    np.testing.assert_array_equal(np.repeat(knots_v, counts_v), surface.knots_v)
    wanted = factor * surface.poles
    np.testing.assert_allclose(poles, wanted, rtol=0, atol=EXACT * np.abs(wanted).max())


@given(h=st.floats(-5, 5), part=st.floats(0.001, 0.999))
@settings(max_examples=30, deadline=None)
def test_the_macro_makes_the_ridges_own_poles(made: Any, h: float, part: float) -> None:
    ridge, stub = made
    w = LEAST_WIDTH + part * (largest(ridge) - LEAST_WIDTH)
    check(ridge, shape_at(stub, h, w), h, w)


def test_knots_change_where_it_is_told(made: Any) -> None:
    ridge, stub = made
    changes = knot_changes(ridge, LEAST_WIDTH, largest(ridge))
    assert (np.diff(changes) > 0).all()
    for w in (*changes, 1.0):
        for rate in (w * (1 - 1e-9), w * (1 + 1e-9)):
            check(ridge, shape_at(stub, 1.5, rate), 1.5, rate)
    before, behind = (ridge.resized(w=changes[-1] * x).surface().knots_v for x in (1 - 1e-9, 1 + 1e-9))
    if np.abs(ridge.curvature).max() > 1e-3:
        assert not np.array_equal(before, behind)


def test_rates_that_it_cannot_make_are_refused_and_the_shape_stays(made: Any) -> None:
    ridge, stub = made
    good = shape_at(stub, 1.0, largest(ridge) * (1 - 1e-9))
    for w in (0.0, -1.0, LEAST_WIDTH, math.nan, largest(ridge) * (1 + 1e-9)):
        with pytest.raises(ValueError, match=f"Width: expected a rate above {LEAST_WIDTH:g} and at most"):
            shape_at(stub, 1.0, w)
        assert stub.Shape is good
    assert f"above {LEAST_WIDTH:g}" in stub.tips["Width"]


def test_numpy_is_all_that_it_needs_besides_and_only_there(tmp_path: Any) -> None:
    tree = ast.parse(write_macro(spiral(), tmp_path / "x.FCMacro").read_text(encoding="ascii"))
    inner = {
        a.name
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef)
        for node in ast.walk(function)
        if isinstance(node, ast.Import)
        for a in node.names
    }
    assert inner == {"numpy"}


@needs_freecad
@pytest.mark.parametrize("name", RIDGES)
def test_freecad_makes_the_surface_again_at_other_rates(name: str, tmp_path: Any) -> None:
    ridge = RIDGES[name]()
    macro = write_macro(ridge, tmp_path / "x.FCMacro")
    script = """
import FreeCAD
exec(compile(open(macro).read(), "macro", "exec"), {"__name__": "__main__"})
document = FreeCAD.ActiveDocument
ridge, result = document.getObject("Ridge"), []
for ridge.Height, ridge.Width in rates:
    document.recompute()
    spline = ridge.Shape.Faces[0].Surface
    poles = [[list(p) for p in row] for row in spline.getPoles()]
    result.append([ridge.Shape.isValid(), ridge.getStatusString(), poles])
result = {"all": result}
"""
    rates = [[1.0, 1.0], [2.0, 0.6], [-1.0, 1.2]]
    factor = rf.scan.millimetres_per(ridge.unit)
    for (h, w), (valid, status, poles) in zip(
        rates, run_freecad(script, macro=str(macro), rates=rates)["all"], strict=True
    ):
        assert valid and status == "Valid"
        wanted = factor * ridge.resized(h=h, w=w).surface().poles
        np.testing.assert_allclose(poles, wanted, rtol=0, atol=EXACT * np.abs(wanted).max())
