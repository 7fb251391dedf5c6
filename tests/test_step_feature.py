"""STEP files are project files: the feature comes back from one to the last bit, or not at all."""

from __future__ import annotations

import gc
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import cadquery as cq
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from OCP.BRep import BRep_Tool
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_NamedData
from OCP.TDF import TDF_ChildIterator
from OCP.TDocStd import TDocStd_Document
from OCP.TopLoc import TopLoc_Location
from oracles import apex, spiral_points, spiral_ridge
from surfaces import ridge_surface

import cad_export as cx
import ridgefeature as rf
from cad_export import carried as registry
from cad_export.record import UNMOVED, record_of
from cad_export.step_properties import PIECE, items, records_in
from ridgefeature.io.feature import to_document

FAST = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    """One with numbers that JSON has no word for."""
    found = spiral_ridge()
    first, *rest = found.templates
    return replace(found, templates=(replace(first, M=np.nan, scale=np.inf), *rest))


@pytest.fixture(scope="module")
def slab(ridge: rf.Ridge) -> cq.Solid:
    return cx.solid(ridge, 3.0, h=1.2, check=False)


@pytest.fixture(scope="module")
def text(ridge: rf.Ridge, tmp_path_factory: pytest.TempPathFactory) -> str:
    return cx.step(ridge, tmp_path_factory.mktemp("text") / "a.step").read_text(encoding="ascii")


def same(a: Any, b: rf.Ridge) -> None:
    """Equal in all that a feature file holds; JSON text tells floats that differ in the last bit."""
    assert isinstance(a, rf.Ridge)
    assert json.dumps(to_document(a)) == json.dumps(to_document(b))


@pytest.mark.parametrize("schema", ["AP203", "AP214", "AP242"])
def test_the_ridge_comes_back_and_its_poles(ridge: rf.Ridge, tmp_path: Path, schema: str) -> None:
    path = cx.step(ridge, tmp_path / "a.step", schema=schema, h=1.5, w=0.9)
    same(cx.load(path), ridge)
    (record,) = cx.carried_in(path)
    assert (record.name, record.h, record.w, record.motion) == ("ridge", 1.5, 0.9, UNMOVED)
    wanted = ridge.resized(h=1.5, w=0.9).surface()
    np.testing.assert_allclose(
        cx.surface_of(cx.read_step(path)).poles, wanted.poles, rtol=0, atol=1e-9 * np.abs(wanted.poles).max()
    )


def test_a_feature_file_and_step_are_equal(ridge: rf.Ridge, tmp_path: Path) -> None:
    ridge.save(tmp_path / "a.ridge.json")
    back = cx.load(cx.step(rf.load(tmp_path / "a.ridge.json"), tmp_path / "a.step"))
    assert isinstance(back, rf.Ridge)
    back.save(tmp_path / "b.ridge.json")
    assert (tmp_path / "a.ridge.json").read_bytes() == (tmp_path / "b.ridge.json").read_bytes()


def test_a_ridge_in_metres_keeps_its_unit(ridge: rf.Ridge, tmp_path: Path) -> None:
    metres = replace(ridge, unit="m")
    path = cx.step(metres, tmp_path / "a.step")
    same(cx.load(path), metres)
    got, own = cx.surface_of(cx.read_step(path)).poles, metres.surface().poles
    np.testing.assert_allclose(got, 1000 * own, rtol=0, atol=1e-9 * 1000 * np.abs(own).max())


def test_twenty_templates_stay_below_150_kB(tmp_path: Path) -> None:
    ridge = rf.register(spiral_points(), at=apex(), max_templates=20)
    assert len(ridge.templates) >= 20
    assert cx.step(ridge, tmp_path / "a.step").stat().st_size <= 150_000


@pytest.mark.parametrize("schema", ["AP203", "AP214", "AP242"])
def test_a_part_with_several_ridges(ridge: rf.Ridge, slab: cq.Solid, tmp_path: Path, schema: str) -> None:
    other = ridge.resized(h=0.5)
    part = cq.Compound.makeCompound(
        [slab, cx.face(other, w=0.8).moved(cq.Location((0, 0, 90))), slab.moved(cq.Location((200, 0, 0)))]
    )
    path = cx.step(part, tmp_path / "part.step", schema=schema)
    found = cx.load(path)
    assert isinstance(found, tuple) and len(found) == 3
    for got, wanted in zip(found, (ridge, other, ridge), strict=True):
        same(got, wanted)
    same(cx.load(path, name="ridge 2"), other)
    records = cx.carried_in(path)
    assert [(r.name, r.h, r.w) for r in records] == [
        ("ridge", 1.2, 1),
        ("ridge 2", 1, 0.8),
        ("ridge 3", 1.2, 1),
    ]
    assert [[row[3] for row in r.motion] for r in records] == [[0, 0, 0], [0, 0, 90], [200, 0, 0]]
    with pytest.raises(ValueError, match=r"'ridge', 'ridge 2', 'ridge 3', got 'bump'"):
        cx.load(path, name="bump")


