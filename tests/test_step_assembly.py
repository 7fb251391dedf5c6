"""Assemblies go to STEP with their own structure, and their ridges come back at their places."""

from __future__ import annotations

import re
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
from freecad_tools import inspect_step, needs_freecad, run_freecad
from OCP.XCAFDoc import XCAFDoc_ShapeTool
from oracles import spiral_ridge

import cad_export as cx
import ridgefeature as rf
from ridgefeature.io.feature import to_document

LEFT = cq.Location((0, 0, 7))
RIGHT = cq.Location((100, 0, 7), (0, 0, 1), 90)
SUB = cq.Location((0, 100, 0), (1, 0, 0), 30)
TOP = cq.Location((0, 0, 3))


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge().stretched(20.0, "trim")


@pytest.fixture(scope="module")
def slab(ridge: rf.Ridge) -> cq.Solid:
    return cx.solid(ridge, 3.0, h=1.2, check=False)


@pytest.fixture(scope="module")
def assembly(slab: cq.Solid) -> cq.Assembly:
    """Two red instances of the slab, and a blue and a plain one in a part of its own below."""
    inner = cq.Assembly(name="inner", loc=SUB)
    inner.add(cq.Workplane().box(5, 5, 5), name="block")
    inner.add(slab, name="plain")
    inner.add(cq.Workplane(slab.moved(cq.Location((0, 0, 50)))), name="blue one", color=cq.Color("blue"))
    whole = cq.Assembly(name="Griff Größe 2", loc=TOP)
    whole.add(slab, name="left", loc=LEFT, color=cq.Color("red"))
    whole.add(slab, name="right", loc=RIGHT, color=cq.Color("red"))
    return whole.add(inner)


