"""Examples run as a user runs them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "examples"


def run_example(name: str, empty: Path, *arguments: str) -> None:
    """Run an example in an empty folder; it must end well, print something and leave nothing behind."""
    done = subprocess.run(
        [sys.executable, FOLDER / name, *arguments],
        cwd=empty,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip(), "an example prints what it found"
    assert list(empty.iterdir()) == [], "an example leaves nothing behind"
