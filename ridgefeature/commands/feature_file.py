"""Features from the files that hold them."""

from __future__ import annotations

from pathlib import Path

from ridgefeature.io import load
from ridgefeature.ridge import Ridge

CAD = (".step", ".stp")


def load_feature(path: Path) -> Ridge:
    """The ridge in a .ridge.json, or in a STEP file that carries one. Raises OSError or ValueError."""
    if path.is_dir():
        raise IsADirectoryError(f"{path}: expected a feature file, this is a folder: name a file in it")
    if not path.exists():
        raise FileNotFoundError(f"{path}: there is no such file: check the path")
    if path.suffix.lower() not in CAD:
        return load(path)
    import cad_export

    read = getattr(cad_export, "load", None)
    if read is None:
        raise ValueError(f"{path}: this release does not read features from STEP: give the .ridge.json")
    ridge: Ridge = read(path)
    return ridge
