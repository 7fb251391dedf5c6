"""What the page draws beside the scan, and what it gives away: curves, state, scripts, files."""

from __future__ import annotations

import runpy
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path

import numpy as np
import pytest
from made_ridges import made_ridge
from page_ridges import LENGTH, PICK, registered, scan

from ridgefeature.viewer import curves, saved, takeaway
from ridgefeature.viewer.session import Feature, Session


def session() -> Session:
    one = Session().added(registered(), PICK).added(registered().resized(h=-1), PICK)
    return one.changed("ridge 1", h=1.5, w=0.8, between=(10.0, 40.0)).changed("groove 1", shown=False)


def test_curves_are_drawn_to_scale() -> None:
    ridge = made_ridge()
    root = ElementTree.fromstring(curves.profile(ridge, (15.0, 45.0)))
    lines = {e.get("class"): e.get("points") for e in root.iter("polyline")}
    for name, values in (("h", ridge.height), ("w", ridge.width)):
        x, y = np.array([tuple(map(float, p.split(","))) for p in str(lines[name]).split()]).T
        np.testing.assert_allclose(
            x, curves.LEFT + (curves.RIGHT - curves.LEFT) * ridge.arc_length / 60, atol=0.06
        )
        slope, _ = np.polyfit(values, y, 1)
        assert slope < 0 and np.ptp(y - slope * values) < 0.2, "pixels follow the values"
    [stretch] = root.iter("rect")
    assert float(str(stretch.get("width"))) == pytest.approx(0.5 * (curves.RIGHT - curves.LEFT), abs=0.1)


def test_a_place_on_the_curves_is_an_arc_length_and_back() -> None:
    for s in (0.0, 12.3, 60.0):
        assert curves.place_of(curves.part_of(s, 60.0), 60.0) == pytest.approx(s, abs=1e-9)
    assert curves.place_of(0.0, 60.0) is None and curves.place_of(1.0, 60.0) is None


def test_the_section_shows_ridge_and_points() -> None:
    ridge = made_ridge()
    y = np.linspace(-5, 5, 400)
    text = curves.section(ridge.resized(h=2.0), ridge, 30.0, y, 0 * y)
    root = ElementTree.fromstring(text)
    now, then = (next(e for e in root.iter("polyline") if e.get("class") == c) for c in ("now", "then"))
    tops = [min(float(p.split(",")[1]) for p in str(e.get("points")).split()) for e in (now, then)]
    bottom = max(float(p.split(",")[1]) for p in str(then.get("points")).split())
    assert (bottom - tops[0]) / (bottom - tops[1]) == pytest.approx(2.0, rel=0.02)
    [dots] = [e for e in root.iter("path") if e.get("class") == "dots"]
    assert str(dots.get("d")).count("M") == 400
    assert "NaN" not in text.upper().replace("NANO", "")


def test_a_groove_and_a_flat_ridge_are_drawn_too() -> None:
    for ridge in (made_ridge().resized(h=-1.0), made_ridge().resized(h=0.0)):
        for text in (curves.profile(ridge), curves.section(ridge, ridge, 99.0, np.empty(0), np.empty(0))):
            assert "nan" not in text and "inf" not in text
            ElementTree.fromstring(text)


def test_a_saved_page_is_the_same_page(tmp_path: Path) -> None:
    saved.save(tmp_path / "a.ridgepage", scan(), session())
    back, again = saved.load(tmp_path / "a.ridgepage")
    assert back is not None and back.unit == "cm" and back.source == scan().source
    assert np.array_equal(back.points, scan().points)
    assert again.chosen == "groove 1"
    for old, new in zip(session().features, again.features, strict=True):
        for name in ("name", "pick", "h", "w", "between", "shown"):
            assert getattr(new, name) == getattr(old, name)
        assert np.array_equal(new.ridge.height, old.ridge.height)
    saved.save(tmp_path / "b.ridgepage", None, Session())
    none, empty = saved.load(tmp_path / "b.ridgepage")
    assert none is None and empty.features == () and empty.chosen is None


