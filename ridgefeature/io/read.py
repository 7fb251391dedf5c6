"""One function that reads a scan from any file, by its suffix."""

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ridgefeature.io import arrays, cad, e57, las, mesh, pcd, text
from ridgefeature.io.problems import BadFile, first_line
from ridgefeature.io.sampling import Surface
from ridgefeature.scan import MIN_POINTS, Scan, Source, millimetres_per

SAMPLE = 200_000


class Format(NamedTuple):
    """How one kind of file is read.

    read: path -> points (n, 3) or a Surface; unit: the one its standard fixes; converted: whether the
    reader has converted to that unit, so that no other can be right.
    """

    title: str
    read: Callable[[Path], NDArray[Any] | Surface]
    unit: str | None = None
    converted: bool = False


_TEXT = Format(text.TITLE, text.read_text)
_STEP = Format("a STEP file", cad.read_step, "mm", converted=True)
_IGES = Format("an IGES file", cad.read_iges, "mm", converted=True)

# A new format is one function in a file beside this one, and one line here.
FORMATS = {
    ".npy": Format("a NumPy array", arrays.read_npy),
    ".npz": Format("a NumPy archive", arrays.read_npz),
    ".xyz": _TEXT,
    ".txt": _TEXT,
    ".asc": _TEXT,
    ".csv": _TEXT,
    ".pts": _TEXT,
    ".ply": Format("a PLY file", mesh.read_ply),
    ".stl": Format("an STL file", mesh.read_stl),
    ".obj": Format("an OBJ file", mesh.read_obj),
    ".off": Format("an OFF file", mesh.read_off),
    ".pcd": Format("a PCD file", pcd.read_pcd),
    ".las": Format("a LAS file", las.read_las),
    ".laz": Format("a LAZ file", las.read_las),
    ".e57": Format("an E57 file", e57.read_e57, "m"),
    ".step": _STEP,
    ".stp": _STEP,
    ".iges": _IGES,
    ".igs": _IGES,
    ".brep": Format("a BREP file", cad.read_brep),
}


def read_scan(
    path: str | os.PathLike[str], *, sample: int = SAMPLE, vertices: bool = False, unit: str | None = None
) -> Scan:
    """Read a scan from a file; its suffix, in any case, says how.

    Point files give their points: .npy .npz .xyz .txt .asc .csv .pts .las .laz .pcd .e57, and .ply .obj
    .off without faces. Meshes (.ply .stl .obj .off) and CAD shapes (.step .stp .iges .igs .brep) are
    sampled evenly by area, with `sample` points, always the same ones. With `vertices` a mesh gives its
    vertices instead: take this for a mesh whose vertices are the measured points.

    unit: the file's length unit, one of `ridgefeature.scan.MILLIMETRES`. By default "m" for .e57 (its
    standard says so) and "mm" for the others; STEP and IGES are converted to mm.

    Raises OSError if the file cannot be opened, ValueError if it is not what its suffix says, is cut
    off, needs a library that is not installed, or holds no scan; each names the file and what to do.
    """
    file = _checked_path(path)
    form = _format(file)
    count = _checked_sample(sample)
    if unit is not None:
        millimetres_per(unit)
        if form.converted and unit != form.unit:
            raise ValueError(f"{file}: {form.title} is converted to {form.unit}; leave out unit={unit!r}")
    source = _source(file)
    points = _points(file, form, None if vertices else count)
    try:
        return Scan(points, unit or form.unit or "mm", source)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error


def _points(path: Path, form: Format, sample: int | None) -> NDArray[Any]:
    """The file's points; of a surface `sample` points, or with None its vertices."""
    try:
        content = form.read(path)
        if isinstance(content, np.ndarray):
            return content
        return content.vertices() if sample is None else content.sample(sample)
    except BadFile as error:
        raise ValueError(f"{path}: {error}") from error
    except MemoryError:
        raise
    # Format libraries raise all kinds of exceptions at a damaged file, some of their own making.
    except Exception as error:
        raise ValueError(
            f"{path}: expected {form.title}, could not read it as one ({first_line(error)}): "
            "check that it is whole and that its suffix is right"
        ) from error


def _checked_path(path: str | os.PathLike[str]) -> Path:
    if not isinstance(path, (str, os.PathLike)) or not str(path):
        raise ValueError(f"expected the path of a file; got {path!r}")
    file = Path(path)
    if file.is_dir():
        raise IsADirectoryError(f"{file}: expected a file, this is a directory: name a file in it")
    if not file.exists():
        raise FileNotFoundError(f"{file}: there is no such file: check the path")
    return file


def _format(path: Path) -> Format:
    form = FORMATS.get(path.suffix.lower())
    if path.suffix.lower() == ".json":
        raise ValueError(
            f"{path}: expected a scan, this looks like a ridge that is registered already: load it by "
            "ridgefeature.load, or see `ridgefeature info` and change its height or width by "
            "`ridgefeature export`; name the scan to register once more"
        )
    if form is None:
        raise ValueError(f"{path}: expected one of the suffixes {' '.join(FORMATS)}; got {path.suffix!r}")
    return form


def _checked_sample(sample: int) -> int:
    if isinstance(sample, bool) or not isinstance(sample, (int, np.integer)) or sample < MIN_POINTS:
        raise ValueError(f"expected sample to be a number of points, at least {MIN_POINTS}; got {sample!r}")
    return int(sample)


def _source(path: Path) -> Source:
    with path.open("rb") as file:
        if not file.read(1):
            raise ValueError(f"{path}: the file is empty")
        file.seek(0)
        return Source(path.name, hashlib.file_digest(file, "sha256").hexdigest())
