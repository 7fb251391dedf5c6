"""Files to write: what cannot be written is told by the name that the user gave."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def naming(path: str | os.PathLike[str]) -> Iterator[None]:
    """An OSError in here names this path, not the file beside it that is written first."""
    try:
        yield
    except OSError as error:
        if error.filename is not None:
            error.filename = str(path)
        raise
