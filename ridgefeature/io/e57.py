"""Scans from terrestrial scanners: .e57."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ridgefeature.io.problems import BadFile, require


def read_e57(path: Path) -> NDArray[Any]:
    """All scans of an .e57 file, each in its pose, without points marked invalid: (n, 3)."""
    pye57 = require("pye57", ".e57", "e57")
    with pye57.E57(str(path)) as file:
        if not file.scan_count:
            raise BadFile("expected at least one scan; the file holds none")
        return np.concatenate([_scan(file, i) for i in range(file.scan_count)])


def _scan(file: Any, index: int) -> NDArray[Any]:
    fields = file.read_scan(index, ignore_missing_fields=True, transform=True)
    return np.column_stack([fields[name] for name in ("cartesianX", "cartesianY", "cartesianZ")])
