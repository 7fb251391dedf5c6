"""The folder a command writes to: checked before the work, left as it was if the work fails."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ridgefeature.commands import interrupts
from ridgefeature.io.target import naming


@contextmanager
def output_folder(folder: Path, names: Iterable[str]) -> Iterator[Path]:
    """The folder, made if need be and found to be writable; folders made here go again if the work fails.

    names: files that will be written. Raises OSError if that cannot be.
    """
    names = list(names)
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    if folder.exists() and not folder.is_dir():
        raise NotADirectoryError(f"{folder}: expected a folder to write to, this is a file: name another")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with naming(folder), tempfile.TemporaryFile(dir=folder):
            pass
        for name in names:
            if (folder / name).is_dir():
                raise IsADirectoryError(
                    f"{folder / name}: expected a file to replace, this is a folder: remove it"
                )
        interrupts.writes(folder, names, made)
        yield folder
    except BaseException:
        for path in made:
            if path.is_dir() and not any(path.iterdir()):
                path.rmdir()
        raise


@contextmanager
def beside(path: Path) -> Iterator[Path]:
    """A name in the same folder to write to, renamed to `path` when that is done: never half a file there.

    Raises OSError if nothing was written.
    """
    name = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        name.touch()
        yield name
        if name.stat().st_size == 0:
            raise OSError(f"{path}: it could not be written: check the space left on the disk")
        os.replace(name, path)
    finally:
        name.unlink(missing_ok=True)
