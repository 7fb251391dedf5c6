"""Point Cloud Library files: .pcd."""

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ridgefeature.io.problems import BadFile, require


def read_pcd(path: Path) -> NDArray[Any]:
    """The x, y, z of a .pcd file: (n, 3)."""
    cloud = require("pypcd4", ".pcd", "pcd").PointCloud.from_path(path)
    missing = [name for name in "xyz" if name not in cloud.fields]
    if missing:
        raise BadFile(f"expected the fields x, y, z; it has {', '.join(cloud.fields)}")
    points: NDArray[Any] = cloud.numpy(("x", "y", "z"))
    if len(points) != cloud.metadata.points:
        raise BadFile(
            f"its header promises {cloud.metadata.points} points, it holds {len(points)}: it is cut off"
        )
    return points
