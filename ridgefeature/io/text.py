"""Tables of numbers: .xyz, .txt, .asc, .csv and .pts."""

import io
import re
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ridgefeature.io.problems import BadFile, require_text

Array = NDArray[np.float64]

TITLE = "a table of numbers, x y z first or named in a header line"
_COMMENTS = ("#", "//", "%", "!", "$")
_HEAD = 1 << 16
# Tried in this order: separator (None is white space), and whether the decimal sign is a comma.
_STYLES = [(",", False), (";", False), ("\t", False), (None, False), (";", True), ("\t", True), (None, True)]


@dataclass(frozen=True)
class Layout:
    """Where the numbers are: lines to skip, separator, columns of x, y, z, and the count it promises."""

    skip: int
    separator: str | None
    decimal_comma: bool
    columns: tuple[int, int, int]
    promised: int | None


def read_text(path: Path) -> Array:
    """The x, y, z columns of a text table: (n, 3).

    Columns are found by the names x, y, z in a header line, else they are the first three.
    """
    require_text(path, TITLE)
    layout = _layout(_head(path))
    source: Path | io.StringIO = path
    if layout.decimal_comma:
        source = io.StringIO(path.read_text(encoding="latin-1").replace(",", "."))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        points = np.loadtxt(
            source,
            delimiter=layout.separator,
            skiprows=layout.skip,
            usecols=layout.columns,
            ndmin=2,
            encoding="latin-1",
        )
    if layout.promised is not None and len(points) < layout.promised:
        raise BadFile(
            f"its first line promises {layout.promised} points, it holds {len(points)}: it is cut off"
        )
    return points


def _head(path: Path) -> list[str]:
    # Numbers are ASCII; latin-1 never fails on what else a header may hold.
    with path.open("rb") as file:
        data = file.read(_HEAD)
        whole = not file.read(1)
    lines = data.removeprefix(b"\xef\xbb\xbf").decode("latin-1").splitlines()
    return lines if whole else lines[:-1]


def _layout(lines: list[str]) -> Layout:
    header, in_comment, promised = "", False, None
    for skip, line in enumerate(lines):
        text = line.strip()
        if not text:
            continue
        if text.startswith(_COMMENTS):
            header, in_comment = text.lstrip("#/%!$ \t"), True
        elif text.isdecimal():
            promised = int(text)
        else:
            for separator, comma in _STYLES:
                columns = _columns(header, in_comment, text, separator)
                if _are_numbers(_split(text, separator), columns, comma):
                    _check_named([] if in_comment else _names(header, separator), text, separator)
                    return Layout(skip, separator, comma, columns, promised)
            header, in_comment = text, False
    shown = next((line.strip() for line in lines if line.strip()), "")
    raise BadFile(
        f"expected {TITLE}; no line near its start has three numbers; it starts with {shown[:60]!r}"
    )


def _split(text: str, separator: str | None) -> list[str]:
    return [token.strip() for token in text.split(separator)]


def _are_numbers(tokens: list[str], columns: tuple[int, int, int], decimal_comma: bool) -> bool:
    if len(tokens) <= max(columns):
        return False
    try:
        for i in columns:
            float(tokens[i].replace(",", ".") if decimal_comma else tokens[i])
    except ValueError:
        return False
    return True


def _names(header: str, separator: str | None) -> list[str]:
    """Column names, lower case, without quotes and units: 'X [mm]' is 'x'."""
    matches = [re.match(r"[a-z]*", token.strip("\"' ").lower()) for token in _split(header, separator)]
    return [match.group() if match else "" for match in matches]


def _columns(header: str, in_comment: bool, row: str, separator: str | None) -> tuple[int, int, int]:
    """The columns of x, y, z: by their names in the header, else the first three."""
    width = len(_split(row, separator))
    names = _names(header, separator)
    if in_comment and len(names) != width:
        # A comment often separates its names otherwise than the rows below it.
        names = _names(" ".join(re.split(r"[,;\s]+", header)), None)
    if len(names) != width:
        return 0, 1, 2
    if {"x", "y", "z"} <= set(names):
        return names.index("x"), names.index("y"), names.index("z")
    return 0, 1, 2


def _check_named(names: list[str], row: str, separator: str | None) -> None:
    """BadFile if more than three columns have names and these are not x, y, z: no guess is safe."""
    if len(names) > 3 and len(names) == len(_split(row, separator)) and not {"x", "y", "z"} <= set(names):
        named = ", ".join(names)
        raise BadFile(
            f"its columns are named {named[:80]}: name three of them x, y, z, or leave out the header"
        )
