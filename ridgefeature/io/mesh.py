"""Meshes and the point clouds that come in their formats: .ply, .stl, .obj and .off."""

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ridgefeature.io.problems import BadFile, require_text
from ridgefeature.io.sampling import Mesh

Array = NDArray[np.float64]


def read_ply(path: Path) -> Array | Mesh:
    """A .ply file: a Mesh, or the points (n, 3) where it has no faces."""
    counts = _ply_counts(path)
    try:
        vertices, faces = _load(path)
    except ValueError as error:
        if "unexpected length" not in str(error):
            raise
        raise BadFile(
            "its length does not fit its header: it is cut off, or its faces differ in their number of "
            "corners; save these as triangles, or as a text PLY"
        ) from error
    return _mesh(vertices, faces, counts.get("vertex", 0), counts.get("face", 0))


def read_stl(path: Path) -> Mesh:
    """An .stl file, binary or text: a Mesh whose vertices are the distinct corners."""
    _check_stl(path)
    vertices, faces = _load(path)
    if not len(faces):
        raise BadFile("expected triangles; the file holds none")
    return Mesh(vertices[faces], vertices, repeats=True)


def read_obj(path: Path) -> Array | Mesh:
    """An .obj file: a Mesh, or the points (n, 3) where it has no faces."""
    require_text(path, "an OBJ file")
    # The library drops vertices without a face and splits others; in a scan each one was measured.
    with path.open("rb") as file:
        rows = [line.split(None, 1)[1] for line in file if line.startswith((b"v ", b"v\t"))]
    if not rows:
        raise BadFile("expected an OBJ file with vertices, lines that start with 'v'; it has none")
    measured = np.loadtxt(rows, usecols=(0, 1, 2), ndmin=2)
    vertices, faces = _load(path, skip_materials=True, group_material=False)
    return Mesh(vertices[faces], measured) if len(faces) else measured


def read_off(path: Path) -> Array | Mesh:
    """An .off file: a Mesh, or the points (n, 3) where it has no faces."""
    require_text(path, "an OFF file")
    with path.open("rb") as file:
        head = re.sub(rb"#.*", b"", file.read(4096))
    counts = re.match(rb"\s*\w*OFF\s+(\d+)\s+(\d+)", head)
    if not counts:
        raise BadFile("expected an OFF file: 'OFF', then the numbers of vertices and faces")
    return _mesh(*_load(path), *map(int, counts.groups()))


def _load(path: Path, **options: Any) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (k, 3) and triangles (m, 3) of a file, neither merged nor cleaned."""
    import trimesh

    loaded = trimesh.load(path, process=False, **options)
    parts = list(loaded.geometry.values()) if isinstance(loaded, trimesh.Scene) else [loaded]
    if not parts:
        raise BadFile("expected vertices; the file holds none that can be read")
    vertices = [np.asarray(part.vertices, dtype=np.float64).reshape(-1, 3) for part in parts]
    starts = np.cumsum([0, *map(len, vertices)])
    faces = [
        np.asarray(getattr(part, "faces", []), dtype=np.int64).reshape(-1, 3) + start
        for part, start in zip(parts, starts, strict=False)
    ]
    return np.concatenate(vertices), np.concatenate(faces)


def _mesh(vertices: Array, faces: NDArray[np.int64], n_vertices: int, n_faces: int) -> Array | Mesh:
    """A Mesh, or the vertices where there are no faces; BadFile if there is less than the header promises."""
    # A face of more corners becomes several triangles, so there may be more faces than promised.
    if len(vertices) != n_vertices or len(faces) < n_faces:
        raise BadFile(
            f"its header promises {n_vertices} vertices and {n_faces} faces, it holds {len(vertices)} and "
            f"{len(faces)}: it is cut off or damaged"
        )
    if len(faces) and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise BadFile("its faces name vertices that are not there: it is damaged")
    return Mesh(vertices[faces], vertices) if len(faces) else vertices


def _ply_counts(path: Path) -> dict[str, int]:
    """How many of each element a .ply header promises."""
    with path.open("rb") as file:
        if file.readline(16).strip() != b"ply":
            raise BadFile("expected a PLY file; its first line is not 'ply'")
        counts: dict[str, int] = {}
        for line in file:
            words = line.split()
            if words == [b"end_header"]:
                return counts
            if len(words) == 3 and words[0] == b"element":
                counts[words[1].decode("latin-1")] = int(words[2])
    raise BadFile("its PLY header has no end: it is cut off or damaged")


def _check_stl(path: Path) -> None:
    """BadFile if the file's length does not fit its triangle count, or its text has no end."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(84)
        file.seek(max(0, size - 1024))
        tail = file.read()
    promised = int.from_bytes(head[80:84], "little")
    if size == 84 + 50 * promised:
        return
    if not head.lstrip().startswith(b"solid") or b"\0" in head + tail:
        raise BadFile(
            f"expected an STL file; as a binary one of {promised} triangles it would have "
            f"{84 + 50 * promised} bytes, not {size}: it is cut off, or not STL"
        )
    if b"endsolid" not in tail.lower():
        raise BadFile("expected a text STL file that ends with 'endsolid': it is cut off, or not STL")
