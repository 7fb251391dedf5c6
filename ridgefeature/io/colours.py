"""The colours that a scan's file has: .ply, .obj and .off by vertex, .las and .laz by point."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]
SUFFIXES = (".ply", ".obj", ".off", ".las", ".laz")


def colours_at(path: Path, places: ArrayLike) -> Pixels | None:
    """Colours (n, 3) of places (n, 3), in the file's unit: those of the nearest points that the file has.

    None where it has none, or is of another format. Raises OSError where it cannot be read.
    """
    from scipy.spatial import cKDTree

    found = _read(path)
    if found is None:
        return None
    points, colours = found
    known = np.isfinite(points).all(axis=1)
    if not known.any() or len(np.unique(colours[known], axis=0)) < 2:
        return None  # one colour for all is that of a reader, not of a file
    nearest = cKDTree(points[known]).query(np.asarray(places, dtype=float))[1]
    return np.ascontiguousarray(colours[known][nearest])


def _read(path: Path) -> tuple[Array, Pixels] | None:
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        return None
    return _of_las(path) if suffix in (".las", ".laz") else _of_mesh(path)


def _of_mesh(path: Path) -> tuple[Array, Pixels] | None:
    import trimesh

    loaded = trimesh.load(path, process=False, force=None)
    if isinstance(loaded, trimesh.PointCloud):
        colours = loaded.colors
    elif isinstance(loaded, trimesh.Trimesh) and loaded.visual.kind == "vertex":
        colours = loaded.visual.vertex_colors
    else:
        return None
    if colours is None or np.shape(colours)[:1] != (len(loaded.vertices),):
        return None
    return np.asarray(loaded.vertices, dtype=float), np.asarray(colours)[:, :3].astype(np.uint8)


def _of_las(path: Path) -> tuple[Array, Pixels] | None:
    import laspy

    cloud = laspy.read(path)
    if "red" not in cloud.point_format.dimension_names:
        return None
    colours = np.column_stack([cloud.red, cloud.green, cloud.blue]).astype(float)
    # They are 16 bits by the standard, but many writers store 8.
    colours /= 256.0 if colours.max(initial=0.0) > 255.0 else 1.0
    return np.asarray(cloud.xyz, dtype=float), colours.astype(np.uint8)
