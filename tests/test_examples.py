"""Every example runs as a user would run it; each asserts its own figures."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "examples"
SCRIPTS = sorted(path.name for path in FOLDER.glob("*.py") if "__main__" in path.read_text())


def test_the_examples_are_there() -> None:
    asked = {"spiral.py", "constant_bead.py", "clay.py", "mountain_ridge.py", "resize_and_export.py"}
    assert asked <= set(SCRIPTS)


@pytest.mark.parametrize("name", SCRIPTS)
def test_example(name: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, FOLDER / name],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip(), "an example prints what it found"
    assert list(tmp_path.iterdir()) == [], "an example leaves nothing behind"
