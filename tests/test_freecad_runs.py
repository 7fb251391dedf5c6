"""What FreeCAD makes of the macro. Skipped where there is no freecadcmd."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from freecad_tools import needs_freecad, run_freecad
from oracles import spiral_ridge

import ridgefeature as rf
from cad_export.freecad import write_macro

BAD_WIDTHS = (0.0, -1.0, math.nan, math.inf, 50.0)


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge()


@pytest.fixture(scope="module")
def macro(ridge, tmp_path_factory) -> Path:
    return write_macro(ridge, tmp_path_factory.mktemp("macro") / "spiral.FCMacro")


OPEN = """
import FreeCAD
def run():
    exec(compile(open(macro).read(), "macro", "exec"), {"__name__": "__main__"})
def state():
    box, spline = ridge.Shape.optimalBoundingBox(False), ridge.Shape.Faces[0].Surface
    return {
        "box": [box.XMin, box.YMin, box.ZMin, box.XMax, box.YMax, box.ZMax],
        "poles": [[list(p) for p in row] for row in spline.getPoles()],
        "valid": ridge.Shape.isValid(), "status": ridge.getStatusString(), "names": [
            one.Name for one in document.Objects], "rates": [ridge.Height, ridge.Width],
    }
"""


def extremes(surface: rf.bspline.Surface) -> list[float]:
    """The smallest and largest x, y and z of a surface: samples, and ever finer ones around the best."""
    ends = []
    for sign in (1.0, -1.0):
        for axis in range(3):
            (u0, u1), (v0, v1) = low_high = surface.domain
            nu, nv = 20 * surface.poles.shape[0], 20 * surface.poles.shape[1]
            for _ in range(12):
                u, v = np.linspace(u0, u1, nu), np.linspace(v0, v1, nv)
                values = sign * surface.on_grid(u, v)[..., axis]
                i, j = np.unravel_index(values.argmin(), values.shape)
                u0, u1 = np.clip([u[i] - 2 * (u[1] - u[0]), u[i] + 2 * (u[1] - u[0])], *low_high[0])
                v0, v1 = np.clip([v[j] - 2 * (v[1] - v[0]), v[j] + 2 * (v[1] - v[0])], *low_high[1])
                nu = nv = 21
            ends.append(sign * float(values.min()))
    return ends


@needs_freecad
def test_freecad_makes_the_surface_again_at_other_rates(ridge, macro):
    script = """
run()
document = FreeCAD.ActiveDocument
ridge = document.getObject("Ridge")
result = {"first": state()}
ridge.Height = 2
document.recompute()
result["taller"] = state()
ridge.Height, ridge.Width = 1, 1.5
document.recompute()
result["wider"] = state()
"""
    found = run_freecad(OPEN + script, macro=str(macro))
    boxes = {}
    for name, h, w in (("first", 1, 1), ("taller", 2, 1), ("wider", 1, 1.5)):
        surface = ridge.resized(h=h, w=w).surface()
        assert found[name]["valid"] and found[name]["names"] == ["Ridge"]
        np.testing.assert_allclose(found[name]["poles"], surface.poles, rtol=0, atol=1e-12 * 50)
        boxes[name] = np.array(extremes(surface))
        np.testing.assert_allclose(found[name]["box"], boxes[name], rtol=0, atol=1e-6)
    for name in ("taller", "wider"):
        growth = np.subtract(found[name]["box"], found["first"]["box"])
        np.testing.assert_allclose(growth, boxes[name] - boxes["first"], rtol=0, atol=1e-6)
    assert found["taller"]["box"][5] > 1.9 * found["first"]["box"][5]


@needs_freecad
def test_freecad_shows_bad_rates_and_keeps_the_shape_and_the_place(macro):
    script = """
run()
document = FreeCAD.ActiveDocument
ridge = document.getObject("Ridge")
ridge.Placement.Base = FreeCAD.Vector(1, 2, 3)
ridge.Height = 2
document.recompute()
before, refused = ridge.Shape.Area, []
for name, values in (("Width", widths), ("Height", heights)):
    for value in values:
        setattr(ridge, name, value)
        document.recompute()
        refused.append([name, ridge.getStatusString(), ridge.Shape.Area == before, ridge.isValid()])
    setattr(ridge, name, 1.5)
