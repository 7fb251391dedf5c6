"""STEP files as FreeCAD and gmsh see them, and that these judges judge. Skipped where they are missing."""

from __future__ import annotations

from pathlib import Path

import cadquery as cq
import pytest
from freecad_tools import closed, inspect_step, inspect_step_by_gmsh, needs_freecad, needs_gmsh, run_freecad
from oracles import spiral_ridge

import cad_export as cx
import ridgefeature as rf
from cad_export.check import volume


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge().stretched(40.0, "trim")


@needs_freecad
def test_scripts_that_fail_say_so():
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        run_freecad("result = {'x': 1 / 0}")
    assert run_freecad("result = {'twice': 2 * x}", x=1.5) == {"twice": 3.0}


@pytest.fixture(scope="module")
def steps(ridge, tmp_path_factory) -> tuple[Path, Path, float]:
    """A slab, a face alone, and the volume of the slab."""
    folder = tmp_path_factory.mktemp("step")
    slab = cx.solid(ridge, 2.0, check=False)
    return (
        cx.step(slab, folder / "slab.step"),
        cx.step(ridge, folder / "face.step"),
        volume(slab.wrapped, 1e-7),
    )


by_both = pytest.mark.parametrize(
    "inspect",
    [pytest.param(inspect_step, marks=needs_freecad), pytest.param(inspect_step_by_gmsh, marks=needs_gmsh)],
)


@by_both
def test_others_find_one_closed_solid_of_our_volume(steps, inspect):
    slab, face, wanted = steps
    found = inspect(slab)
    assert (found["solids"], found["faces"]) == (1, 6)
    assert found["closed_mesh"] and found.get("valid", True)
    assert found["volume"] == pytest.approx(wanted, rel=1e-4)
    assert found.get("mesh_volume", wanted) == pytest.approx(wanted, rel=1e-3)
    alone = inspect(face)
    assert (alone["solids"], alone["faces"], alone["volume"]) == (0, 1, 0.0)
    assert not alone["closed_mesh"] and alone.get("valid", True)


@by_both
def test_others_find_what_is_wrong_with_a_file(inspect, tmp_path):
    box = cq.Solid.makeBox(1, 2, 3)
    pair = inspect(cx.step(cq.Compound.makeCompound([box, box.moved(x=5)]), tmp_path / "pair.step"))
    assert (pair["solids"], pair["faces"], pair["volume"]) == (2, 12, pytest.approx(12))
    open_box = inspect(cx.step(cq.Shell.makeShell(box.Faces()[:5]), tmp_path / "open.step"))
    assert (open_box["solids"], open_box["faces"], open_box["closed_mesh"]) == (0, 5, False)
    whole = (tmp_path / "pair.step").read_text()
    for name, text in (("empty", ""), ("words", "no STEP"), ("cut", whole[: len(whole) // 2])):
        path = tmp_path / f"{name}.step"
        path.write_text(text)
        with pytest.raises(RuntimeError):
            inspect(path)


@needs_freecad
def test_freecads_own_check_names_faces_that_cross(tmp_path):
    box = cq.Solid.makeBox(1, 2, 3)
    assert inspect_step(cx.step(box, tmp_path / "box.step"), check=True)["faults"] == ""
    crossed = cq.Compound.makeCompound([box, box.moved(x=0.5, y=0.5, z=0.5)])
    assert "Intersect" in inspect_step(cx.step(crossed, tmp_path / "crossed.step"), check=True)["faults"]


def test_a_mesh_is_closed_when_two_triangles_share_every_edge():
    tetrahedron = [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)]
    assert closed(tetrahedron)
    assert closed([*tetrahedron, (0, 0, 1)])
    assert not closed(tetrahedron[1:])
    assert not closed([*tetrahedron, (0, 1, 4)])
    assert not closed([])