@pytest.fixture(scope="module")
def file(assembly: cq.Assembly, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cx.step(assembly, tmp_path_factory.mktemp("assembly") / "a.step")


def matrix(place: cq.Location) -> np.ndarray:
    move = place.wrapped.Transformation()
    return np.array([[move.Value(i, j) for j in range(1, 5)] for i in range(1, 4)])


def test_cadquery_finds_its_own_structure_again(assembly: cq.Assembly, file: Path) -> None:
    back = cq.Assembly.importStep(str(file))
    # CadQuery puts an assembly that has a place of its own into another of the same name
    parts = {name.split("/")[-1]: part for name, part in back.objects.items() if part.obj}
    assert set(parts) == {"left", "right", "block", "plain", "blue one"}
    for name, colour in {"left": "red", "right": "red", "blue one": "blue"}.items():
        assert parts[name].color.toTuple() == pytest.approx(cq.Color(colour).toTuple(), abs=1e-6)
    got, wanted = back.toCompound(), assembly.toCompound()
    assert len(got.Solids()) == 5
    assert got.Volume(1e-6) == pytest.approx(wanted.Volume(1e-6), rel=1e-6)
    np.testing.assert_allclose(got.Center().toTuple(), wanted.Center().toTuple(), atol=1e-3)


def test_ridges_are_found_with_their_places(ridge: rf.Ridge, file: Path) -> None:
    records = cx.carried_in(file)
    assert [record.name for record in records] == ["ridge", "ridge 2", "ridge 3", "ridge 4"]
    assert {(record.h, record.w) for record in records} == {(1.2, 1.0)}
    lifted = cq.Location((0, 0, 50))
    places = [TOP * LEFT, TOP * RIGHT, TOP * SUB, TOP * SUB * lifted]
    for record, place in zip(records, places, strict=True):
        np.testing.assert_allclose(record.motion, matrix(place), atol=1e-12 * 200)
    found = cx.load(file)
    assert isinstance(found, tuple)
    assert [to_document(one) for one in found] == 4 * [to_document(ridge)]


def test_the_faces_read_carry_them_where_they_are(ridge: rf.Ridge, file: Path) -> None:
    poles = ridge.resized(h=1.2).surface().poles
    found = cx.carried_by(cx.read_step(file))
    assert len(found) == 4
    for face, record in found:
        motion = np.array(record.motion)
        np.testing.assert_allclose(
            cx.surface_of(face).poles, poles @ motion[:, :3].T + motion[:, 3], atol=1e-9 * 200
        )


def test_what_was_read_is_written_with_the_same_places(file: Path, tmp_path: Path) -> None:
    again = cx.carried_in(cx.step(cx.read_step(file), tmp_path / "again.step"))
    for one, other in zip(cx.carried_in(file), again, strict=True):
        assert (one.name, one.h, one.feature) == (other.name, other.h, other.feature)
        np.testing.assert_allclose(one.motion, other.motion, atol=1e-9)


def products(path: Path) -> list[tuple[str, str]]:
    """Identifiers and names of the products, as they stand in the file."""
    return re.findall(r"[=]PRODUCT\('([^']*)','([^']*)'", re.sub(r"\s", "", path.read_text(encoding="ascii")))


def test_names_are_those_of_the_assembly_in_ascii(file: Path) -> None:
    name = r"GriffGr\X2\00F6\X0\\X2\00DF\X0\e2"
    named = products(file)
    # instances of one part are one product, so the second red slab has none of its own
    assert [text for _, text in named] == [name, name, "left", "inner", "block", "plain", "blueone"]
    assert len({identifier for identifier, _ in named}) == len(named)
    text = file.read_text(encoding="ascii")
    assert len(re.findall(r"NEXT_ASSEMBLY_USAGE_OCCURRENCE\('\d+','(left|right|inner|blue one)'", text)) == 4
    assert set(re.findall(r"ADVANCED_FACE\('(r[^']*)'", text)) == {"ridge", "ridge 3", "ridge 4"}


def test_parts_with_a_colour_keep_it_on_their_ridges(slab: cq.Solid, tmp_path: Path) -> None:
    def colours(**part: cq.Color) -> str:
        assembly = cq.Assembly().add(slab, name="part", **part)
        text = cx.step(assembly, tmp_path / "a.step").read_text(encoding="ascii")
        return " ".join(re.findall(r"(?:COLOUR_RGB|PRE_DEFINED_COLOUR)\([^)]*\)", text))

    orange = "COLOUR_RGB('',0.85"
    assert orange in colours()
    assert orange not in colours(color=cq.Color("red")) and "'red'" in colours(color=cq.Color("red"))
    face = cx.carried_by(slab)[0][0]
    assembly = cq.Assembly(slab, name="part")
    assembly.addSubshape(cq.Face(face), name="crest", color=cq.Color("green"))
    text = cx.step(assembly, tmp_path / "b.step").read_text(encoding="ascii")
    assert orange not in text and "'green'" in text
    assert len(cx.carried_in(tmp_path / "b.step")) == 1  # its own name stays, by which it is found again
    assert len(cx.carried_by(cx.read_step(tmp_path / "b.step"))) == 1


def test_writing_again_gives_the_same_names_and_numbers(
    assembly: cq.Assembly, file: Path, tmp_path: Path
) -> None:
    def names(path: Path) -> list[str]:  # the order of colours is OCCT's
        return re.findall(r"(?:PRODUCT|OCCURRENCE|FACE|ITEM)\('[^']*','[^']*'", path.read_text())

    naming = XCAFDoc_ShapeTool.AutoNaming_s()
    assert names(cx.step(assembly, tmp_path / "a.step")) == names(file)
    assert XCAFDoc_ShapeTool.AutoNaming_s() == naming


@pytest.mark.parametrize("schema", ["AP203", "AP214", "AP242"])
def test_every_schema_keeps_the_structure(assembly: cq.Assembly, tmp_path: Path, schema: str) -> None:
    path = cx.step(assembly, tmp_path / "a.step", schema=schema)
    assert len(cx.carried_in(path)) == 4
    assert len(products(path)) == 7


def test_other_formats_take_an_assembly_as_one_shape(assembly: cq.Assembly, tmp_path: Path) -> None:
    back = cq.Shape.importBrep(str(cx.write(assembly, tmp_path / "a.brep")))
    assert back.Volume(1e-6) == pytest.approx(assembly.toCompound().Volume(1e-6), rel=1e-9)


def test_what_cannot_be_written_says_why(assembly: cq.Assembly, tmp_path: Path) -> None:
    for nothing in (cq.Assembly(), cq.Assembly(name="x").add(cq.Assembly(name="y"))):
        with pytest.raises(ValueError, match="assembly with a shape"):
            cx.step(nothing, tmp_path / "a.step")
    with pytest.raises(ValueError, match="expected a Ridge for rates h=2, w=1, got Assembly"):
        cx.step(assembly, tmp_path / "a.step", h=2)
    assert list(tmp_path.iterdir()) == []


_LABELS = """
import FreeCAD, Import
document = FreeCAD.newDocument()
Import.insert(path, document.Name)
result = {"labels": [found.Label for found in document.Objects]}
"""


@needs_freecad
def test_freecad_shows_the_names_and_all_parts(slab: cq.Solid, file: Path, tmp_path: Path) -> None:
    found = inspect_step(file)
    assert (found["solids"], found["valid"], found["closed_mesh"]) == (5, True, True)
    # one part only: version 0.20 without a screen crashes on every assembly of several, CadQuery's own too
    for source, label in ((slab, "Maß"), (cq.Assembly(slab, name="Größe's"), "Größe's")):
        path = cx.step(source, tmp_path / "Maß.step")
        assert run_freecad(_LABELS, path=str(path))["labels"] == [label]
