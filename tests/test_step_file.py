"""STEP files hold the exact poles in millimetres, and fail in words."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
from OCP.Interface import Interface_Static
from OCP.Message import Message
from OCP.STEPControl import STEPControl_Controller
from surfaces import FakeRidge, patch, ridge_surface, ring, same

import cad_export as cx

STATICS = ("write.step.schema", "write.step.unit", "xstep.cascade.unit")


@pytest.mark.parametrize("shift", [0.0, 1e5])
def test_step_keeps_the_poles(tmp_path: Path, shift: float) -> None:
    surface = ridge_surface()
    surface = dataclasses.replace(surface, poles=surface.poles + shift)
    path = cx.step(surface, tmp_path / "ridge.step")
    assert path == tmp_path / "ridge.step"
    assert [p.name for p in tmp_path.iterdir()] == ["ridge.step"]
    same(cx.surface_of(cx.read_step(path)), surface)
    same(cx.surface_of(cq.importers.importStep(str(path)).val()), surface)
    assert path.stat().st_size < 100_000


def test_step_of_a_solid_and_a_ring_keep_their_faces(tmp_path: Path) -> None:
    surface = ridge_surface()
    solid = cx.solid(surface, 2.0)
    read = cq.importers.importStep(str(cx.step(solid, tmp_path / "slab.stp"))).val()
    assert isinstance(read, cq.Solid) and read.isValid()
    assert read.Volume(1e-5) == pytest.approx(solid.Volume(1e-5), rel=1e-6)
    sizes = [cx.surface_of(face) for face in read.Faces()]
    assert any(
        s.poles.shape == surface.poles.shape and np.abs(s.poles - surface.poles).max() < 1e-9 for s in sizes
    )
    same(cx.surface_of(cx.read_step(cx.step(ring(), tmp_path / "ring.STEP"))), ring())


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1.0), ("m", 1000.0), ("in", 25.4)])
def test_step_writes_millimetres(tmp_path: Path, unit: str, factor: float) -> None:
    path = cx.step(FakeRidge(unit=unit), tmp_path / "a.step", h=2)
    got = cx.surface_of(cx.read_step(path))
    np.testing.assert_allclose(got.poles, factor * ridge_surface(3.0).poles, atol=1e-9 * 40 * factor)
    assert "SI_UNIT(.MILLI.,.METRE.)" in path.read_text().replace("\n", "")


def test_the_same_input_gives_the_same_file(tmp_path: Path) -> None:
    texts = [cx.step(ridge_surface(), tmp_path / "a.step").read_text() for _ in range(2)]
    first, second = (text.split("ENDSEC;", 1)[1] for text in texts)  # the header before it has the time
    assert first == second


def test_an_unknown_unit_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="unit"):
        cx.step(FakeRidge(unit="furlong"), tmp_path / "a.step")


@pytest.mark.parametrize(
    ("schema", "header"),
    [
        ("AP203", "CONFIG_CONTROL_DESIGN"),
        ("AP214IS", "AUTOMOTIVE_DESIGN"),
        ("AP214", "AUTOMOTIVE_DESIGN"),
        ("AP242DIS", "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING"),
        ("ap242", "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING"),
    ],
)
def test_step_names_its_schema(tmp_path: Path, schema: str, header: str) -> None:
    text = cx.step(patch(), tmp_path / "a.step", schema=schema).read_text()
    assert header in text.split("ENDSEC;")[0]
    assert "PRODUCT('a'" in text.replace("\n", "")


@pytest.mark.parametrize("schema", ["AP999", "", None, 5])
def test_an_unknown_schema_is_an_error(tmp_path: Path, schema: object) -> None:
    with pytest.raises(ValueError, match=r"AP203, AP214, AP214IS, AP242, AP242DIS"):
        cx.step(patch(), tmp_path / "a.step", schema=schema)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_step_takes_cadquerys_objects(tmp_path: Path) -> None:
    box = cq.Workplane().box(1, 2, 3)
    two = cq.Workplane().rarray(5, 1, 2, 1).box(1, 2, 3, combine=False)

    class Wrapper:
        wrapped = box.val().wrapped

    for n, (source, expected) in enumerate(
        [(box, 6), (two, 12), (box.val(), 6), (box.val().wrapped, 6), (Wrapper(), 6), (cq.Assembly(box), 6)]
    ):
        path = cx.step(source, tmp_path / f"{n}.step")
        assert cq.importers.importStep(str(path)).combine().val().Volume() == pytest.approx(expected)


@pytest.mark.parametrize(
    "source", [None, 3, "ridge", cq.Workplane(), np.zeros((4, 3)), cq.Workplane().pushPoints([(0, 0)])]
)
def test_what_is_no_shape_is_an_error(tmp_path: Path, source: object) -> None:
    with pytest.raises(ValueError, match="expected a"):
        cx.step(source, tmp_path / "a.step")
    assert not list(tmp_path.iterdir())


def test_rates_need_a_ridge(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected a Ridge for rates h=2, w=1"):
        cx.face(patch(), h=2)
    with pytest.raises(ValueError, match="expected a Ridge for rates h=1, w=2"):
        cx.step(cq.Workplane().box(1, 1, 1), tmp_path / "a.step", w=2)
    with pytest.raises(ValueError, match="expected a Ridge or a Surface, got str"):
        cx.face("ridge")  # type: ignore[arg-type]


def test_a_bad_path_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"\.step or \.stp, got 'a\.iges'"):
        cx.step(patch(), tmp_path / "a.iges")
    with pytest.raises(OSError, match="folder"):
        cx.step(patch(), tmp_path / "none" / "a.step")
    (tmp_path / "b.step").mkdir()
    with pytest.raises(OSError):
        cx.step(patch(), tmp_path / "b.step")
    assert [p.name for p in tmp_path.iterdir()] == ["b.step"]


def test_a_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = cx.step(patch(), tmp_path / "a.step")
    before = path.read_bytes()

    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OSError, match="disk full"):
        cx.step(ridge_surface(), path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.step"]


@pytest.mark.parametrize("fails", [False, True])
def test_occts_globals_are_restored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: bool) -> None:
    STEPControl_Controller.Init_s()
    Interface_Static.SetCVal_s("write.step.unit", "INCH")
    before = {key: Interface_Static.CVal_s(key) for key in STATICS}
    printers = Message.DefaultMessenger_s().Printers().Size()
    try:
        if fails:
            monkeypatch.setattr("cad_export.step_file.STEPCAFControl_Writer", lambda: 1 / 0)
            with pytest.raises(ZeroDivisionError):
                cx.step(patch(), tmp_path / "a.step", schema="AP203")
        else:
            cx.step(patch(), tmp_path / "a.step", schema="AP203")
        assert {key: Interface_Static.CVal_s(key) for key in STATICS} == before
        assert Message.DefaultMessenger_s().Printers().Size() == printers > 0
    finally:
        Interface_Static.SetCVal_s("write.step.unit", "MM")


def test_occt_is_silent(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    cx.read_step(cx.step(patch(), tmp_path / "a.step"))
    assert capfd.readouterr().out == ""


def test_read_step_fails_in_words(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        cx.read_step(tmp_path / "none.step")
    (tmp_path / "text.step").write_text("no step")
    with pytest.raises(ValueError, match=r"text\.step"):
        cx.read_step(tmp_path / "text.step")


def test_a_name_that_is_not_there_is_an_error() -> None:
    with pytest.raises(AttributeError, match="nothing"):
        _ = cx.nothing
