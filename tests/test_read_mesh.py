import numpy as np
import pytest
from reading import POINTS, refused, rows, write

from ridgefeature.io import read_scan
from ridgefeature.io.sampling import areas


def grid_mesh(n=6):
    """A wavy height field: vertices (n * n, 3), triangles (m, 3)."""
    x, y = np.meshgrid(np.arange(n, dtype=float), np.arange(n, dtype=float))
    vertices = np.column_stack([x.ravel(), y.ravel(), np.sin(x.ravel()) + 0.25 * y.ravel()])
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    return vertices, np.concatenate(
        [np.column_stack([a, a + 1, a + n]), np.column_stack([a + 1, a + n + 1, a + n])]
    )


def mesh_file(path):
    import trimesh

    vertices, faces = grid_mesh()
    trimesh.Trimesh(vertices, faces, process=False).export(path)
    return path, vertices, faces


def off_surface(points, vertices, faces):
    """Largest distance of points from the plane of the nearest-in-plan triangle of a height field."""
    corners = vertices[faces]
    worst = 0.0
    for p in points:
        a, b, c = corners.transpose(1, 0, 2)
        plan = np.stack([b - a, c - a], axis=-1)[:, :2, :]
        weights = np.linalg.solve(plan, (p - a)[:, :2, None])[:, :, 0]
        inside = (weights >= -1e-6).all(axis=1) & (weights.sum(axis=1) <= 1 + 1e-6)
        heights = a[:, 2] + (weights * np.stack([b - a, c - a], axis=1)[:, :, 2]).sum(axis=1)
        worst = max(worst, np.abs(heights[inside] - p[2]).min(initial=np.inf))
    return worst


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj", ".off"])
def test_mesh_is_sampled_evenly_by_area(tmp_path, suffix):
    path, vertices, faces = mesh_file(tmp_path / f"a{suffix}")
    scan = read_scan(path, sample=1000)
    assert len(scan) == 1000
    assert off_surface(scan.points, vertices, faces) < 1e-5
    area = areas(vertices[faces])
    x_centre = (area * vertices[faces][:, :, 0].mean(axis=1)).sum() / area.sum()
    assert scan.points[:, 0].mean() == pytest.approx(x_centre, abs=0.02)
    np.testing.assert_array_equal(read_scan(path, sample=1000).points, scan.points)


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj", ".off"])
def test_mesh_vertices_on_request(tmp_path, suffix):
    path, vertices, _ = mesh_file(tmp_path / f"a{suffix}")
    points = read_scan(path, vertices=True).points
    order = np.lexsort(vertices.T[::-1])
    np.testing.assert_allclose(points[np.lexsort(points.T[::-1])], vertices[order], atol=1e-6)


def test_default_sample_is_200_000(tmp_path):
    assert len(read_scan(mesh_file(tmp_path / "a.stl")[0])) == 200_000


def ascii_ply(points, faces=(), colours=False):
    colour = "property uchar red\nproperty uchar green\nproperty uchar blue\n" if colours else ""
    tail = " 255 0 10" if colours else ""
    face = f"element face {len(faces)}\nproperty list uchar int vertex_indices\n" if len(faces) else ""
    head = f"ply\nformat ascii 1.0\ncomment by hand\nelement vertex {len(points)}\n"
    head += "property double x\nproperty double y\nproperty double z\n" + colour + face + "end_header\n"
    body = rows(points).replace("\n", tail + "\n")
    return head + body + "".join(f"{len(f)} {' '.join(map(str, f))}\n" for f in faces)


def binary_ply(points, faces=()):
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "property double x\nproperty double y\nproperty double z\n"
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    body = b"".join(np.uint8(len(f)).tobytes() + np.array(f, "<i4").tobytes() for f in faces)
    return head.encode() + np.asarray(points, "<f8").tobytes() + body


@pytest.mark.parametrize("content", [ascii_ply(POINTS), ascii_ply(POINTS, colours=True), binary_ply(POINTS)])
def test_ply_without_faces_is_a_point_cloud(tmp_path, content):
    np.testing.assert_array_equal(read_scan(write(tmp_path / "a.ply", content)).points, POINTS)


