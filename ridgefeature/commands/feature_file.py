"""Features from the files that hold them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ridgefeature.io import load
from ridgefeature.ridge import Ridge

if TYPE_CHECKING:
    from cad_export.record import Carried

CAD = (".step", ".stp")


def check_is_feature(path: Path) -> None:
    """Raises OSError for a path that is not one of a file, ValueError for a suffix no feature file has."""
    if path.is_dir():
        raise IsADirectoryError(f"{path}: expected a feature file, this is a folder: name a file in it")
    if not path.exists():
        raise FileNotFoundError(f"{path}: there is no such file: check the path")
    suffix = path.suffix.lower()
    if suffix in (*CAD, ".json"):
        return
    from ridgefeature.io.read import FORMATS

    expected = f"{path}: expected a ridge feature, a .ridge.json or a STEP file that carries one"
    if suffix in FORMATS:
        raise ValueError(
            f"{expected}, got {FORMATS[suffix].title}; register a ridge in a scan first: "
            f"ridgefeature register {path} --at X Y Z"
        )
    raise ValueError(f"{expected}, got {suffix!r}; name the file that `ridgefeature register` wrote")


def load_feature(path: Path) -> Ridge:
    """The ridge as registered, in a .ridge.json or in a STEP file that carries one.

    Raises OSError or ValueError.
    """
    check_is_feature(path)
    if path.suffix.lower() not in CAD:
        return load(path)
    from cad_export.loading import carried_in, ridge_of

    ridge: Ridge = ridge_of(chosen(path, carried_in(path), None), path)
    return ridge


def chosen(path: Path, records: list[Carried], name: str | None) -> Carried:
    """The record of that name; without one, the only record. Raises ValueError where there is none such."""
    names = ", ".join(repr(record.name) for record in records)
    if name is None:
        if len(records) != 1:
            raise ValueError(
                f"{path.name}: expected one ridge feature, got {len(records)} ({names}); choose one by --name"
            )
        return records[0]
    for record in records:
        if record.name == name:
            return record
    raise ValueError(f"--name: expected one of {names} in {path.name}, got {name!r}; choose one")
