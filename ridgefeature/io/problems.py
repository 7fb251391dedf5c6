"""What may go wrong in reading a file, in words of one line."""

import importlib
from pathlib import Path
from typing import Any


class BadFile(ValueError):
    """A file that is not what it should be; the text says why, `read_scan` adds which file."""


def require(module: str, suffix: str, extra: str) -> Any:
    """The imported module, or a BadFile that says how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        name = module.partition(".")[0]
        raise BadFile(f"reading {suffix} needs {name}: pip install 'ridgefeature[{extra}]'") from error


def require_text(path: Path, title: str) -> None:
    """BadFile if the file starts like a binary one."""
    with path.open("rb") as file:
        if b"\0" in file.read(4096):
            raise BadFile(f"expected {title}, which is text; this file is binary: check its suffix")


def first_line(error: BaseException) -> str:
    """The first line of an error's message, shortened; its type where it has none."""
    lines = str(error).strip().splitlines()
    return lines[0][:160].rstrip(" .:") if lines else type(error).__name__
