"""CAD and mesh files by suffix: the shape in millimetres, whole or not at all."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
from cli_helpers import fails, run
from OCP.IGESControl import IGESControl_Reader
from OCP.Interface import Interface_Static
from OCP.Message import Message
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp_Explorer
from oracles import spiral_ridge
from surfaces import ridge_surface, same

import cad_export as cx
import ridgefeature as rf
from cad_export.formats import FORMATS
from ridgefeature.io.feature import to_document

SUFFIXES = [suffix for suffix in FORMATS if suffix != ".fcmacro"]


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge()


@pytest.fixture(scope="module")
def slab() -> cq.Solid:
    return cx.solid(ridge_surface(rows=8), 2.0, check=False)


def bounds(path: Path) -> np.ndarray:
    """Lowest and highest corner (2, 3) of what another reader finds in the file."""
    suffix = path.suffix.lower()
    if suffix in (".stl", ".3mf", ".glb", ".gltf"):
        import trimesh

        loaded = trimesh.load(path)
        return np.asarray(loaded.bounds)
    if suffix in (".iges", ".igs"):
        reader = IGESControl_Reader()
        reader.ReadFile(str(path))
        reader.TransferRoots()
        shape = cq.Shape.cast(reader.OneShape())
    elif suffix == ".brep":
        shape = cq.Shape.importBrep(str(path))
    else:
        shape = cq.importers.importStep(str(path)).val()
    return box(shape)


def box(shape: cq.Shape) -> np.ndarray:
    points = np.array([v.toTuple() for v in shape.copy().tessellate(1e-2)[0]])
    return np.array([points.min(axis=0), points.max(axis=0)])


@pytest.mark.parametrize("suffix", [s for s in SUFFIXES if s not in (".3mf",)])
def test_every_format_holds_the_shape_in_its_unit(slab: cq.Solid, tmp_path: Path, suffix: str) -> None:
    path = cx.write(slab, tmp_path / f"part{suffix}")
    got, wanted = bounds(path), box(slab)
    if suffix in (".glb", ".gltf"):  # metres, y up
        got = 1000 * np.stack([got[:, 0], -got[::-1, 2], got[:, 1]], axis=-1)
    np.testing.assert_allclose(got, wanted, atol=0.02)
    assert all(p.name.startswith("part.") or p.name.endswith(".bin") for p in tmp_path.iterdir())


def test_3mf_holds_the_triangles(slab: cq.Solid, tmp_path: Path) -> None:
    import re
    import zipfile

    with zipfile.ZipFile(cx.write(slab, tmp_path / "part.3mf")) as archive:
        model = archive.read("3D/3dmodel.model").decode()
    assert 'unit="millimeter"' in model
    xyz = np.array(re.findall(r'<vertex x="([^"]*)" y="([^"]*)" z="([^"]*)"', model), dtype=float)
    np.testing.assert_allclose([xyz.min(axis=0), xyz.max(axis=0)], box(slab), atol=0.02)


def test_a_ridge_in_metres_is_written_in_millimetres(ridge: rf.Ridge, tmp_path: Path) -> None:
    metres = dataclasses.replace(ridge, unit="m")
    path = cx.write(metres, tmp_path / "a.brep", h=1.5)
    got = cx.surface_of(cq.Shape.importBrep(str(path)))
    wanted = ridge.resized(h=1.5).surface()
    same(dataclasses.replace(got, poles=got.poles / 1000), wanted)
    assert cx.carried_in(cx.write(metres, tmp_path / "a.stp", h=1.5))[0].h == 1.5


def test_the_exact_poles_go_to_iges(tmp_path: Path) -> None:
    surface = ridge_surface(rows=8)
    path = cx.write(surface, tmp_path / "a.igs")
    reader = IGESControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    faces = TopExp_Explorer(reader.OneShape(), TopAbs_FACE)
    same(cx.surface_of(faces.Current()), surface)


def test_occt_is_silent_and_its_settings_are_restored(
    slab: cq.Solid, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    cx.write(slab, tmp_path / "first.iges")  # loads what defines the settings
    Interface_Static.SetCVal_s("write.iges.unit", "INCH")
    printers = Message.DefaultMessenger_s().Printers().Size()
    try:
        for suffix in SUFFIXES:
            cx.write(slab, tmp_path / f"a{suffix}")
        assert Interface_Static.CVal_s("write.iges.unit") == "INCH"
        np.testing.assert_allclose(bounds(tmp_path / "a.iges"), box(slab), atol=0.02)
    finally:
        Interface_Static.SetCVal_s("write.iges.unit", "MM")
    assert Message.DefaultMessenger_s().Printers().Size() == printers > 0
    assert capfd.readouterr() == ("", "")


def test_the_shape_keeps_its_own_triangles(tmp_path: Path) -> None:
    solid = cq.Workplane().cylinder(10, 4).val()
    before = len(solid.tessellate(1.0)[0])
    cx.write(solid, tmp_path / "a.stl")
    assert len(solid.tessellate(1.0)[0]) == before


def test_bad_targets_are_told(slab: cq.Solid, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"a\.dwg: expected one of .* \.step \.stp .*'\.dwg'"):
        cx.write(slab, tmp_path / "a.dwg")
    with pytest.raises(ValueError, match="got ''"):
        cx.write(slab, tmp_path / "a")
    with pytest.raises(OSError, match="no such folder"):
        cx.write(slab, tmp_path / "none" / "a.stl")
    (tmp_path / "b.stl").mkdir()
    with pytest.raises(OSError, match="this is a folder"):
        cx.write(slab, tmp_path / "b.stl")
    assert [p.name for p in tmp_path.iterdir()] == ["b.stl"]


@pytest.mark.parametrize("suffix", [*SUFFIXES, ".FCMacro"])
def test_what_is_no_shape_is_an_error(tmp_path: Path, suffix: str) -> None:
    for source in (None, "ridge", cq.Workplane()):
        with pytest.raises(ValueError, match="expected a"):
            cx.write(source, tmp_path / f"a{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_empty_shapes_have_no_mesh(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="shape with faces"):
        cx.write(cq.Compound.makeCompound([]), tmp_path / "a.stl")


def test_a_macro_takes_a_ridge_only(ridge: rf.Ridge, slab: cq.Solid, tmp_path: Path) -> None:
    pytest.importorskip("cad_export.freecad")
    assert cx.write(ridge, tmp_path / "a.FCMacro").stat().st_size > 1000
    with pytest.raises(ValueError, match="expected a Ridge for a FreeCAD macro, got Solid"):
        cx.write(slab, tmp_path / "b.FCMacro")


# The commands


def test_export_from_a_step_file_and_info(ridge: rf.Ridge, tmp_path: Path) -> None:
    ridge.save(tmp_path / "a.ridge.json")
    done = run("export", tmp_path / "a.ridge.json", "-o", tmp_path / "a.step", "--h", 1.5)
    assert done.exit_code == 0, done.stderr
    assert run("export", tmp_path / "a.step", "-o", tmp_path / "b.iges", "--w", 0.9).exit_code == 0
    top = bounds(tmp_path / "b.iges")[1, 2]
    assert top == pytest.approx(box(cx.face(ridge, h=1.5, w=0.9))[1, 2], abs=0.01)  # as recorded, not 1
    info = json.loads(run("info", tmp_path / "a.step", "--json").stdout)
    assert info["features"] == [
        {
            "name": "ridge",
            "unit": "mm",
            "length": ridge.length,
            "templates": len(ridge.templates),
            "h": 1.5,
            "w": 1.0,
            "pasted": False,
        }
    ]
    assert "carries ridge" in run("info", tmp_path / "a.step").stdout
    cx.step(cq.Workplane().box(1, 1, 1), tmp_path / "box.step")
    assert "no ridge feature" in run("info", tmp_path / "box.step").stdout
    back = cx.load(tmp_path / "a.step")
    assert isinstance(back, rf.Ridge) and to_document(back) == to_document(ridge)


def test_a_step_file_with_two_ridges_or_cut_off_is_told(ridge: rf.Ridge, tmp_path: Path) -> None:
    two = cq.Compound.makeCompound([cx.face(ridge), cx.face(ridge, h=2)])
    path = cx.step(two, tmp_path / "two.step")
    words = "export", path, "-o", tmp_path / "x.stl", "--h", 2
    fails(run(*words), 2, "two.step", "got 2 ('ridge', 'ridge 2')", "--name")
    (tmp_path / "cut.step").write_bytes(path.read_bytes()[:9000])
    fails(run("export", tmp_path / "cut.step", "-o", tmp_path / "x.stl"), 2, "cut.step", "cut off")
    fails(run("info", tmp_path / "cut.step"), 2, "cut.step", "cut off")
    assert not (tmp_path / "x.stl").exists()
