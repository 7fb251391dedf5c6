"""`ridgefeature export`: a feature as a CAD file, at other heights and widths if asked."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from ridgefeature.commands.feature_file import load_feature
from ridgefeature.commands.folder import beside
from ridgefeature.ridge import Ridge


def run(feature: Path, output: Path, h: float, w: float) -> None:
    """Write `feature` to `output`, whose suffix says how. Raises ValueError or OSError."""
    write = _WRITERS.get(output.suffix.lower())
    if write is None:
        raise ValueError(
            f"{output}: expected one of the suffixes {' '.join(_WRITERS)}; got {output.suffix!r}"
        )
    if not output.parent.is_dir():
        raise FileNotFoundError(f"{output.parent}: there is no such folder to write to: create it first")
    ridge = load_feature(feature).resized(h=h, w=w)
    write(ridge, output)
    click.echo(f"wrote {output}")


def _step(ridge: Ridge, path: Path) -> None:
    import cad_export

    cad_export.step(ridge, path)


def _brep(ridge: Ridge, path: Path) -> None:
    face = _face_in_mm(ridge)
    with beside(path) as name:
        face.exportBrep(str(name))


def _stl(ridge: Ridge, path: Path) -> None:
    face = _face_in_mm(ridge)
    chord = 1e-4 * face.BoundingBox().DiagonalLength  # finer than a scan is
    with beside(path) as name:
        face.exportStl(str(name), chord, 0.1)


def _face_in_mm(ridge: Ridge) -> Any:
    import cad_export
    from ridgefeature.scan import millimetres_per

    return cad_export.face(ridge).scale(millimetres_per(ridge.unit))


# A new format is one function above, and one line here.
_WRITERS: dict[str, Callable[[Ridge, Path], None]] = {
    ".step": _step,
    ".stp": _step,
    ".brep": _brep,
    ".stl": _stl,
}