document.recompute()
result = {"refused": refused, "after": ridge.isValid() and ridge.Shape.Area != before,
    "place": list(ridge.Placement.Base), "tips": [ridge.getDocumentationOfProperty(n) for n in (
        "Height", "Width")], "groups": [ridge.getGroupOfProperty(n) for n in ("Height", "Width")],
    "modes": [ridge.getEditorMode(n) for n in ("Height", "RidgeSource", "RidgeFeature")]}
"""
    found = run_freecad(OPEN + script, macro=str(macro), widths=BAD_WIDTHS, heights=(math.nan, math.inf))
    assert len(found["refused"]) == 7
    for name, status, kept, valid in found["refused"]:
        assert status.startswith(f"{name}: expected a"), status
        assert kept and not valid
    assert found["after"] and found["place"] == [1, 2, 3]
    assert found["groups"] == ["Ridge", "Ridge"] and all(found["tips"])
    assert found["modes"] == [[], ["ReadOnly"], ["ReadOnly", "Hidden"]]


@needs_freecad
def test_a_saved_ridge_wakes_when_the_macro_runs_again(ridge, macro, tmp_path):
    path = str(tmp_path / "part.FCStd")
    make = """
run()
document = FreeCAD.ActiveDocument
ridge = document.getObject("Ridge")
ridge.Height, ridge.Width = 1.7, 0.9
document.recompute()
document.saveAs(path)
result = state()
"""
    saved = run_freecad(OPEN + make, macro=str(macro), path=path)
    again = """
document = FreeCAD.openDocument(path)
ridge = document.getObject("Ridge")
result = {"asleep": state(), "proxy": ridge.Proxy is None}
document.UndoMode = 1
run()
result["awake"], result["undo"] = state(), document.UndoNames
ridge.Height = 2
document.recompute()
result["taller"] = state()
FreeCAD.closeDocument(document.Name)
document = FreeCAD.openDocument(path)
ridge = document.getObject("Ridge")
ridge.Height = 2
document.recompute()
run()
result["changed asleep"] = state()
"""
    found = run_freecad(OPEN + again, macro=str(macro), path=path)
    assert found["proxy"] and found["undo"] == []
    for state in (found["asleep"], found["awake"]):
        assert state["names"] == ["Ridge"] and state["rates"] == [1.7, 0.9] and state["valid"]
        np.testing.assert_allclose(state["poles"], saved["poles"], rtol=0, atol=1e-12 * 50)
    wanted = ridge.resized(h=2, w=0.9).surface().poles
    for name in ("taller", "changed asleep"):
        np.testing.assert_allclose(found[name]["poles"], wanted, rtol=0, atol=1e-12 * 50)


@needs_freecad
def test_the_macro_runs_from_the_command_line(ridge, macro, tmp_path):
    path = tmp_path / "part.FCStd"
    look = """
document = FreeCAD.ActiveDocument
ridge = document.getObject("Ridge")
result = {**state(), "awake": ridge.Proxy is not None}
document.saveAs(path)
"""
    other = write_macro(ridge.resized(h=2), tmp_path / "other.FCMacro")
    first = run_freecad(OPEN + look, files=[macro], path=str(path))
    again = run_freecad(OPEN + look, files=[path, macro], path=str(path))
    two = run_freecad(OPEN + look, files=[path, other], path=str(path))
    assert first["awake"] and again["awake"] and two["awake"]
    assert first["names"] == again["names"] == ["Ridge"]
    assert two["names"] == ["Ridge", "Ridge001"]


@needs_freecad
def test_adding_a_ridge_is_one_step_to_undo(macro):
    script = """
document = FreeCAD.newDocument("Part")
document.UndoMode = 1
box = document.addObject("Part::Box", "Box")
run()
names = lambda: [one.Name for one in document.Objects]
result = {"added": names(), "steps": document.UndoNames}
document.undo()
result["undone"] = names()
document.redo()
ridge = document.getObject("Ridge")
result["redone"], area = names(), ridge.Shape.Area
ridge.Height = 3
document.recompute()
result["grown"] = ridge.Shape.Area / area
"""
    found = run_freecad(OPEN + script, macro=str(macro))
    assert found["added"] == found["redone"] == ["Box", "Ridge"]
    assert found["steps"][0] == "Add ridge" and found["undone"] == ["Box"]
    assert found["grown"] > 1.2