def test_cadquerys_objects_carry_it(ridge: rf.Ridge, slab: cq.Solid, tmp_path: Path) -> None:
    assembly = cq.Assembly().add(slab, loc=cq.Location((0, 0, 7))).add(cq.Solid.makeBox(1, 1, 1))
    for n, source in enumerate(
        [slab, cq.Workplane(slab), assembly, slab.wrapped, cq.Workplane(slab).faces()]
    ):
        same(cx.load(cx.step(source, tmp_path / f"{n}.step")), ridge)


def test_the_shape_read_carries_it_again(ridge: rf.Ridge, slab: cq.Solid, tmp_path: Path) -> None:
    two = cq.Compound.makeCompound([slab, cx.face(ridge.resized(w=0.9))])
    first = cx.step(two, tmp_path / "a.step")
    second = cx.step(cx.read_step(first), tmp_path / "b.step")
    assert cx.carried_in(second) == cx.carried_in(first)


@pytest.mark.parametrize(
    "change",
    [
        lambda s: s.cut(cq.Solid.makeCylinder(3, 100, (30, 0, -50))),
        lambda s: s.fuse(cq.Solid.makeBox(5, 5, 5, (28, -2, -6))),
        lambda s: s.moved(cq.Location((1, 2, 3), (10, 20, 30))),
        lambda s: s.translate((1, 2, 3)),
        lambda s: s.rotate((0, 0, 0), (1, 2, 3), 40),
        lambda s: s.copy(),
    ],
    ids=["cut", "fuse", "moved", "translate", "rotate", "copy"],
)
def test_what_becomes_of_a_shape_still_carries_it(slab: cq.Solid, change: Any, tmp_path: Path) -> None:
    (face, record), *others = cx.carried_by(change(slab))
    assert all(other == record for _, other in others)
    motion = np.array(record.motion)
    geometry = cx.surface_of(face)
    start = cx.surface_of(cx.carried_by(slab)[0][0])
    np.testing.assert_allclose(
        start.poles @ motion[:, :3].T + motion[:, 3], geometry.poles, atol=1e-9 * np.abs(geometry.poles).max()
    )
    assert len(cx.carried_in(cx.step(change(slab), tmp_path / "a.step"))) == 1


def test_scaled_mirrored_and_foreign_shapes_carry_nothing(slab: cq.Solid) -> None:
    flat = cx.face(ridge_surface())  # a Surface is no feature
    for shape in (slab.scale(2), slab.mirror("XY"), cq.Solid.makeBox(1, 1, 1), flat):
        assert cx.carried_by(shape) == []


@FAST
@given(
    move=st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3),
    turn=st.lists(st.floats(-180, 180), min_size=3, max_size=3),
)
def test_the_motion_is_that_of_the_location(slab: cq.Solid, move: list[float], turn: list[float]) -> None:
    place = cq.Location(tuple(move), tuple(turn))
    trsf = place.wrapped.Transformation()
    wanted = [[trsf.Value(i, j) for j in range(1, 5)] for i in range(1, 4)]
    for shape in (slab.moved(place), slab.moved(place).copy()):
        ((_, record),) = cx.carried_by(shape)
        np.testing.assert_allclose(record.motion, wanted, atol=1e-9 * 1e3)


def test_attach_changes_and_takes_off(ridge: rf.Ridge) -> None:
    face = cx.face(ridge)
    record = replace(cx.carried_by(face)[0][1], name="bead", placement={"path": [1, 2]}, host={"brep": "x"})
    cx.attach(BRep_Tool.Surface_s(face.wrapped, TopLoc_Location()), record)
    assert [r for _, r in cx.carried_by(face)] == [record]
    cx.attach(face, None)
    assert cx.carried_by(face) == []
    with pytest.raises(ValueError, match="expected a face or a Geom_Surface, got Solid"):
        cx.attach(cq.Solid.makeBox(1, 1, 1), record)
    with pytest.raises(ValueError, match="Carried record or None, got dict"):
        cx.attach(face, {})
    for nothing in (None, 3, "face"):
        with pytest.raises(ValueError, match="expected a CAD shape"):
            cx.carried_by(nothing)
        with pytest.raises(ValueError, match="expected a CAD shape"):
            cx.attach(nothing, record)


