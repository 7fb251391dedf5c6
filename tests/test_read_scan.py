import hashlib
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ridgefeature.io import read_scan
from ridgefeature.io.read import FORMATS
from ridgefeature.io.sampling import Mesh, areas, spread

POINTS = np.random.default_rng(5).normal(size=(300, 3)) * 10

# A square plate of 10 x 10 in the plane z = 2, and a vertex that no face uses.
PLATE = np.array([[0, 0, 2], [10, 0, 2], [10, 10, 2], [0, 10, 2]], float)


def grid_mesh(n=6):
    """A wavy height field: vertices (n * n, 3), triangles (m, 3)."""
    x, y = np.meshgrid(np.arange(n, dtype=float), np.arange(n, dtype=float))
    vertices = np.column_stack([x.ravel(), y.ravel(), np.sin(x.ravel()) + 0.25 * y.ravel()])
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    return vertices, np.concatenate(
        [np.column_stack([a, a + 1, a + n]), np.column_stack([a + 1, a + n + 1, a + n])]
    )


def rows(points, separator=" "):
    return "".join(separator.join(repr(float(c)) for c in p) + "\n" for p in points)


def write(path, content):
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def refused(path, *words, **options):
    """The one-line message with which `path` is refused."""
    with pytest.raises((ValueError, OSError)) as caught:
        read_scan(path, **options)
    message = str(caught.value)
    assert str(path) in message and "\n" not in message
    for word in words:
        assert word in message
    return message


# NumPy files


def test_npy(tmp_path):
    np.save(tmp_path / "a.npy", POINTS)
    scan = read_scan(tmp_path / "a.npy")
    np.testing.assert_array_equal(scan.points, POINTS)
    assert scan.unit == "mm"
    assert scan.source.name == "a.npy"
    assert scan.source.sha256 == hashlib.sha256((tmp_path / "a.npy").read_bytes()).hexdigest()


def test_suffix_case_and_string_paths(tmp_path):
    np.save(tmp_path / "a.npy", POINTS)
    (tmp_path / "a.npy").rename(tmp_path / "B.NPY")
    assert len(read_scan(str(tmp_path / "B.NPY"), unit="in")) == 300
    assert read_scan(tmp_path / "B.NPY", unit="in").unit == "in"


def test_npz_takes_points_or_the_only_table(tmp_path):
    np.savez(tmp_path / "a.npz", points=POINTS, normals=POINTS + 1)
    np.savez_compressed(tmp_path / "b.npz", xyz=POINTS, colour=np.zeros(300))
    for name in "ab":
        np.testing.assert_array_equal(read_scan(tmp_path / f"{name}.npz").points, POINTS)


def test_npz_that_is_ambiguous_names_its_keys(tmp_path):
    np.savez(tmp_path / "a.npz", first=POINTS, second=POINTS)
    refused(tmp_path / "a.npz", "first (300, 3)", "second (300, 3)", "points")
    np.savez(tmp_path / "b.npz")
    refused(tmp_path / "b.npz", "no array")


def test_numpy_files_that_are_wrong(tmp_path):
    np.save(tmp_path / "flat.npy", POINTS.ravel())
    refused(tmp_path / "flat.npy", "(900,)")
    np.save(tmp_path / "object.npy", np.array([None, {}], object), allow_pickle=True)
    refused(tmp_path / "object.npy")
    refused(write(tmp_path / "words.npy", "hello"), "NumPy")
    refused(write(tmp_path / "words.npz", "hello"), "NumPy")


def test_rows_with_nan_are_dropped(tmp_path):
    np.save(tmp_path / "a.npy", np.vstack([POINTS, [[np.nan, 0, 0]]]))
    with pytest.warns(UserWarning, match="dropped 1 of 301"):
        scan = read_scan(tmp_path / "a.npy")
    np.testing.assert_array_equal(scan.points, POINTS)


# Text tables

EXTRA = np.column_stack([POINTS, np.arange(300)])
SHUFFLED = np.column_stack([np.arange(300), POINTS[:, 2], POINTS[:, 0], POINTS[:, 1]])


