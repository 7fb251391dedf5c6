"""FreeCAD and gmsh as judges of our files: scripts run headless, and what they find in a STEP file.

Both come from the system (on Debian: apt-get install freecad gmsh); tests that need them are marked with
`needs_freecad` and `needs_gmsh` and are skipped without.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pytest
from OCP.BRep import BRep_Builder
from OCP.BRepTools import BRepTools
from OCP.TopoDS import TopoDS_Shape

from cad_export.check import volume

FREECAD = shutil.which("freecadcmd") or shutil.which("FreeCADCmd")
GMSH = shutil.which("gmsh")
needs_freecad = pytest.mark.skipif(FREECAD is None, reason="needs freecadcmd: install freecad")
needs_gmsh = pytest.mark.skipif(GMSH is None, reason="needs gmsh: install gmsh")

_RUNNER = """
import json, traceback
answer, scope = {{}}, json.loads({given!r})
try:
    exec(compile({script!r}, "script", "exec"), scope)
    answer["result"] = scope["result"]
except BaseException:
    answer["failure"] = traceback.format_exc()
with open({out!r}, "w") as file:
    json.dump(answer, file)
"""


def run_freecad(
    script: str, files: Sequence[Path] = (), timeout: float = 120, **given: Any
) -> dict[str, Any]:
    """Run Python source in FreeCAD without a screen; return what it leaves in `result`, through JSON.

    `files` are documents and macros that FreeCAD opens and runs first, as on its command line. `given` are
    variables that the script finds, anything that JSON holds. Raises RuntimeError with the
    traceback or the output where the script fails or FreeCAD dies, subprocess.TimeoutExpired after `timeout`
    seconds.
    """
    assert FREECAD is not None, "mark the test with needs_freecad"
    with tempfile.TemporaryDirectory() as folder:
        runner, out = Path(folder, "runner.py"), Path(folder, "answer.json")
        runner.write_text(
            _RUNNER.format(given=json.dumps(given), script=script, out=str(out)), encoding="utf-8"
        )
        # FreeCAD looks for a virtual environment's own files, and writes its settings to the home folder
        environment = {k: v for k, v in os.environ.items() if k not in ("VIRTUAL_ENV", "PYTHONPATH")}
        done = subprocess.run(
            [FREECAD, *map(str, files), str(runner)],
            env={**environment, "HOME": folder},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=timeout,
        )
        if not out.exists():
            raise RuntimeError(f"FreeCAD ended with {done.returncode}:\n{done.stdout}\n{done.stderr}")
        answer: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
    if "failure" in answer:
        raise RuntimeError(answer["failure"])
    return dict(answer["result"])


_INSPECT = """
import Part
shape = Part.read(path)
shape.exportBrep(brep)
points, triangles = shape.tessellate(deflection * shape.BoundBox.DiagonalLength)
result = {
    "solids": len(shape.Solids), "faces": len(shape.Faces), "valid": shape.isValid(),
    "own_volume": shape.Volume if shape.Solids else 0.0, "triangles": triangles,
    "mesh_volume": sum(points[a].dot(points[b].cross(points[c])) for a, b, c in triangles) / 6,
}
if check:
    try:
        shape.check(True)
        result["faults"] = ""
    except ValueError as faults:
        result["faults"] = str(faults) or "unnamed"
"""


def inspect_step(
    path: str | os.PathLike[str], deflection: float = 3e-4, check: bool = False
) -> dict[str, Any]:
    """What FreeCAD finds in a STEP file. Lengths in millimetres.

    solids, faces: counts; valid: isValid() of the whole; closed_mesh: whether every edge of its mesh is
    shared by two triangles; mesh_volume: the volume that the mesh encloses, `deflection` as a part of the
    shape's diagonal; own_volume: FreeCAD's Volume, which may be several per cent off on long spline faces;
    volume: that of the shape as FreeCAD read it, integrated to a tolerance (0 without a solid).
    With `check` also faults: what FreeCAD's Check geometry with its search for crossing faces reports, "" for
    nothing; it takes seconds. A deflection below 1e-4 may take gigabytes on long ridges.
    """
    with tempfile.TemporaryDirectory() as folder:
        brep = Path(folder, "read.brep")
        where = {"path": str(Path(path).resolve()), "brep": str(brep)}
        found = run_freecad(_INSPECT, **where, deflection=deflection, check=check)
        found["volume"] = brep_volume(brep) if found["solids"] else 0.0
    found["closed_mesh"] = closed(found.pop("triangles"))
    return found


_GEO = """
SetFactory("OpenCASCADE");
Geometry.OCCTargetUnit = "MM";
all() = ShapeFromFile("{path}");
solids() = Volume{{:}};
faces() = Surface{{:}};
Printf("%g %g", #solids(), #faces()) > "{folder}/counts.txt";
Save "{folder}/read.brep";
Mesh 2;
Mesh.MshFileVersion = 2.2;
Mesh.SaveAll = 1;
Save "{folder}/mesh.msh";
"""


def inspect_step_by_gmsh(path: str | os.PathLike[str], timeout: float = 120) -> dict[str, Any]:
    """What gmsh finds in a STEP file: solids, faces, volume (as in `inspect_step`) and closed_mesh.

    Raises RuntimeError with gmsh's output where it cannot read or mesh the file.
    """
    assert GMSH is not None, "mark the test with needs_gmsh"
    with tempfile.TemporaryDirectory() as folder:
        script, mesh = Path(folder, "inspect.geo"), Path(folder, "mesh.msh")
        script.write_text(_GEO.format(path=Path(path).resolve(), folder=folder), encoding="utf-8")
        done = subprocess.run(
            [GMSH, "-v", "2", str(script), "-"], capture_output=True, text=True, timeout=timeout
        )
        if done.returncode or not mesh.exists() or "Error" in done.stdout + done.stderr:
            raise RuntimeError(f"gmsh ended with {done.returncode}:\n{done.stdout}\n{done.stderr}")
        solids, faces = (int(word) for word in Path(folder, "counts.txt").read_text().split())
        return {
            "solids": solids,
            "faces": faces,
            "volume": brep_volume(Path(folder, "read.brep")) if solids else 0.0,
            "closed_mesh": closed(_msh_triangles(mesh)),
        }


def closed(triangles: Iterable[Iterable[int]]) -> bool:
    """Whether every edge belongs to two triangles. Triangles that are a line or a point do not count."""
    edges: Counter[frozenset[int]] = Counter()
    for a, b, c in triangles:
        if len({a, b, c}) == 3:
            edges.update((frozenset((a, b)), frozenset((b, c)), frozenset((c, a))))
    return bool(edges) and set(edges.values()) == {2}


def brep_volume(path: Path) -> float:
    """Volume of the shape in a BREP file, to 1 in 10 million."""
    shape = TopoDS_Shape()
    if not BRepTools.Read_s(shape, str(path), BRep_Builder()):
        raise RuntimeError(f"OCCT cannot read {path.name}")
    return volume(shape, 1e-7)


def _msh_triangles(path: Path) -> list[tuple[int, int, int]]:
    """The triangles of a mesh file of gmsh's version 2.2: number, type 2, tags, three nodes."""
    text = path.read_text(encoding="utf-8")
    rows = (line.split() for line in text.split("$Elements")[1].split("$EndElements")[0].splitlines()[2:])
    return [(int(row[-3]), int(row[-2]), int(row[-1])) for row in rows if row[1] == "2"]
