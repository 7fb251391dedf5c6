"""Calling the command line, and how it must fail."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from click.testing import CliRunner, Result

from ridgefeature.cli import main
from ridgefeature.synthetic import Spiral

PICK = (28.94, 7.906, 5.764)
AT = ("--at", *map(str, PICK))


def save_scan(folder: Path) -> Path:
    """A small noisy spiral as a file; PICK lies on its crest."""
    np.save(folder / "spiral.npy", Spiral().points(15_000, 0.1, seed=3))
    return folder / "spiral.npy"


def run(*words: object) -> Result:
    return CliRunner().invoke(main, [str(word) for word in words])


def fails(result: Result, status: int, *said: str) -> None:
    """One line on stderr that says all this, nothing on stdout, and the exit status."""
    assert isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code == status, result.stderr
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("ridgefeature: ")
    for words in said:
        assert words in lines[0]
