import numpy as np
import pytest
from reading import refused, write

from ridgefeature.io import read_scan


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
