"""Features from the files that hold them."""

from __future__ import annotations

from pathlib import Path

from ridgefeature.io import load
from ridgefeature.ridge import Ridge

CAD = (".step", ".stp")


def load_feature(path: Path) -> Ridge:
    """The ridge as registered, in a .ridge.json or in a STEP file that carries one.

    Raises OSError or ValueError.
    """
    if path.is_dir():
        raise IsADirectoryError(f"{path}: expected a feature file, this is a folder: name a file in it")
    if not path.exists():
        raise FileNotFoundError(f"{path}: there is no such file: check the path")
    if path.suffix.lower() not in CAD:
        return load(path)
    from cad_export.loading import carried_in, ridge_of

    records = carried_in(path)
    if len(records) > 1:
        names = ", ".join(repr(record.name) for record in records)
        raise ValueError(
            f"{path}: expected one ridge feature, got {len(records)} ({names}); in Python, "
            "cad_export.load(path, name=...).save(...) makes a .ridge.json of one"
        )
    ridge: Ridge = ridge_of(records[0], path)
    return ridge
