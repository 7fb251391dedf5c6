"""NumPy's own files: .npy and .npz."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ridgefeature.io.problems import BadFile


def read_npy(path: Path) -> NDArray[Any]:
    """The array in a .npy file."""
    _check_magic(path, b"\x93NUMPY", ".npy")
    array: NDArray[Any] = np.load(path, allow_pickle=False)
    return array


def read_npz(path: Path) -> NDArray[Any]:
    """The array "points" of a .npz file, or its only (n, 3) array."""
    _check_magic(path, b"PK", ".npz")
    with np.load(path, allow_pickle=False) as archive:
        if "points" in archive.files:
            return np.asarray(archive["points"])
        arrays = {key: np.asarray(archive[key]) for key in archive.files}
    tables = [array for array in arrays.values() if array.ndim == 2 and array.shape[1] == 3]
    if len(tables) != 1:
        held = ", ".join(f"{key} {array.shape}" for key, array in arrays.items()) or "no array"
        raise BadFile(
            f'expected an array "points" or exactly one (n, 3) array; it holds {held}: '
            "save it with numpy.savez(path, points=...)"
        )
    return tables[0]


def _check_magic(path: Path, magic: bytes, suffix: str) -> None:
    with path.open("rb") as file:
        if file.read(len(magic)) != magic:
            raise BadFile(f"expected a {suffix} file as NumPy writes it; it does not start like one")
