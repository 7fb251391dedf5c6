"""How the command line fails: one line, an exit status, nothing half written."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cli_helpers import AT, PICK, fails, run, save_scan

import ridgefeature as rf
from ridgefeature.commands import register as register_command


@pytest.fixture(scope="module")
def scan_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_scan(tmp_path_factory.mktemp("scan"))


@pytest.fixture(scope="module")
def feature(scan_file: Path) -> Path:
    path = scan_file.with_name("spiral.ridge.json")
    rf.register(rf.read_scan(scan_file), PICK).save(path)
    return path


def _cut(path: Path, source: Path, part: float) -> Path:
    data = source.read_bytes()
    path.write_bytes(data[: int(part * len(data))])
    return path


@pytest.mark.parametrize(
    ("name", "make", "said"),
    [
        ("gone.ply", lambda p, s: None, "no such file"),
        ("empty.xyz", lambda p, s: p.write_bytes(b""), "empty"),
        ("cut.npy", lambda p, s: _cut(p, s, 0.5), "whole"),
        ("scan.foo", lambda p, s: p.write_bytes(b"1 2 3"), ".ply"),
        ("binary.xyz", lambda p, s: p.write_bytes(s.read_bytes()), "binary"),
        ("wide.npy", lambda p, s: np.save(p, np.ones((100, 5))), "(100, 5)"),
        ("few.npy", lambda p, s: np.save(p, np.eye(3)), "16"),
        ("same.npy", lambda p, s: np.save(p, np.ones((100, 3))), "distinct"),
        ("line.npy", lambda p, s: np.save(p, np.outer(np.arange(99.0), [1, 1, 1])), "line"),
        ("nan.npy", lambda p, s: np.save(p, np.full((5, 3), np.nan)), "16"),
        ("folder.npy", lambda p, s: p.mkdir(), "directory"),
    ],
)
def test_bad_scan_files(
    name: str, make: Callable[[Path, Path], object], said: str, scan_file: Path, tmp_path: Path
) -> None:
    make(tmp_path / name, scan_file)
    fails(run("register", tmp_path / name, *AT, "--out", tmp_path / "a" / "b"), 2, name, said)
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--at", 500, 0, 0), "450"),
        (("--at", "nan", 0, 0), "finite"),
        (("--at", 1, 2), "--at X Y Z, apart by spaces: The pick"),
        (("--at", "1,2,3"), "--at X Y Z, apart by spaces"),
        (("--at", 1, 2, "x"), "'x' is not a valid float; expected --at X Y Z"),
        ((), "Missing option '--at'; expected --at X Y Z"),
        ((), "register --help tells all"),
        ((*AT, "--width", -3), "--width: expected a number above 0"),
        ((*AT, "--width", 0), "--width: expected"),
        ((*AT, "--height", "x"), "expected --height H: Starting guess"),
        ((*AT, "--direction", 0, 0, 0), "--direction: expected"),
        ((*AT, "--direction", 1, 0), "--direction DX DY DZ, apart by spaces"),
        ((*AT, "--max-templates", 0), "--max-templates: expected"),
        ((*AT, "--roi", -1), "--roi: expected"),
        ((*AT, "--unit", "foot"), "foot"),
        ((*AT, "--kind", "hill"), "groove"),
        ((*AT, "--wdth", 3), "--width"),
        ((*AT, "--wdth", 3), "No such option '--wdth'"),
    ],
)
def test_bad_options(words: tuple[object, ...], said: str, scan_file: Path, tmp_path: Path) -> None:
    fails(run("register", scan_file, "--out", tmp_path / "o", *words), 2, said)
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "register"),
        (("registre",), "--help tells all"),
        (("register",), "Missing argument 'SCAN'"),
        (("export", "x.ridge.json"), "-o"),
        (("info",), "info --help tells all"),
    ],
)
def test_a_command_line_that_is_not_whole_says_where_help_is(words: tuple[str, ...], said: str) -> None:
    result = run(*words)
    if words:
        fails(result, 2, said)
    else:
        assert said in result.stdout and result.exit_code == 0


def test_a_feature_is_not_registered_again(feature: Path, tmp_path: Path) -> None:
    said = "registered already", "ridgefeature info", "ridgefeature export"
    fails(run("register", feature, *AT, "--out", tmp_path / "o"), 2, feature.name, *said)
    with pytest.raises(ValueError, match=r"ridgefeature\.load"):
        rf.read_scan(feature)


@pytest.mark.parametrize("command", ["export", "register"])
def test_a_file_of_no_use_there(command: str, tmp_path: Path) -> None:
    (tmp_path / "notes.md").write_text("ridge")
    words = ("-o", tmp_path / "x.step") if command == "export" else (*AT, "--out", tmp_path / "o")
    fails(run(command, tmp_path / "notes.md", *words), 2, "notes.md", "'.md'", "expected")


def test_a_scan_is_not_exported(scan_file: Path, tmp_path: Path) -> None:
    said = "got a NumPy array", f"ridgefeature register {scan_file} --at X Y Z"
    fails(run("export", scan_file, "-o", tmp_path / "x.step"), 2, *said)
    assert list(tmp_path.iterdir()) == []


def test_no_ridge_there(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    flat = np.column_stack([random.uniform(-50, 50, (20_000, 2)), random.normal(0, 0.1, 20_000)])
    np.save(tmp_path / "flat.npy", flat)
    fails(
        run("register", tmp_path / "flat.npy", "--at", 0, 0, 0, "--out", tmp_path / "o", "--json"),
        3,
        "no ridge",
        "give --direction, --width and --height as a start",
    )
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize("place", ["file", "file/deeper"])
def test_output_folder_that_cannot_be_is_told_before_the_work(
    place: str, scan_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("mine")
    monkeypatch.setattr(register_command, "read_scan", lambda *_, **__: pytest.fail("the work was begun"))
    fails(run("register", scan_file, *AT, "--out", tmp_path / place), 2, "file")
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_output_folder_without_permission(scan_file: Path, tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    fails(run("register", scan_file, *AT, "--out", tmp_path / "o"), 2, "o", "denied")


def test_a_folder_in_the_place_of_a_file(scan_file: Path, tmp_path: Path) -> None:
    (tmp_path / "ridge.step").mkdir()
    fails(run("register", scan_file, *AT, "--out", tmp_path), 2, "ridge.step")
    assert [p.name for p in tmp_path.iterdir()] == ["ridge.step"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text[: len(text) // 2], "cut short"),
        (lambda text: text.replace('"version": 1', '"version": 99'), "99"),
        (lambda text: "[1, 2]", "something else"),
        (lambda text: "", "cut short"),
    ],
)
def test_bad_feature_files(change: Callable[[str], str], said: str, feature: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.ridge.json"
    bad.write_text(change(feature.read_text()))
    fails(run("export", bad, "-o", tmp_path / "x.step"), 2, "bad.ridge.json", said)
    fails(run("info", bad), 2, "bad.ridge.json", said)
    assert [p.name for p in tmp_path.iterdir()] == ["bad.ridge.json"]


@pytest.mark.parametrize(
    ("name", "words", "said"),
    [
        ("x.dwg", (), ".step .stp .iges .igs .brep .stl .3mf .glb .gltf .FCMacro"),
        ("no/x.step", (), "no such folder"),
        ("x.step", ("--w", -1), "--w: expected a rate above 0, got -1"),
        ("x.step", ("--w", 0), "--w: expected a rate above 0, got 0"),
        ("x.step", ("--w", 50), "--w: expected at most 1."),
        ("x.step", ("--h", "nan"), "--h: expected finite"),
    ],
)
def test_bad_exports(name: str, words: tuple[object, ...], said: str, feature: Path, tmp_path: Path) -> None:
    fails(run("export", feature, "-o", tmp_path / name, *words), 2, said)
    assert list(tmp_path.iterdir()) == []


def test_the_rate_that_is_told_as_the_largest_goes(feature: Path, tmp_path: Path) -> None:
    told = run("export", feature, "-o", tmp_path / "x.step", "--w", 50).stderr
    most = told.partition("at most ")[2].split()[0]
    assert run("export", feature, "-o", tmp_path / "x.step", "--w", most).exit_code == 0


def test_a_step_file_without_a_feature(tmp_path: Path) -> None:
    plain = tmp_path / "plain.step"
    import cadquery as cq

    cq.Workplane().box(1, 1, 1).export(str(plain))
    fails(run("export", plain, "-o", tmp_path / "x.step"), 2, "plain.step", "carries no ridge feature")
    assert [p.name for p in tmp_path.iterdir()] == ["plain.step"]