def test_records_of_shapes_in_use_stay_others_go(ridge: rf.Ridge) -> None:
    kept = cx.face(ridge, h=0.7)
    for n in range(4 * registry._KEPT):
        cx.face(ridge, h=1 + n / 1000)
    gc.collect()
    assert len(registry._ENTRIES) <= 3 * registry._KEPT
    assert [r.h for _, r in cx.carried_by(kept)] == [0.7]


def test_placement_host_and_names_come_back(ridge: rf.Ridge, tmp_path: Path) -> None:
    face = cx.face(ridge)
    placement = {"at": [0.1, 1e-300, -1 / 3], "words": "Größe 'x' \\ \"y\"", "none": None, "yes": True}
    record = replace(record_of(ridge, name="Fuß's"), placement=placement, host={"brep": "CASCADE\n" * 9000})
    cx.attach(face, record)
    path = cx.step(face, tmp_path / "Maß.step")
    (back,) = cx.carried_in(path)
    assert back == record
    assert cx.carried_by(cx.read_step(path))[0][1] == record  # found by the name of its face
    cx.attach(face, replace(record, placement={"at": np.nan}))
    with pytest.raises(ValueError, match="plain, finite JSON"):
        cx.step(face, tmp_path / "b.step")
    assert [p.name for p in tmp_path.iterdir()] == ["Maß.step"]


def test_the_file_is_ascii_with_short_strings_and_named_faces(
    slab: cq.Solid, ridge: rf.Ridge, tmp_path: Path
) -> None:
    face = cx.face(ridge)
    noise = np.random.default_rng(0).integers(0, 2**62, 20_000).tolist()
    cx.attach(face, replace(record_of(ridge), host={"brep": noise}))
    path = cx.step(cq.Compound.makeCompound([slab, face]), tmp_path / "a.step")
    data = path.read_bytes()
    assert data.isascii()
    strings = re.findall(rb"'([^']*)'", data.replace(b"\n", b""))
    assert sum(len(s) == PIECE for s in strings) > 10 and max(map(len, strings)) == PIECE
    assert re.findall(rb"ADVANCED_FACE\('(r[^']*)'", data) == [b"ridge", b"ridge 2"]
    assert data.count(b"STYLED_ITEM") >= 2 and b"COLOUR_RGB" in data
    assert cx.read_step(path) is not None  # OCCT reads it
    assert cx.carried_in(path)[1].host == {"brep": noise}


def test_occt_reads_the_property_as_metadata(ridge: rf.Ridge, tmp_path: Path) -> None:
    path = cx.step(ridge, tmp_path / "a.step")
    reader, document = STEPCAFControl_Reader(), TDocStd_Document(TCollection_ExtendedString("x"))
    reader.SetMetaMode(True)
    reader.ReadFile(str(path))
    assert reader.Transfer(document)
    wanted, found = dict(items(cx.carried_in(path))), {}
    labels = TDF_ChildIterator(document.Main(), True)
    while labels.More():
        data = TDataStd_NamedData()
        if labels.Value().FindAttribute(TDataStd_NamedData.GetID_s(), data):
            keys = {name: TCollection_ExtendedString(name) for name in wanted}
            found |= {n: data.GetString(key).ToExtString() for n, key in keys.items() if data.HasString(key)}
        labels.Next()
    assert found == wanted


# Files that are not whole


@pytest.mark.parametrize("part", [0.0, 0.001, 0.3, 0.9, 0.999])
def test_a_file_cut_off_is_an_error(text: str, tmp_path: Path, part: float) -> None:
    path = tmp_path / "cut.step"
    path.write_text(text[: int(part * (len(text) - 20))])
    for read in (cx.load, cx.carried_in, cx.read_step):
        with pytest.raises(ValueError, match=r"cut\.step: expected a STEP file"):
            read(path)


def _span(text: str) -> tuple[int, int]:
    """Where the property's items are in the file."""
    start = text.index("DESCRIPTIVE_REPRESENTATION_ITEM")
    return start, text.index(";", text.rindex("DESCRIPTIVE_REPRESENTATION_ITEM"))