@pytest.mark.parametrize(
    "content",
    [
        rows(POINTS),
        rows(POINTS, ","),
        rows(POINTS, ", "),
        rows(POINTS, ";"),
        rows(POINTS, "\t"),
        rows(POINTS, "   "),
        rows(EXTRA),
        rows(EXTRA, ","),
        rows(POINTS, ",").replace("\n", ",\n"),
        rows(POINTS, ";").replace(".", ","),
        rows(POINTS).replace(".", ","),
        rows(POINTS).replace("\n", "\r\n"),
        rows(POINTS).replace("\n", "\n\n"),
        "# made by hand\n# x y z\n" + rows(POINTS),
        "\ufeffx,y,z\n" + rows(POINTS, ","),
        "x,y,z,intensity\n" + rows(EXTRA, ","),
        'intensity,"Z","X","Y"\n' + rows(SHUFFLED, ","),
        "intensity z x y\n" + rows(SHUFFLED),
        "# intensity, z, x, y\n" + rows(SHUFFLED),
        "i;Z [mm];X [mm];Y [mm]\n" + rows(SHUFFLED, ";"),
        "//X,Y,Z,Intensity\n300\n" + rows(EXTRA, ","),
        "300\n" + rows(EXTRA),
        "scan of a clay model\nx y z\n" + rows(POINTS),
        "easting northing height\n" + rows(POINTS),
        rows(POINTS[:150]) + "# half way\n" + rows(POINTS[150:]),
        "x,y,z,label\n" + "".join(f"{p[0]!r},{p[1]!r},{p[2]!r},clay\n" for p in POINTS.tolist()),
        "label,x,y,z\n" + "".join(f"a,{p[0]!r},{p[1]!r},{p[2]!r}\n" for p in POINTS.tolist()),
    ],
)
def test_text_tables(tmp_path, content):
    scan = read_scan(write(tmp_path / "a.txt", content))
    np.testing.assert_array_equal(scan.points, POINTS)


@pytest.mark.parametrize("suffix", [".xyz", ".txt", ".asc", ".csv", ".pts"])
def test_text_suffixes(tmp_path, suffix):
    assert len(read_scan(write(tmp_path / f"a{suffix}", rows(POINTS)))) == 300


@given(
    st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 3), min_size=5, max_size=20),
    st.sampled_from([" ", ",", ";", "\t", ", "]),
    st.booleans(),
)
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_text_keeps_every_bit(tmp_path, some, separator, named):
    points = np.concatenate([some, POINTS[:20]])
    content = ("x y z\n".replace(" ", separator) if named else "") + rows(points, separator)
    np.testing.assert_array_equal(read_scan(write(tmp_path / "a.xyz", content)).points, points)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("these are words\nand nothing else\n", "these are words"),
        ("1 2\n3 4\n", "three numbers"),
        ("# only a comment\n", "three numbers"),
        ("\n\n\n", "three numbers"),
        ("t,px,py,pz\n" + rows(EXTRA, ","), "t, px, py, pz"),
        ("301\n" + rows(POINTS), "promises 301 points, it holds 300"),
        (rows(POINTS) + "and then words\n", "could not read"),
        (rows(POINTS) + "1 2\n", "could not read"),
        (rows(POINTS[:5]), "16"),
        (POINTS.tobytes(), "binary"),
        ("x" * 100_000, "three numbers"),
    ],
)
def test_text_that_is_wrong(tmp_path, content, words):
    refused(write(tmp_path / "a.xyz", content), words)


# Meshes


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


# Sampling


@given(
    st.lists(st.floats(0, 1e3), min_size=1, max_size=30).filter(lambda a: sum(a) > 1e-3), st.integers(1, 500)
)
@settings(deadline=None)
def test_each_triangle_gets_its_share(area, n):
    which, weights = spread(np.array(area), n)
    share = n * np.array(area) / sum(area)
    assert (np.abs(np.bincount(which, minlength=len(area)) - share) <= 1 + 1e-6).all()
    assert (np.diff(which) >= 0).all()
    assert (weights >= 0).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1)


