"""Ridges back from the STEP files that carry them."""

from __future__ import annotations

import os
from pathlib import Path

from cad_export.record import Carried
from cad_export.step_properties import records_in
from ridgefeature.io.feature import from_document
from ridgefeature.ridge import Ridge


def load(path: str | os.PathLike[str], name: str | None = None) -> Ridge | tuple[Ridge, ...]:
    """The Ridge that a STEP file carries, as it was registered, equal to the last bit and in its own unit.

    Of several it returns a tuple, in the order of the names "ridge", "ridge 2", ...; `name` picks one. The
    rates at which the faces were made are in `carried_in`.
    Raises OSError when the file cannot be read. Raises ValueError when it is no STEP file or cut off, carries
    no ridge feature or none of that name, or when the feature is damaged or of a later version.
    """
    records = carried_in(path)
    if name is not None:
        records = [record for record in records if record.name == name] or _none_named(path, name, records)
    ridges = tuple(ridge_of(record, path) for record in records)
    return ridges[0] if len(ridges) == 1 else ridges


def carried_in(path: str | os.PathLike[str]) -> list[Carried]:
    """The records of all ridge features that a STEP file carries, at least one. Raises as `load` does."""
    records = records_in(path)
    if not records:
        raise ValueError(
            f"{Path(path).name}: carries no ridge feature; expected a STEP file written by cad_export.step "
            "from a ridge, give that or the .ridge.json"
        )
    return records


def _none_named(path: str | os.PathLike[str], name: str, records: list[Carried]) -> list[Carried]:
    known = ", ".join(repr(record.name) for record in records)
    raise ValueError(f"{Path(path).name}: expected one of the names {known}, got {name!r}; choose one")


def ridge_of(record: Carried, path: str | os.PathLike[str]) -> Ridge:
    """The ridge of a record that came from this file."""
    try:
        return from_document(record.feature)
    except ValueError as error:
        raise ValueError(f"{Path(path).name}: {record.name}: {error}") from error
