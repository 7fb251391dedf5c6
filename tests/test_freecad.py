"""The FreeCAD macro: its data, its plain Python without FreeCAD, and what FreeCAD makes of it."""

from __future__ import annotations

import ast
import dataclasses
import json
import math
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import cadquery as cq
import numpy as np
import pytest
from freecad_tools import closed, inspect_step, inspect_step_by_gmsh, needs_freecad, needs_gmsh, run_freecad
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import spiral_ridge

import cad_export as cx
import ridgefeature as rf
from cad_export.check import volume
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


# A stand-in for as much of FreeCAD as the macro uses


class StubObject:
    def __init__(self) -> None:
        self.PropertiesList: list[str] = []
        self.tips: dict[str, str] = {}
        self.Proxy: Any = None
        self.Shape: Any = None

    def addProperty(self, kind, name, group="", tip="", attributes=0, read_only=False, hidden=False):
        self.PropertiesList.append(name)
        self.tips[name] = tip

    def touch(self) -> None:
        pass


class StubDocument:
    def __init__(self) -> None:
        self.Objects: list[StubObject] = []

    def addObject(self, kind: str, name: str) -> StubObject:
        self.Objects.append(StubObject())
        return self.Objects[-1]

    def openTransaction(self, name: str) -> None:
        pass

    def commitTransaction(self) -> None:
        pass

    def recompute(self) -> None:
        for one in self.Objects:
            one.Proxy.execute(one)


class StubSpline:
    def buildFromPolesMultsKnots(self, *given: Any) -> None:
        self.given = given

    def toShape(self) -> tuple[Any, ...]:
        return self.given


def run_stubbed(macro: Path, document: StubDocument | None = None) -> StubDocument:
    """Run a macro in a document of a FreeCAD that is not there."""
    document = document or StubDocument()
    stubs = {"FreeCAD": ModuleType("FreeCAD"), "Part": ModuleType("Part")}
    stubs["FreeCAD"].__dict__.update(Vector=lambda *xyz: xyz, ActiveDocument=document, GuiUp=False)
    stubs["Part"].__dict__.update(BSplineSurface=StubSpline)
    before = {name: sys.modules.get(name) for name in stubs}
    sys.modules.update(stubs)
    try:
        exec(compile(macro.read_text(encoding="ascii"), macro.name, "exec"), {"__name__": "__main__"})
    finally:
        sys.modules.update({name: module for name, module in before.items() if module is not None})
        for name in (name for name, module in before.items() if module is None):
            del sys.modules[name]
    return document


@pytest.fixture(scope="module")
def stub(macro) -> StubObject:
    return run_stubbed(macro).Objects[0]


def shape_at(stub: StubObject, h: float, w: float) -> Any:
    stub.Height, stub.Width = h, w
    stub.Proxy.execute(stub)
    return stub.Shape


# Without FreeCAD


def test_the_macro_needs_nothing_but_freecad_and_the_standard_library(macro):
    tree = ast.parse(macro.read_text(encoding="ascii"))
    names = [a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names]
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


# In FreeCAD

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


@needs_freecad
def test_scripts_that_fail_say_so():
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        run_freecad("result = {'x': 1 / 0}")
    assert run_freecad("result = {'twice': 2 * x}", x=1.5) == {"twice": 3.0}


# STEP files as FreeCAD and gmsh see them


@pytest.fixture(scope="module")
def steps(ridge, tmp_path_factory) -> tuple[Path, Path, float]:
    """A slab, a face alone, and the volume of the slab."""
    folder = tmp_path_factory.mktemp("step")
    slab = cx.solid(ridge, 2.0, check=False)
    return (
        cx.step(slab, folder / "slab.step"),
        cx.step(ridge, folder / "face.step"),
        volume(slab.wrapped, 1e-7),
    )


by_both = pytest.mark.parametrize(
    "inspect",
    [pytest.param(inspect_step, marks=needs_freecad), pytest.param(inspect_step_by_gmsh, marks=needs_gmsh)],
)


@by_both
def test_others_find_one_closed_solid_of_our_volume(steps, inspect):
    slab, face, wanted = steps
    found = inspect(slab)
    assert (found["solids"], found["faces"]) == (1, 6)
    assert found["closed_mesh"] and found.get("valid", True)
    assert found["volume"] == pytest.approx(wanted, rel=1e-4)
    assert found.get("mesh_volume", wanted) == pytest.approx(wanted, rel=1e-3)
    alone = inspect(face)
    assert (alone["solids"], alone["faces"], alone["volume"]) == (0, 1, 0.0)
    assert not alone["closed_mesh"] and alone.get("valid", True)


@by_both
def test_others_find_what_is_wrong_with_a_file(inspect, tmp_path):
    box = cq.Solid.makeBox(1, 2, 3)
    pair = inspect(cx.step(cq.Compound.makeCompound([box, box.moved(x=5)]), tmp_path / "pair.step"))
    assert (pair["solids"], pair["faces"], pair["volume"]) == (2, 12, pytest.approx(12))
    open_box = inspect(cx.step(cq.Shell.makeShell(box.Faces()[:5]), tmp_path / "open.step"))
    assert (open_box["solids"], open_box["faces"], open_box["closed_mesh"]) == (0, 5, False)
    whole = (tmp_path / "pair.step").read_text()
    for name, text in (("empty", ""), ("words", "no STEP"), ("cut", whole[: len(whole) // 2])):
        path = tmp_path / f"{name}.step"
        path.write_text(text)
        with pytest.raises(RuntimeError):
            inspect(path)


@needs_freecad
def test_freecads_own_check_names_faces_that_cross(tmp_path):
    box = cq.Solid.makeBox(1, 2, 3)
    assert inspect_step(cx.step(box, tmp_path / "box.step"), check=True)["faults"] == ""
    crossed = cq.Compound.makeCompound([box, box.moved(x=0.5, y=0.5, z=0.5)])
    assert "Intersect" in inspect_step(cx.step(crossed, tmp_path / "crossed.step"), check=True)["faults"]


def test_a_mesh_is_closed_when_two_triangles_share_every_edge():
    tetrahedron = [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)]
    assert closed(tetrahedron)
    assert closed([*tetrahedron, (0, 0, 1)])
    assert not closed(tetrahedron[1:])
    assert not closed([*tetrahedron, (0, 1, 4)])
    assert not closed([])