@pytest.mark.parametrize(
    ("make", "faces"),
    [
        (ascii_ply, [(0, 1, 2, 3), (4, 5, 6), (7, 8, 9, 10, 11)]),
        (binary_ply, [(0, 1, 2, 3), (4, 5, 6, 7)]),
        (binary_ply, [(0, 1, 2), (4, 5, 6)]),
    ],
)
def test_ply_with_polygons_and_loose_vertices(tmp_path, make, faces):
    path = write(tmp_path / "a.ply", make(POINTS, faces))
    np.testing.assert_array_equal(read_scan(path, vertices=True).points, POINTS)
    assert len(read_scan(path, sample=50)) == 50


@pytest.mark.parametrize("make", [ascii_ply, binary_ply])
@pytest.mark.parametrize("part", [0.001, 0.01, 0.3, 0.6, 0.9])
@pytest.mark.parametrize("with_faces", [True, False])
def test_ply_cut_off(tmp_path, make, part, with_faces):
    vertices, faces = grid_mesh()
    content = make(vertices, faces if with_faces else [])
    refused(write(tmp_path / "a.ply", content[: int(len(content) * part)]))


def test_binary_ply_with_faces_of_several_sizes_is_refused_not_misread(tmp_path):
    refused(
        write(tmp_path / "a.ply", binary_ply(POINTS, [(0, 1, 2, 3), (4, 5, 6)])), "save these as triangles"
    )
    refused(write(tmp_path / "b.ply", binary_ply(POINTS, [(0, 1, 2, 3), (4, 5, 6), (7, 8, 9, 10, 11)])))


@pytest.mark.parametrize("bad", [-1, 300])
def test_faces_that_name_missing_vertices_are_refused(tmp_path, bad):
    refused(write(tmp_path / "a.ply", binary_ply(POINTS, [(0, 1, bad)])), "vertices that are not there")


def test_ply_without_coordinates(tmp_path):
    content = (
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float a\nproperty float b\nend_header\n1 2\n3 4\n"
    )
    refused(write(tmp_path / "a.ply", content))


@pytest.mark.parametrize("part", [0.0005, 0.01, 0.5, 0.99])
@pytest.mark.parametrize("text", [True, False])
def test_stl_cut_off(tmp_path, part, text):
    import trimesh

    mesh = trimesh.Trimesh(*grid_mesh(), process=False)
    content = trimesh.exchange.stl.export_stl_ascii(mesh).encode() if text else mesh.export(file_type="stl")
    whole = write(tmp_path / "whole.stl", content)
    assert len(read_scan(whole, sample=100)) == 100
    refused(write(tmp_path / "a.stl", content[: max(1, int(len(content) * part))]))


def test_obj_keeps_each_measured_vertex(tmp_path):
    lines = "".join(f"v {p[0]!r} {p[1]!r} {p[2]!r} 0.5 0.5 0.5\n" for p in POINTS.tolist())
    cloud = write(tmp_path / "a.obj", lines)
    np.testing.assert_array_equal(read_scan(cloud).points, POINTS)
    uv = "vt 0 0\nvt 1 1\nusemtl one\nf 1/1 2/2 3/1\nusemtl two\nf 1/2 3/1 4/2 5/1\n"
    mesh = write(tmp_path / "b.obj", "mtllib none.mtl\n" + lines + uv)
    np.testing.assert_array_equal(read_scan(mesh, vertices=True).points, POINTS)
    assert len(read_scan(mesh, sample=64)) == 64


def test_off_without_faces(tmp_path):
    path = write(tmp_path / "a.off", f"OFF\n{len(POINTS)} 0 0\n" + rows(POINTS))
    np.testing.assert_array_equal(read_scan(path).points, POINTS)


def test_off_cut_off(tmp_path):
    content = mesh_file(tmp_path / "whole.off")[0].read_bytes()
    for part in (0.01, 0.3, 0.6, 0.9):
        refused(write(tmp_path / "a.off", content[: int(len(content) * part)]))


def test_a_mesh_without_area_says_what_to_do(tmp_path):
    path = write(tmp_path / "a.ply", binary_ply(POINTS, [(0, 0, 0), (1, 1, 2)]))
    refused(path, "vertices=True")
    assert len(read_scan(path, vertices=True)) == 300
