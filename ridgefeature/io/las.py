"""Laser scans: .las and, compressed, .laz."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ridgefeature.io.problems import BadFile, require


def read_las(path: Path) -> NDArray[Any]:
    """The coordinates of a .las or .laz file, with its scales and offsets applied: (n, 3)."""
    suffix = path.suffix.lower()
    laspy = require("laspy", suffix, "las")
    if suffix == ".laz":
        require("lazrs", suffix, "las")
    with laspy.open(path) as file:
        promised = file.header.point_count
        points = np.asarray(file.read().xyz)
    if len(points) != promised:
        raise BadFile(f"its header promises {promised} points, it holds {len(points)}: it is cut off")
    return points