def test_samples_leave_no_holes_and_no_clumps():
    from scipy.spatial import cKDTree

    corners = np.array([PLATE[[0, 1, 2]], PLATE[[0, 2, 3]]])
    points = Mesh(corners, PLATE).sample(2500)
    assert (points[:, 2] == 2).all()
    assert points.min() >= 0 and points.max() <= 10
    # Mean spacing is 0.2. Random points would leave holes of radius 0.35 and more.
    x, y = np.meshgrid(np.linspace(0, 10, 200), np.linspace(0, 10, 200))
    grid = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 2.0)])
    assert cKDTree(points).query(grid)[0].max() < 0.35
    counts, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=10, range=[(0, 10)] * 2)
    assert counts.min() >= 20 and counts.max() <= 30


def test_faces_with_nan_corners_are_left_out():
    corners = np.array([PLATE[[0, 1, 2]], PLATE[[0, 2, 3]]])
    corners[1, 0, 0] = np.nan
    points = Mesh(corners, PLATE).sample(100)
    assert (points[:, 0] >= points[:, 1]).all()


# Formats of the extras


def test_pcd(tmp_path):
    pypcd4 = pytest.importorskip("pypcd4")
    cloud = pypcd4.PointCloud.from_xyzi_points(np.column_stack([POINTS, np.ones(300)]).astype(np.float32))
    for encoding in pypcd4.Encoding:
        cloud.save(tmp_path / "a.pcd", encoding=encoding)
        points = read_scan(tmp_path / "a.pcd").points
        np.testing.assert_allclose(points, POINTS, rtol=1e-6, atol=1e-6)
        content = (tmp_path / "a.pcd").read_bytes()
        for part in (0.001, 0.01, 0.3, 0.6, 0.99):
            refused(write(tmp_path / "cut.pcd", content[: max(1, int(len(content) * part))]))


def test_pcd_without_coordinates(tmp_path):
    pypcd4 = pytest.importorskip("pypcd4")
    cloud = pypcd4.PointCloud.from_points(np.ones((20, 2), np.float32), ("a", "b"), (np.float32, np.float32))
    cloud.save(tmp_path / "a.pcd")
    refused(tmp_path / "a.pcd", "fields x, y, z", "a, b")


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las(tmp_path, suffix):
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales, header.offsets = [1e-4] * 3, [100.0, 200.0, 300.0]
    data = laspy.LasData(header)
    far = POINTS + np.array([100, 200, 300])
    data.x, data.y, data.z = far.T
    path = tmp_path / f"a{suffix}"
    data.write(path)
    np.testing.assert_allclose(read_scan(path).points, far, atol=1e-4)
    content = path.read_bytes()
    record = header.point_format.size
    for size in (10, 300, len(content) // 2, len(content) - 5 * record, len(content) - 1):
        refused(write(tmp_path / f"cut{suffix}", content[:size]))


def test_e57_reads_all_scans_in_their_poses(tmp_path):
    pye57 = pytest.importorskip("pye57")
    path = tmp_path / "a.e57"
    fields = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), POINTS.T.copy(), strict=True))
    with pye57.E57(str(path), mode="w") as file:
        file.write_scan_raw(fields)
        quarter_turn = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
        file.write_scan_raw(fields, rotation=quarter_turn, translation=np.array([1.0, 2.0, 3.0]))
    scan = read_scan(path)
    turned = np.column_stack([1 - POINTS[:, 1], 2 + POINTS[:, 0], 3 + POINTS[:, 2]])
    np.testing.assert_allclose(scan.points, np.concatenate([POINTS, turned]), atol=1e-5)
    assert scan.unit == "m"
    assert read_scan(path, unit="mm").unit == "mm"
    content = path.read_bytes()
    for part in (0.001, 0.3, 0.6, 0.99):
        cut = write(tmp_path / "cut.e57", content[: int(len(content) * part)])
        refused(cut)
        assert cut.exists()


