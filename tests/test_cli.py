"""The command line: what it writes, what it says, and what an interrupt leaves."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_helpers import AT, PICK, fails, run, save_scan
from click.testing import Result

import ridgefeature as rf
from ridgefeature.commands import register as register_command
from ridgefeature.synthetic import Spiral

PLAIN = (*AT, "--no-step", "--no-pictures")


@pytest.fixture(scope="module")
def scan_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_scan(tmp_path_factory.mktemp("scan"))


@pytest.fixture(scope="module")
def done(scan_file: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    folder = tmp_path_factory.mktemp("done") / "new" / "out"
    return folder, run("register", scan_file, *AT, "--out", folder)


@pytest.fixture(scope="module")
def feature(done: tuple[Path, Result]) -> Path:
    return done[0] / "feature.ridge.json"


def test_register_writes_the_five_files_and_a_summary(done: tuple[Path, Result]) -> None:
    folder, result = done
    assert result.exit_code == 0, result.stderr
    assert result.stderr == ""
    assert sorted(p.name for p in folder.iterdir()) == [
        "deviation.png",
        "feature.ridge.json",
        "profile.png",
        "ridge.step",
        "view.png",
    ]
    ridge = rf.load(folder / "feature.ridge.json")
    assert ridge.length > 0.9 * Spiral().arc_length
    for words in (
        f"templates{'':14}{len(ridge.templates)}",
        f"{ridge.length:.4g} mm",
        "standard deviation",
        *ridge.stop,
        ridge.section.name,
        str(folder / "view.png"),
    ):
        assert words in result.stdout
    assert (folder / "ridge.step").read_text().rstrip().endswith("END-ISO-10303-21;")


def test_register_equals_the_library(done: tuple[Path, Result], scan_file: Path) -> None:
    ridge = rf.register(rf.read_scan(scan_file), PICK)
    written = rf.load(done[0] / "feature.ridge.json")
    np.testing.assert_array_equal(written.height, ridge.height)
    np.testing.assert_array_equal(written.spine, ridge.spine)


def test_json_is_one_object_on_stdout(scan_file: Path, tmp_path: Path) -> None:
    result = run("register", scan_file, *PLAIN, "--out", tmp_path, "--json")
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    ridge = rf.load(found["files"]["feature"])
    assert found["length"] == ridge.length
    assert found["templates"] == len(ridge.templates)
    assert found["stations"]["height"] == ridge.height.tolist()
    assert [found["stop_start"], found["stop_end"]] == list(ridge.stop)
    assert found["interrupted"] is False
    assert [p.name for p in tmp_path.iterdir()] == ["feature.ridge.json"]


def test_hints_and_settings_reach_the_library(
    scan_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: dict[str, Any] = {}

    def spy(scan: rf.Scan, **options: Any) -> rf.Ridge:
        seen.update(options, unit=scan.unit)
        return rf.register(scan, PICK)

    monkeypatch.setattr(register_command, "register", spy)
    hints = (
        "--at",
        -3,
        2,
        -1.5,
        "--direction",
        -1,
        0,
        "-.5",
        "--width",
        12,
        "--height",
        6,
        "--kind",
        "auto",
        "--roi",
        70,
    )
    tunables = ("--unit", "cm", "--max-templates", 7, "--length", 0.9, "--loss", "huber")
    result = run("register", scan_file, *hints, *tunables, "--no-step", "--no-pictures", "--out", tmp_path)
    assert result.exit_code == 0, result.stderr
    settings = seen.pop("settings")
    assert settings == rf.Settings(max_templates=7, length=0.9, loss="huber")
    seen.pop("progress")
    assert seen == {
        "at": (-3, 2, -1.5),
        "direction": (-1, 0, -0.5),
        "width": 12,
        "height": 6,
        "kind": "auto",
        "roi": 70,
        "unit": "cm",
    }


def test_every_setting_is_an_option_with_its_help() -> None:
    result = run("register", "--help")
    options, settings = result.stdout.split("Settings (")
    text = " ".join(settings.split())
    for field in fields(rf.Settings):
        assert f"--{field.name.replace('_', '-')} " in text
        assert " ".join(field.metadata["help"].split()[:3]) in text
    assert "--at X Y Z" in options


def test_sample_and_vertices_of_a_mesh(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    x, y = np.meshgrid(np.linspace(-20, 20, 121), np.linspace(-20, 20, 121), indexing="ij")
    z = 3 * Spiral().section(y / 8)
    i = np.arange(121 * 121).reshape(121, 121)
    faces = np.concatenate(
        [
            np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:]], -1).reshape(-1, 3),
            np.stack([i[:-1, :-1], i[1:, 1:], i[:-1, 1:]], -1).reshape(-1, 3),
        ]
    )
    mesh = tmp_path / "bar.ply"
    trimesh.Trimesh(np.stack([x, y, z], -1).reshape(-1, 3), faces).export(mesh)
    for words in (("--sample", 9000), ("--vertices",)):
        result = run(
            "register", mesh, "--at", 0, 0, 3, "--no-step", "--no-pictures", "--out", tmp_path / "o", *words
        )
        assert result.exit_code == 0, result.stderr
        ridge = rf.load(tmp_path / "o" / "feature.ridge.json")
        assert np.median(ridge.height) == pytest.approx(3, rel=0.05)


def test_export_by_suffix_and_rates(feature: Path, tmp_path: Path) -> None:
    import cadquery as cq

    ridge = rf.load(feature)
    tops = []
    for name, rate in (("a.step", 1.0), ("b.stp", 1.5), ("c.brep", 1.5)):
        result = run("export", feature, "-o", tmp_path / name, "--h", rate, "--w", 0.9)
        assert result.exit_code == 0, result.stderr
        assert str(tmp_path / name) in result.stdout
        reader = cq.importers.importBrep if name == "c.brep" else cq.importers.importStep
        tops.append(reader(str(tmp_path / name)).val().BoundingBox().zmax)
    assert tops[0] == pytest.approx(ridge.height.max(), rel=0.05)
    assert tops[1] == pytest.approx(1.5 * tops[0], rel=0.03)
    assert tops[2] == pytest.approx(tops[1], rel=1e-3)
    assert run("export", feature, "-o", tmp_path / "d.stl").exit_code == 0
    assert rf.read_scan(tmp_path / "d.stl", vertices=True).bounds[1, 2] == pytest.approx(tops[0], rel=0.05)
    assert len(list(tmp_path.iterdir())) == 4


def test_export_of_a_scan_in_metres_is_in_millimetres(tmp_path: Path) -> None:
    import cadquery as cq

    points = rf.Scan(Spiral().points(15_000, 0.1, seed=3) / 1000, "m")
    rf.register(points, np.array(PICK) / 1000).save(tmp_path / "m.ridge.json")
    for name in ("m.step", "m.brep"):
        assert run("export", tmp_path / "m.ridge.json", "-o", tmp_path / name).exit_code == 0
        reader = cq.importers.importBrep if name == "m.brep" else cq.importers.importStep
        assert reader(str(tmp_path / name)).val().BoundingBox().xlen == pytest.approx(80, abs=8)


def test_info_of_scan_feature_and_step(scan_file: Path, done: tuple[Path, Result]) -> None:
    scan = run("info", scan_file)
    assert "15,000" in scan.stdout and "spacing" in scan.stdout
    found = json.loads(run("info", scan_file, "--json").stdout)
    np.testing.assert_array_equal([found["low"], found["high"]], rf.read_scan(scan_file).bounds)
    feature = run("info", done[0] / "feature.ridge.json")
    assert "spiral.npy, sha256" in feature.stdout and "settings changed" in feature.stdout
    step = json.loads(run("info", done[0] / "ridge.step", "--json").stdout)
    assert (step["kind"], step["faces"], step["solids"]) == ("step", 1, 0)
    assert step["high"][2] == pytest.approx(6, abs=0.3)


def test_dropped_points_are_one_line_of_warning(scan_file: Path, tmp_path: Path) -> None:
    points = np.load(scan_file)
    points[::1000] = np.nan
    np.save(tmp_path / "holes.npy", points)
    result = run("info", tmp_path / "holes.npy")
    assert result.exit_code == 0
    assert "14,985" in result.stdout
    assert len(result.stderr.splitlines()) == 1
    assert result.stderr.startswith("ridgefeature: warning: dropped 15 of 15000")


def _interrupting(count: int) -> Callable[[str], Any]:
    @contextmanager
    def shown(unit: str) -> Iterator[Callable[[rf.Template], None]]:
        seen = []

        def progress(template: rf.Template) -> None:
            seen.append(template)
            if len(seen) == count:
                signal.raise_signal(signal.SIGINT)

        yield progress

    return shown


def test_an_interrupted_march_keeps_and_writes_what_it_has(
    scan_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(register_command, "shown_progress", _interrupting(6))
    # What runs in the background is often started with interrupts ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        result = run("register", scan_file, *AT, "--out", tmp_path, "--json")
    finally:
        signal.signal(signal.SIGINT, before)
    assert result.exit_code == 130
    assert len(result.stderr.splitlines()) == 1 and "interrupted" in result.stderr
    assert json.loads(result.stdout)["interrupted"] is True
    assert len(list(tmp_path.iterdir())) == 5
    ridge = rf.load(tmp_path / "feature.ridge.json")
    assert "interrupted" in ridge.stop
    assert 3 <= len(ridge.templates) <= 6


def test_an_interrupt_elsewhere_leaves_nothing_half_done(
    scan_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(register_command, "register", interrupted)
    fails(run("register", scan_file, *AT, "--out", tmp_path / "o"), 130, "interrupted")
    assert not (tmp_path / "o").exists()


def test_the_module_runs_as_a_program(scan_file: Path, tmp_path: Path) -> None:
    words = [
        sys.executable,
        "-P",
        "-m",
        "ridgefeature",
        "register",
        str(scan_file),
        "--at",
        "1",
        "2",
        "--out",
        "x",
    ]
    done = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1 and "--at" in done.stderr
    shown = run("--help")
    assert shown.exit_code == 0
    assert all(name in shown.stdout for name in ("demo", "register", "export", "info"))


def test_register_without_pictures_loads_neither_cadquery_nor_drawing(
    scan_file: Path, tmp_path: Path
) -> None:
    words = ["register", str(scan_file), *AT, "--no-pictures", "--out", str(tmp_path)]
    code = f"""
import sys
from ridgefeature.cli import main
try:
    main({words!r})
except SystemExit as end:
    slow = {{"cadquery", "matplotlib", "vtkmodules", "rich", "trimesh"}}
    print(end.code, sorted(slow & set(sys.modules)), "OCP" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1:] == ["0 [] True"], done.stderr
