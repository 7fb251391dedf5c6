import sys

import numpy as np
import pytest
from reading import POINTS, refused, write

from ridgefeature.io import read_scan


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
