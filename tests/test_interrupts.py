"""Ctrl-C at any moment: one line, exit status 130, nothing half written, and it is told what is there."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from cli_helpers import AT, PICK, save_scan

import ridgefeature as rf

# What runs in the background is often started with interrupts ignored.
BEGIN = """
import os, signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)

def press(times=1):
    for i in range(times):
        time.sleep(0.4 * (i > 0))
        signal.raise_signal(signal.SIGINT)

def at_import(name, times=1):
    class Finder:
        def find_spec(self, found, path=None, target=None):
            if found == name:
                press(times)
    sys.meta_path.insert(0, Finder())

def at_writing(name, times=1):
    replace = os.replace
    def replaced(source, target, **options):
        if os.path.basename(target) == name:
            press(times)
        replace(source, target, **options)
    os.replace = replaced

def at_call(module, name, count=1, times=1):
    import importlib
    module = importlib.import_module(module)
    whole, calls = getattr(module, name), []
    def called(*words, **options):
        calls.append(name)
        if len(calls) == count:
            press(times)
        return whole(*words, **options)
    setattr(module, name, called)
"""
END = """
from ridgefeature.__main__ import main
main()
"""
PICTURES = ("profile.png", "view.png", "deviation.png")


@pytest.fixture(scope="module")
def scan_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_scan(tmp_path_factory.mktemp("scan"))


@pytest.fixture(scope="module")
def ridge(scan_file: Path) -> rf.Ridge:
    return rf.register(rf.read_scan(scan_file), PICK, max_templates=4)


def program(hook: str, *words: object, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-P", "-c", BEGIN + hook + END, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=300)


def told(done: subprocess.CompletedProcess[str]) -> str:
    """The one line."""
    assert done.returncode == 130, done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert done.stderr.startswith("ridgefeature: interrupted")
    return done.stderr.strip()


@pytest.mark.parametrize("module", ["click", "numpy", "numba", "scipy", "ridgefeature.registration"])
def test_at_the_start(module: str, scan_file: Path, tmp_path: Path) -> None:
    done = program(f"at_import({module!r})", "register", scan_file, *AT, "--out", "o", folder=tmp_path)
    assert told(done).endswith("no file was written")
    assert list(tmp_path.iterdir()) == [] and done.stdout == ""


def test_as_one_presses_keys(scan_file: Path, tmp_path: Path) -> None:
    """The signal comes from outside, while native modules are loaded."""
    hook = """
import threading
class Finder:
    def find_spec(self, found, path=None, target=None):
        if found.startswith(("scipy.", "numba.core.")) and not started:
            started.append(threading.Thread(target=lambda: os.kill(os.getpid(), signal.SIGINT)))
            started[0].start()
started = []
sys.meta_path.insert(0, Finder())
"""
    done = program(hook, "register", scan_file, *AT, "--out", "o", folder=tmp_path)
    assert told(done).endswith("no file was written")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("hook", "written"),
    [
        ("at_import('OCP.STEPControl')", ["feature.ridge.json"]),
        ("at_import('matplotlib')", ["feature.ridge.json", "ridge.step", "profile.png"]),
        ("at_writing('deviation.png')", ["feature.ridge.json", "ridge.step", *PICTURES]),
        ("at_writing('ridge.step', 2)", ["feature.ridge.json"]),
        ("at_writing('profile.png', 2)", ["feature.ridge.json", "ridge.step"]),
    ],
)
def test_as_files_are_written(hook: str, written: list[str], scan_file: Path, tmp_path: Path) -> None:
    line = told(program(hook, "register", scan_file, *AT, "--out", "o", folder=tmp_path))
    left = [n for n in ("feature.ridge.json", "ridge.step", *PICTURES) if n not in written]
    expected = f"interrupted; written to o: {', '.join(written)}"
    assert line == f"ridgefeature: {expected}" + (f"; not written: {', '.join(left)}" if left else "")
    assert sorted(p.name for p in (tmp_path / "o").iterdir()) == sorted(written)
    rf.load(tmp_path / "o" / "feature.ridge.json")


@pytest.mark.parametrize(
    ("hook", "why"),
    [
        ("at_call('ridgefeature.registration', 'lay_out')", "in the whole fit"),
        ("at_call('ridgefeature.commands.register', 'diagnose')", "as it is diagnosed"),
        ("at_call('ridgefeature.commands.register', 'read_scan')", "as it is read"),
    ],
)
def test_before_there_is_a_ridge(hook: str, why: str, scan_file: Path, tmp_path: Path) -> None:
    done = program(hook, "register", scan_file, *AT, "--out", "o", folder=tmp_path)
    assert told(done).endswith("no file was written"), why
    assert list(tmp_path.iterdir()) == []


MARCH = """
import ridgefeature.commands.register as command
import contextlib
seen = []
class Torn:
    def __del__(self):
        press()
def progress(template):
    seen.append(template)
    if len(seen) == 6:
        PRESS
command.shown_progress = lambda unit: contextlib.nullcontext(progress)
"""


@pytest.mark.parametrize("press", ["press()", "Torn()"])
def test_in_the_march(press: str, scan_file: Path, tmp_path: Path) -> None:
    """Torn: where nothing can be raised it is raised with the next template."""
    hook = MARCH.replace("PRESS", press)
    words = ("register", scan_file, *AT, "--out", "o", "--no-pictures")
    assert "as far as the march had come" in told(program(hook, *words, folder=tmp_path))
    assert sorted(p.name for p in (tmp_path / "o").iterdir()) == ["feature.ridge.json", "ridge.step"]
    assert "interrupted" in rf.load(tmp_path / "o" / "feature.ridge.json").stop


def test_a_second_one_ends_at_once(scan_file: Path, tmp_path: Path) -> None:
    hook = MARCH.replace("PRESS", "press()") + "at_writing('ridge.step', 2)"
    words = ("register", scan_file, *AT, "--out", "o", "--no-pictures")
    assert told(program(hook, *words, folder=tmp_path)).endswith("not written: ridge.step")
    assert [p.name for p in (tmp_path / "o").iterdir()] == ["feature.ridge.json"]


@pytest.mark.parametrize(("suffix", "times"), [("step", 1), ("step", 2), ("stl", 2), ("FCMacro", 1)])
def test_of_an_export(suffix: str, times: int, ridge: rf.Ridge, tmp_path: Path) -> None:
    ridge.save(tmp_path / "a.ridge.json")
    hook, words = f"at_writing('x.{suffix}', {times})", ("export", "a.ridge.json", "-o", f"x.{suffix}")
    line = told(program(hook, *words, folder=tmp_path))
    there = sorted(p.name for p in tmp_path.iterdir())
    if times == 1:
        assert line.endswith(f"written to .: x.{suffix}") and there == ["a.ridge.json", f"x.{suffix}"]
    else:
        assert line.endswith("no file was written") and there == ["a.ridge.json"]


def test_with_the_import_of_the_module_interrupts_are_left_alone() -> None:
    code = (
        "import signal; before = signal.signal(signal.SIGINT, signal.default_int_handler);"
        "import ridgefeature.cli, ridgefeature.__main__;"
        "assert signal.getsignal(signal.SIGINT) is signal.default_int_handler"
    )
    subprocess.run([sys.executable, "-P", "-c", code], check=True)
