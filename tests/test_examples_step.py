"""Examples that make a part: each runs as a user runs it, and others find in its STEP file what we do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest
from example_runner import FOLDER, run_example
from freecad_tools import inspect_step, inspect_step_by_gmsh, needs_freecad, needs_gmsh
from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID

import cad_export as cx
from cad_export.check import subshapes, volume

# An example that makes a part takes the folder for its files.
SCRIPTS = sorted(path.name for path in FOLDER.glob("*.py") if "[FOLDER]" in path.read_text())


@dataclass(frozen=True)
class Written:
    """A STEP file of an example, and what we read from it: counts, and the volume in mm3."""

    path: Path
    solids: int
    faces: int
    volume: float


@pytest.fixture(scope="module", params=SCRIPTS)
def written(request, tmp_path_factory) -> list[Written]:
    folder, empty = tmp_path_factory.mktemp("example"), tmp_path_factory.mktemp("empty")
    run_example(request.param, empty, str(folder))
    found = []
    for path in sorted(folder.glob("*.step")):
        shape = cx.read_step(path)
        solids, faces = (len(subshapes(shape, kind)) for kind in (TopAbs_SOLID, TopAbs_FACE))
        found.append(Written(path, solids, faces, volume(shape, 1e-7) if solids else 0.0))
    if not found and request.param == "laser_bead.py":
        pytest.skip("needs a scan: set RIDGE_SCANS")
    return found


def test_the_examples_that_make_parts_are_known() -> None:
    asked = {"grip.py", "laser_bead.py", "panel_bead.py", "resize_and_export.py", "spiral_on_cylinder.py"}
    assert set(SCRIPTS) == asked
    makers = {path.name for path in FOLDER.glob("*.py") if "cad_export" in path.read_text()}
    assert makers == asked, "an example with CAD in it takes a folder and writes a STEP file"


def test_an_example_writes_one_part(written: list[Written]) -> None:
    [one] = written
    assert one.path.suffix == ".step" and one.path.is_file()
    assert (one.solids == 1 and one.volume > 0) or (one.solids, one.faces) == (0, 1)


@pytest.mark.parametrize(
    "inspect",
    [pytest.param(inspect_step, marks=needs_freecad), pytest.param(inspect_step_by_gmsh, marks=needs_gmsh)],
)
def test_others_open_it_as_it_was_written(written: list[Written], inspect) -> None:
    for one in written:
        found = inspect(one.path)
        assert (found["solids"], found["faces"]) == (one.solids, one.faces)
        assert found.get("valid", True)
        assert found["volume"] == pytest.approx(one.volume, rel=1e-4)
        assert found["closed_mesh"] == (one.solids == 1)
        if one.solids and "mesh_volume" in found:
            assert found["mesh_volume"] == pytest.approx(one.volume, rel=5e-3)
