"""`ridgefeature export` of STEP files: parts regenerate, recorded rates stay, and bad files are told."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import cadquery as cq
import pytest
from cli_helpers import fails, run
from oracles import spiral_ridge

import cad_export as cx
import ridgefeature as rf


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge().stretched(20.0, "trim")


@pytest.fixture(scope="module")
def host() -> cq.Solid:
    return cq.Workplane().box(100, 80, 10).val()


@pytest.fixture(scope="module")
def part(ridge: rf.Ridge, host: cq.Solid) -> cq.Solid:
    once = cx.paste(ridge, host, at=(-20, 0, 5), direction=(0, 1, 0), h=1.2, name="bead", check=False)
    return cx.paste(ridge, once, at=(20, 0, 5), direction=(0, 1, 0), scale=0.7, name="Größe", check=False)


@pytest.fixture(scope="module")
def file(part: cq.Solid, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cx.step(part, tmp_path_factory.mktemp("part") / "part.step")


def rates(path: Path) -> dict[str, tuple[float, float]]:
    return {record.name: (record.h, record.w) for record in cx.carried_in(path)}


def export(source: Path, target: Path, *words: object) -> str:
    done = run("export", source, "-o", target, *words)
    assert done.exit_code == 0, done.stderr
    return str(done.stdout)


def test_rates_regenerate_the_part(file: Path, part: cq.Solid, host: cq.Solid, tmp_path: Path) -> None:
    said = export(file, tmp_path / "a.step", "--h", 1.5)
    assert "the part regenerated with 'bead' at h 1.5, w 1; 'Größe' at h 1.5, w 1" in said
    assert rates(tmp_path / "a.step") == {"bead": (1.5, 1), "Größe": (1.5, 1)}
    said = export(tmp_path / "a.step", tmp_path / "b.step", "--w", 0.8, "--name", "Größe")
    assert "'bead' at h 1.5, w 1; 'Größe' at h 1.5, w 0.8" in said
    assert rates(tmp_path / "b.step") == {"bead": (1.5, 1), "Größe": (1.5, 0.8)}
    (solid,) = cq.Shape.cast(cx.read_step(tmp_path / "b.step")).Solids()
    again = cx.regenerate(cx.regenerate(part, h=1.5, check=False), w=0.8, name="Größe", check=False)
    assert solid.isValid() and solid.Volume(1e-6) == pytest.approx(again.Volume(1e-6), rel=1e-6)


def test_without_rates_all_stays_as_it_is(file: Path, part: cq.Solid, tmp_path: Path) -> None:
    said = export(file, tmp_path / "copy.stp")
    names = "'bead' at h 1.2, w 1; 'Größe' at h 1, w 1"
    assert said == f"wrote {tmp_path / 'copy.stp'}: what part.step holds, with {names}\n"
    assert (tmp_path / "copy.stp").read_bytes() == file.read_bytes()
    export(tmp_path / "copy.stp", tmp_path / "copy.stp")
    assert (tmp_path / "copy.stp").read_bytes() == file.read_bytes()
    export(file, tmp_path / "a.brep")
    back = cq.Shape.importBrep(str(tmp_path / "a.brep"))
    assert back.Volume(1e-6) == pytest.approx(part.Volume(1e-6), rel=1e-6)


def test_a_macro_holds_one_ridge_at_its_rates(file: Path, ridge: rf.Ridge, tmp_path: Path) -> None:
    words = "export", file, "-o", tmp_path / "a.FCMacro"
    fails(run(*words), 2, "part.step: expected one ridge feature, got 2 ('bead', 'Größe')", "--name")
    assert "the surface of 'bead' alone at h 1.2, w 1" in export(*words[1:2], words[3], "--name", "bead")
    cx.write(ridge, tmp_path / "b.FCMacro", h=1.2)
    assert (tmp_path / "a.FCMacro").read_bytes() == (tmp_path / "b.FCMacro").read_bytes()


def test_recorded_rates_and_place_of_a_ridge_alone_stay(ridge: rf.Ridge, tmp_path: Path) -> None:
    place = cq.Location((1, 2, 30), (0, 0, 1), 40)
    path = cx.step(cx.face(ridge, h=1.3, w=0.9).moved(place), tmp_path / "ridge.step")
    for words, wanted in {(): (1.3, 0.9), ("--h", "2"): (2, 0.9), ("--w", "0.8"): (1.3, 0.8)}.items():
        said = export(path, tmp_path / "out.step", *words)
        assert "at h {:g}, w {:g}".format(*wanted) in said
        assert rates(tmp_path / "out.step") == {"ridge": wanted}
        got = cq.Shape.cast(cx.read_step(tmp_path / "out.step")).BoundingBox()
        made = cx.face(ridge, h=wanted[0], w=wanted[1]).moved(place).BoundingBox()
        assert (got.center - made.center).Length < 1e-6


def test_the_surface_of_one_ridge_of_what_was_not_pasted(ridge: rf.Ridge, tmp_path: Path) -> None:
    two = cq.Compound.makeCompound([cx.face(ridge), cx.face(ridge, h=2).moved(cq.Location((0, 0, 30)))])
    path = cx.step(two, tmp_path / "two.step")
    fails(run("export", path, "-o", tmp_path / "x.step", "--h", 3), 2, "got 2 ('ridge', 'ridge 2')", "--name")
    said = export(path, tmp_path / "x.step", "--name", "ridge 2")
    assert "the surface of 'ridge 2' alone at h 2, w 1" in said
    assert list(rates(tmp_path / "x.step").values()) == [(2, 1)]
    assert "'ridge' at h 1, w 1; 'ridge 2' at h 2, w 1" in export(path, tmp_path / "both.stl")


def test_what_a_name_cannot_choose_is_told(file: Path, ridge: rf.Ridge, tmp_path: Path) -> None:
    out = "-o", tmp_path / "x.step"
    fails(
        run("export", file, *out, "--name", "rib"),
        2,
        "expected one of 'bead', 'Größe' in part.step, got 'rib'",
    )
    fails(run("export", file, *out, "--name", "bead"), 2, "expected --h or --w for 'bead' too")
    ridge.save(tmp_path / "a.ridge.json")
    words = "export", tmp_path / "a.ridge.json", *out, "--name", "bead"
    fails(run(*words), 2, "a.ridge.json holds one ridge, which has no name")
    assert not (tmp_path / "x.step").exists()


def test_parts_that_cannot_regenerate_are_told(part: cq.Solid, tmp_path: Path) -> None:
    out = "-o", tmp_path / "x.step", "--h", 2
    cx.step(cq.Workplane(part).faces("<Z").workplane().hole(3), tmp_path / "drilled.step")
    fails(run("export", tmp_path / "drilled.step", *out), 2, "changed since; run the script that made it")
    two = cq.Assembly(part).add(part, loc=cq.Location((0, 0, 50)))
    fails(run("export", cx.step(two, tmp_path / "two.step"), *out), 2, "expected one solid, got 2")
    assert not (tmp_path / "x.step").exists()


def _joined(change: Callable[[str], str]) -> Callable[[bytes], bytes]:
    return lambda data: change(data.decode("ascii").replace("\n", "")).encode("latin-1")


BAD: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "empty": (lambda data: b"", "expected a STEP file, which starts with ISO-10303-21"),
    "no STEP": (lambda data: b"solid x\n" * 99, "expected a STEP file, which starts with ISO-10303-21"),
    "binary": (lambda data: bytes(range(256)) * 9, "expected a STEP file, which starts with ISO-10303-21"),
    "cut off": (lambda data: data[: len(data) // 2], "cut off"),
    "cut at the end": (lambda data: data[:-30], "cut off"),
    "foreign": (_joined(lambda t: t.replace("'ridgefeature ", "'other ")), "no ridge feature"),
    "later": (_joined(lambda t: t.replace('"version": 1', '"version": 2')), "expected version 1"),
    "header": (
        _joined(lambda t: t.replace('"pieces"', '"parts"')),
        "damaged one (its header cannot be read)",
    ),
    "piece": (_joined(lambda t: re.sub(r"(ridgefeature \w+ 1',\s*'\w{9})\w", r"\1/", t)), "damaged one"),
    "lost": (_joined(lambda t: re.sub(r"(ridgefeature \w+) 2'", r"\1 77'", t)), "damaged one"),
}


@pytest.mark.parametrize("case", BAD)
@pytest.mark.parametrize("words", [(), ("--h", 2)])
def test_bad_files_are_one_line_on_stderr(
    case: str, words: tuple[object, ...], file: Path, tmp_path: Path
) -> None:
    damage, said = BAD[case]
    path = tmp_path / "bad.step"
    path.write_bytes(damage(file.read_bytes()))
    for target in ("x.step", "x.stl", "x.FCMacro"):
        fails(run("export", path, "-o", tmp_path / target, *words), 2, "bad.step: ", said)
    if case == "foreign":
        assert "no ridge feature" in run("info", path).stdout
    else:
        fails(run("info", path), 2, "bad.step: ", said)
    assert [p.name for p in tmp_path.iterdir()] == ["bad.step"]


def test_paths_that_hold_no_file(tmp_path: Path) -> None:
    for path in (tmp_path / "none.step", tmp_path):
        fails(run("export", path, "-o", tmp_path / "x.step"), 2, str(path))
        fails(run("info", path), 2, str(path))


def test_info_tells_pasted_ridges(file: Path) -> None:
    said = run("info", file).stdout
    assert re.search(r"carries bead +20 mm long, .* h 1\.2, w 1, pasted\n", said)
    assert re.search(r"carries Größe +20 mm long, .* h 1, w 1, pasted\n", said)