@settings(FAST, max_examples=300)
@given(data=st.data())
def test_a_changed_byte_gives_an_error_or_the_exact_feature(
    text: str, ridge: rf.Ridge, tmp_path: Path, data: st.DataObject
) -> None:
    start, end = _span(text)
    if data.draw(st.booleans()):  # the header, where a byte means most
        end = start + 400
    at = data.draw(st.integers(start, end))
    byte = data.draw(st.integers(0, 255))
    raw = bytearray(text.encode("ascii"))
    raw[at] = byte
    path = tmp_path / "bad.step"
    path.write_bytes(raw)
    try:
        found = cx.load(path)
    except ValueError as error:
        assert "bad.step: " in str(error)
    else:
        same(found, ridge)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("ridgefeature ", "someoneelses ", "carries no ridge feature"),
        (r'"version": 1', r'"version": 2', "expected version 1 of the ridge feature in STEP, got 2"),
        (r'"pieces": \d+', '"pieces": 99', "expected 99 pieces"),
        (r'"sha256": "\w', '"sha256": "x', "checksum"),
        (r"(ridgefeature \w+) 1'", r"\1 7'", "damaged"),
        (r"'ridgefeature \w+',", "'x',", "header is missing"),
        (r'"format"', "format", "header cannot be read"),
    ],
)
def test_damaged_and_later_properties_are_told(
    text: str, tmp_path: Path, old: str, new: str, said: str
) -> None:
    joined = text.replace("\n", "")
    assert re.search(old, joined)
    path = tmp_path / "a.step"
    path.write_text(re.sub(old, new, joined))
    with pytest.raises(ValueError, match=said):
        cx.load(path)


def test_line_breaks_and_spaces_may_stand_anywhere(text: str, ridge: rf.Ridge, tmp_path: Path) -> None:
    start, end = _span(text)
    loose = text[start:end].replace("ITEM(", "ITEM (\r\n ").replace("','", "' ,\r\n\t'")
    path = tmp_path / "a.step"
    path.write_text(text[:start] + loose + text[end:])
    same(cx.load(path), ridge)


def test_files_without_a_feature(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        cx.load(tmp_path / "none.step")
    with pytest.raises(OSError):
        cx.load(tmp_path)
    cq.Workplane().box(1, 1, 1).export(str(tmp_path / "box.step"))
    with pytest.raises(ValueError, match=r"box\.step: carries no ridge feature"):
        cx.load(tmp_path / "box.step")
    assert records_in(tmp_path / "box.step") == []
    for data in (b"", b"\0\1\2", b"solid ascii", "Größe".encode("latin-1")):
        (tmp_path / "x.step").write_bytes(data)
        with pytest.raises(ValueError, match="expected a STEP file, which starts with ISO-10303-21"):
            cx.load(tmp_path / "x.step")


# Other programs, and time


def test_loading_needs_no_occt_and_writing_no_cadquery(ridge: rf.Ridge, text: str, tmp_path: Path) -> None:
    (tmp_path / "a.step").write_text(text)
    ridge.save(tmp_path / "a.ridge.json")
    code = """
import sys
import cad_export as cx, ridgefeature as rf
assert set(cx.__all__) <= set(dir(cx))
def loaded():
    return [name for name in ("OCP", "cadquery") if name in sys.modules]
print(loaded())
cx.load(sys.argv[1])
print(loaded())
cx.step(rf.load(sys.argv[2]), sys.argv[3])
print(loaded())
"""
    words = [
        sys.executable,
        "-P",
        "-c",
        code,
        *(str(tmp_path / n) for n in ("a.step", "a.ridge.json", "b.step")),
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["[]", "[]", "['OCP']"]
    same(cx.load(tmp_path / "b.step"), ridge)


@pytest.mark.skipif(shutil.which("gmsh") is None, reason="gmsh is not installed")
@pytest.mark.parametrize("schema", ["AP203", "AP242"])
def test_gmsh_opens_the_files(ridge: rf.Ridge, slab: cq.Solid, tmp_path: Path, schema: str) -> None:
    for name, source, volumes, surfaces in (("face", ridge, 0, 1), ("solid", slab, 1, len(slab.Faces()))):
        path, counts = cx.step(source, tmp_path / f"{name}.step", schema=schema), tmp_path / f"{name}.txt"
        script = tmp_path / f"{name}.geo"
        script.write_text(
            f'Merge "{path}";\nv() = Volume{{:}}; s() = Surface{{:}};\n'
            f'Printf("%g %g", #v(), #s()) > "{counts}";\n'
        )
        words = ["gmsh", "-0", str(script), "-o", str(tmp_path / "out.geo_unrolled")]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        assert "Error" not in done.stdout + done.stderr
        assert counts.read_text().split() == [str(volumes), str(surfaces)]