@pytest.mark.parametrize(
    ("suffix", "module", "extra"),
    [(".pcd", "pypcd4", "pcd"), (".las", "laspy", "las"), (".laz", "lazrs", "las"), (".e57", "pye57", "e57")],
)
def test_a_missing_library_is_named_with_its_extra(tmp_path, monkeypatch, suffix, module, extra):
    if suffix == ".laz":
        pytest.importorskip("laspy")
    monkeypatch.setitem(sys.modules, module, None)
    path = write(tmp_path / f"a{suffix}", "some bytes")
    refused(path, f"reading {suffix} needs {module}: pip install 'ridgefeature[{extra}]'")


# CAD shapes


def write_cad(shape, path):
    from OCP.BRepTools import BRepTools
    from OCP.IGESControl import IGESControl_Writer
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    if path.suffix == ".brep":
        BRepTools.Write_s(shape, str(path))
    elif path.suffix in (".igs", ".iges"):
        writer = IGESControl_Writer()
        writer.AddShape(shape)
        writer.Write(str(path))
    else:
        step = STEPControl_Writer()
        step.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
        step.Write(str(path))
    return path


def moved_cylinder():
    """Radius 5, height 20, on the axis through (7, 0, 0)."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Trsf, gp_Vec
    from OCP.TopLoc import TopLoc_Location

    move = gp_Trsf()
    move.SetTranslation(gp_Vec(7, 0, 0))
    return BRepPrimAPI_MakeCylinder(5, 20).Shape().Located(TopLoc_Location(move))


@pytest.mark.parametrize("suffix", [".step", ".stp", ".brep", ".iges", ".igs"])
def test_cad_shapes_are_sampled_on_the_exact_surface(tmp_path, suffix, capfd):
    path = write_cad(moved_cylinder(), tmp_path / f"a{suffix}")
    capfd.readouterr()
    scan = read_scan(path, sample=3000)
    assert capfd.readouterr() == ("", "")
    assert len(scan) == 3000 and scan.unit == "mm"
    radius = np.hypot(scan.points[:, 0] - 7, scan.points[:, 1])
    z = scan.points[:, 2]
    wall = (z > 1e-6) & (z < 20 - 1e-6)
    np.testing.assert_allclose(radius[wall], 5, atol=1e-6)
    assert radius.max() <= 5 + 1e-6 and z.min() > -1e-6 and z.max() < 20 + 1e-6
    # The wall has 200 pi of the whole area of 250 pi.
    assert wall.mean() == pytest.approx(0.8, abs=0.005)
    np.testing.assert_allclose(np.histogram(z[wall], bins=10, range=(0, 20))[0] / wall.sum(), 0.1, atol=0.01)
    np.testing.assert_array_equal(read_scan(path, sample=3000).points, scan.points)


def test_step_in_inches_comes_in_mm(tmp_path):
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeSphere
    from OCP.Interface import Interface_Static

    before = Interface_Static.CVal_s("write.step.unit")
    Interface_Static.SetCVal_s("write.step.unit", "INCH")
    try:
        path = write_cad(BRepPrimAPI_MakeSphere(10).Shape(), tmp_path / "a.step")
    finally:
        Interface_Static.SetCVal_s("write.step.unit", before)
    assert b"INCH" in path.read_bytes()
    np.testing.assert_allclose(np.linalg.norm(read_scan(path, sample=100).points, axis=1), 10, rtol=1e-9)


def test_cad_refuses_another_unit_and_vertices(tmp_path):
    path = write_cad(moved_cylinder(), tmp_path / "a.step")
    refused(path, "leave out unit='in'", unit="in")
    assert read_scan(path, sample=50, unit="mm").unit == "mm"
    refused(path, "leave out vertices=True", vertices=True)


@pytest.mark.parametrize("suffix", [".step", ".igs", ".brep"])
def test_cad_cut_off(tmp_path, suffix, capfd):
    content = write_cad(moved_cylinder(), tmp_path / f"whole{suffix}").read_bytes()
    capfd.readouterr()
    for part in (0.001, 0.01, 0.2, 0.4, 0.6, 0.8, 0.9, 0.99):
        refused(write(tmp_path / f"cut{suffix}", content[: max(1, int(len(content) * part))]))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", [".step", ".igs", ".brep"])
def test_cad_without_faces(tmp_path, suffix):
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
    from OCP.gp import gp_Pnt

    edge = BRepBuilderAPI_MakeEdge(gp_Pnt(0, 0, 0), gp_Pnt(1, 2, 3)).Edge()
    refused(write_cad(edge, tmp_path / f"a{suffix}"), "faces")


def test_step_with_damaged_text(tmp_path):
    content = write_cad(moved_cylinder(), tmp_path / "a.step").read_text()
    refused(write(tmp_path / "b.step", content.replace("CARTESIAN_POINT('',(", "CARTESIAN_POINT('',)(")))
    refused(write(tmp_path / "c.step", content[:400] + "END-ISO-10303-21;\n"))


# Any file

SUFFIXES = sorted(FORMATS)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_missing_directory_and_empty(tmp_path, suffix):
    with pytest.raises(FileNotFoundError, match="no such file"):
        read_scan(tmp_path / f"none{suffix}")
    (tmp_path / f"dir{suffix}").mkdir()
    with pytest.raises(IsADirectoryError, match="directory"):
        read_scan(tmp_path / f"dir{suffix}")
    refused(write(tmp_path / f"empty{suffix}", b""), "empty")


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    "content",
    [b"hello there\nthis is not a scan\n" * 40, bytes(range(256)) * 40, b"\x00", b"\n", POINTS.tobytes()],
    ids=["words", "bytes", "nul", "newline", "floats"],
)
def test_other_content_is_refused(tmp_path, suffix, content, capfd):
    refused(write(tmp_path / f"a{suffix}", content))
    assert capfd.readouterr() == ("", "")


@given(
    st.sampled_from([s for s in SUFFIXES if s not in (".e57", ".brep")]), st.binary(min_size=1, max_size=400)
)
@settings(deadline=None, max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_random_bytes_end_in_a_value_error(tmp_path, suffix, content):
    refused(write(tmp_path / f"a{suffix}", content))


def test_unknown_suffix_lists_the_known_ones(tmp_path):
    for name in ("a.docx", "a"):
        message = refused(write(tmp_path / name, "x"))
        assert all(suffix in message for suffix in SUFFIXES)


@pytest.mark.parametrize("path", [None, 3, "", [], b"a.npy"])
def test_what_is_no_path_is_refused(path):
    with pytest.raises(ValueError, match="path of a file"):
        read_scan(path)


@pytest.mark.parametrize("sample", [0, 15, -1, 2.5, "many", None, True])
def test_bad_sample_is_refused(tmp_path, sample):
    path = write(tmp_path / "a.xyz", rows(POINTS))
    with pytest.raises(ValueError, match="sample"):
        read_scan(path, sample=sample)


def test_unknown_unit_is_refused(tmp_path):
    with pytest.raises(ValueError, match="length unit"):
        read_scan(write(tmp_path / "a.xyz", rows(POINTS)), unit="parsec")


# Imports

HEAVY = ["trimesh", "OCP", "cadquery", "matplotlib", "laspy", "lazrs", "pye57", "pypcd4", "cad_export"]


def loaded_after(code):
    code += f"\nimport sys; print(*[m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_importing_io_loads_no_format_library():
    assert loaded_after("import ridgefeature.io, ridgefeature.scan") == []


def test_reading_a_table_loads_no_format_library(tmp_path):
    write(tmp_path / "a.csv", rows(POINTS, ","))
    assert (
        loaded_after(f"from ridgefeature.io import read_scan; read_scan({str(tmp_path / 'a.csv')!r})") == []
    )