@pytest.mark.parametrize("damage", ["cut", "none", "bytes", "version", "rate", "points"])
def test_damaged_pages_are_told(tmp_path: Path, damage: str) -> None:
    path, other = tmp_path / "a.ridgepage", tmp_path / "b.ridgepage"
    saved.save(path, scan(), session())
    data = path.read_bytes()
    if damage == "cut":
        other.write_bytes(data[: len(data) // 2])
    elif damage == "none":
        other.write_bytes(b"not a page")
    elif damage == "bytes":
        at = data.index(b"points.npy") + 200
        other.write_bytes(data[:at] + bytes(255 - x for x in data[at : at + 40]) + data[at + 40 :])
    else:
        with zipfile.ZipFile(path) as old, zipfile.ZipFile(other, "w") as new:
            for entry in old.namelist():
                content = old.read(entry)
                if entry == "page.json" and damage == "version":
                    content = content.replace(b'"version": 1', b'"version": 9')
                if entry == "page.json" and damage == "rate":
                    content = content.replace(b'"h": 1.5', b'"h": 1e9')
                if entry == "points.npy" and damage == "points":
                    content = content[:200]
                new.writestr(entry, content)
    with pytest.raises(ValueError, match="expected a page saved by ridgefeature"):
        saved.load(other)


def test_names_become_safe_file_names() -> None:
    assert takeaway.stem_of("../../Ridge 1/ä") == "ridge-1"
    assert takeaway.stem_of("...") == "ridge"


@pytest.mark.parametrize("kind", ["step", "json", "macro", "profile"])
def test_every_kind_is_written(tmp_path: Path, kind: str) -> None:
    path = takeaway.write(kind, session()["ridge 1"], scan(), tmp_path)
    assert path.name == "ridge-1" + takeaway.KINDS[kind][0] and path.stat().st_size > 1000
    if kind == "step":
        import cad_export as cx

        assert np.allclose(cx.load(path).height, session()["ridge 1"].ridge.height)


def test_the_script_regenerates_the_ridge_at_what_stands_at_its_top(tmp_path: Path) -> None:
    feature = session()["ridge 1"]
    with zipfile.ZipFile(takeaway.write("script", feature, None, tmp_path)) as archive:
        assert set(archive.namelist()) == {"ridge-1.py", "ridge-1.ridge.json"}
        archive.extractall(tmp_path)
    file = tmp_path / "ridge-1.py"
    text = file.read_text()
    assert "h = 1.5 " in text and "w = 0.8\n" in text
    runpy.run_path(str(file))
    import cadquery as cq

    import cad_export as cx

    assert np.allclose(cx.load(tmp_path / "ridge-1.step").height, feature.ridge.height)
    own = takeaway.write("step", feature, None, tmp_path.parent)
    sizes = [cq.importers.importStep(str(p)).val().BoundingBox() for p in (tmp_path / "ridge-1.step", own)]
    assert sizes[0].xlen == pytest.approx(sizes[1].xlen) == pytest.approx(10.0 * LENGTH, rel=0.1)
    file.write_text(text.replace("h = 1.5 ", "h = 2.0 "))
    runpy.run_path(str(file))
    taller = feature.registered.resized(h=2.0, w=0.8, between=(10.0, 40.0))
    assert np.allclose(cx.load(tmp_path / "ridge-1.step").height, taller.height)


def test_what_cannot_be_written_is_told(tmp_path: Path) -> None:
    feature = Feature('a "quoted" \\ name', made_ridge(), PICK)
    compile(takeaway.script(feature), "script", "exec")
    with pytest.raises(ValueError, match="expected one of step, json"):
        takeaway.write("x", feature, None, tmp_path)
    with pytest.raises(ValueError, match="expected an open scan"):
        takeaway.write("view", feature, None, tmp_path)
