"""Colours that scans' files have."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from ridgefeature.io.colours import colours_at

POINTS = np.random.default_rng(0).uniform(-10, 10, (500, 3))
COLOURS = np.random.default_rng(1).integers(0, 256, (500, 3)).astype(np.uint8)


@pytest.mark.parametrize("binary", ["ascii", "binary"])
def test_a_cloud_has_its_colours_whatever_the_order_of_the_places(tmp_path: Path, binary: str) -> None:
    path = tmp_path / "a.ply"
    trimesh.PointCloud(POINTS, COLOURS).export(path, encoding=binary)
    order = np.random.default_rng(2).permutation(500)[:200]
    found = colours_at(path, POINTS[order] + 1e-4)
    assert found is not None and np.array_equal(found, COLOURS[order])


def test_a_mesh_has_those_of_its_vertices(tmp_path: Path) -> None:
    mesh = trimesh.creation.icosphere(2)
    colours = np.random.default_rng(3).integers(0, 256, (len(mesh.vertices), 4)).astype(np.uint8)
    mesh.visual.vertex_colors = colours
    mesh.export(tmp_path / "a.ply")
    found = colours_at(tmp_path / "a.ply", mesh.vertices)
    assert found is not None and np.array_equal(found, colours[:, :3])


@pytest.mark.parametrize("bits", [8, 16])
def test_a_laser_scan_has_its_colours(tmp_path: Path, bits: int) -> None:
    laspy = pytest.importorskip("laspy")
    cloud = laspy.create(point_format=2, file_version="1.2")
    cloud.header.scales = [1e-3] * 3
    cloud.x, cloud.y, cloud.z = POINTS.T
    factor = 256 if bits == 16 else 1
    cloud.red, cloud.green, cloud.blue = (COLOURS.astype(np.uint16) * factor).T
    cloud.write(tmp_path / "a.las")
    found = colours_at(tmp_path / "a.las", POINTS)
    assert found is not None and np.array_equal(found, COLOURS)


def test_files_without_colours_have_none(tmp_path: Path) -> None:
    trimesh.PointCloud(POINTS).export(tmp_path / "a.ply")
    trimesh.creation.box().export(tmp_path / "b.ply")
    np.save(tmp_path / "c.npy", POINTS)
    for name in ("a.ply", "b.ply", "c.npy"):
        assert colours_at(tmp_path / name, POINTS) is None
