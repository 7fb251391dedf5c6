"""Examples run as a user runs them."""

from __future__ import annotations

import contextlib
import io
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "examples"


def run_example(name: str, empty: Path, *arguments: str) -> None:
    """Run an example in an empty folder; it must end well, print something and leave nothing behind.

    It runs as a program, but in this process: what it imports is loaded once for all examples.
    """
    printed = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
        patch.chdir(empty)
        patch.setattr(sys, "argv", [str(FOLDER / name), *arguments])
        patch.syspath_prepend(FOLDER)
        runpy.run_path(str(FOLDER / name), run_name="__main__")
    _is_well(printed.getvalue(), empty)


def run_example_afresh(name: str, empty: Path, *arguments: str) -> None:
    """The same in a process of its own, which finds nothing loaded."""
    done = subprocess.run(
        [sys.executable, FOLDER / name, *arguments],
        cwd=empty,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    _is_well(done.stdout, empty)


def _is_well(printed: str, empty: Path) -> None:
    assert printed.strip(), "an example prints what it found"
    assert list(empty.iterdir()) == [], "an example leaves nothing behind"
