"""Pastes of many ridges on many hosts: how many end in a checked solid, and why the others do not.

    python benchmarks/paste_campaign.py [--quick] [--table FILE.csv]

Deterministic. --quick takes every eighth paste. With freecadcmd on the path FreeCAD
reads and checks every solid too.
"""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import cadquery as cq
import numpy as np
from report import Report, at_least, at_most

import cad_export as cx
import ridgefeature as rf
from ridgefeature.synthetic import Spiral

HEIGHTS, WIDTHS = (-1.0, 0.25, 1.0, 3.0), (0.5, 1.0, 1.5)


@dataclass(frozen=True)
class Host:
    """A solid, the face to paste on, and a place and direction in the middle of it."""

    solid: cq.Solid
    face: cq.Face
    at: tuple[float, float, float]
    direction: tuple[float, float, float]
    ring: cq.Edge | None


def hosts() -> dict[str, Host]:
    """Solids of 200 mm and more, each with a face of another kind."""
    box = cq.Workplane().box(240, 240, 40)
    top = ((0.0, 0.0, 20.0), (1.0, 0.0, 0.0), cq.Edge.makeCircle(60, cq.Vector(0, 0, 20)))
    holes = box.faces(">Z").workplane().rect(210, 210, forConstruction=True).vertices().hole(12)
    rounded = box.edges("|Z").fillet(20).faces(">Z").edges().fillet(8)
    cylinder = cq.Workplane().cylinder(300, 70)
    cone = cq.Workplane(cq.Solid.makeCone(110, 60, 260))
    sphere = cq.Workplane().sphere(120)
    torus = cq.Workplane(cq.Solid.makeTorus(180, 60))
    grid = [[cq.Vector(x, y, 8 * np.sin(x / 60) * np.cos(y / 70)) for y in np.linspace(-130, 130, 14)]
            for x in np.linspace(-130, 130, 14)]  # fmt: skip
    skin = cq.Face.makeSplineApprox(grid, tol=1e-4)
    spline = cq.Workplane(cq.Solid.extrudeLinear(skin, cq.Vector(0, 0, -60)))
    side = np.array([170.0, 0.0, 260.0]) / 2
    return {
        "plane": Host(box.val(), box.faces(">Z").val(), *top),
        "holes": Host(holes.val(), holes.faces(">Z").val(), *top),
        "filleted box": Host(rounded.val(), rounded.faces(">Z").val(), *top),
        "cylinder": Host(
            cylinder.val(), cylinder.faces("%CYLINDER").val(), (0, -70, 0), (0, 0, 1),
            cq.Edge.makeCircle(70, cq.Vector(0, 0, 10)),
        ),
        "cone": Host(cone.val(), cone.faces("%CONE").val(), (0, -float(side[0]), 130), (0, 0, 1),
                     cq.Edge.makeCircle(85, cq.Vector(0, 0, 130))),
        "sphere": Host(sphere.val(), sphere.faces().val(), (0, -120, 0), (1, 0, 0),
                       cq.Edge.makeCircle(60, cq.Vector(0, -(120**2 - 60**2) ** 0.5, 0), cq.Vector(0, 1, 0))),
        "torus": Host(torus.val(), torus.faces().val(), (0, -240, 0), (1, 0, 0), None),
        "spline": Host(spline.val(), spline.faces(">Z").val(), (0, 0, 0), (1, 0, 0), None),
    }  # fmt: skip


def ridges() -> dict[str, rf.Ridge]:
    """A straight, an S-shaped, a spiral, a noisy and a real ridge, each about 100 mm long."""
    spiral = Spiral()
    at = (*spiral.spine(np.array(30.0))[:2], float(spiral.height(np.array(30.0))))
    clean = rf.register(spiral.points(40_000), at=at).stretched(110.0, "scale")
    noisy = rf.register(spiral.points(10_000, noise=0.3), at=at).stretched(100.0, "trim")
    return {
        "straight": bent(clean, 0.0),
        "S": bent(clean, 0.02),
        "spiral": clean,
        "noisy": noisy,
        "real": mountain(),
    }


def bent(ridge: rf.Ridge, curvature: float) -> rf.Ridge:
    """The profile of a ridge on a flat path whose curvature goes through one sine wave."""
    s = ridge.arc_length
    angle = curvature * ridge.length / (2 * np.pi) * (1 - np.cos(2 * np.pi * s / ridge.length))
    tangent = np.column_stack([np.cos(angle), np.sin(angle), 0 * s])
    steps = np.diff(s)[:, None] * (tangent[1:] + tangent[:-1]) / 2
    spine = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    return replace(ridge, spine=spine, tangent=tangent, normal=np.tile([0.0, 0.0, 1.0], (len(s), 1)))


def mountain() -> rf.Ridge:
    """A stretch of Pine Mountain, from the elevation model that matplotlib ships, at 1 : 50,000."""
    from matplotlib.cbook import get_sample_data

    with get_sample_data("jacksboro_fault_dem.npz") as file:
        z = file["elevation"].astype(np.float64)
    row, column = np.indices(z.shape)
    points = np.column_stack([74.5 * column.ravel(), 92.5 * (len(z) - 1 - row).ravel(), z.ravel()])
    found = rf.register(points, at=(17429, 19603, 518)).stretched(5000.0, "trim")
    return found.stretched(100.0, "scale")


@dataclass(frozen=True)
class Outcome:
    host: str
    ridge: str
    h: float
    w: float
    end: str
    """solid, or the first words of the named error, or the exception's name."""
    method: str = ""
    volume_error: float = 0.0
    seconds: float = 0.0


def cases() -> Iterator[tuple[str, Host, str, rf.Ridge, float, float]]:
    all_ridges = ridges()
    for (name, host), h, w in product(hosts().items(), HEIGHTS, WIDTHS):
        for ridge_name, ridge in all_ridges.items():
            yield name, host, ridge_name, ridge, h, w
        if host.ring is not None:
            yield name, host, "ring", all_ridges["spiral"], h, w


def one(name: str, host: Host, ridge_name: str, ridge: rf.Ridge, h: float, w: float) -> tuple[Outcome, Any]:
    """The outcome of one paste, and its solid."""
    place = {"path": host.ring} if ridge_name == "ring" else {"at": host.at, "direction": host.direction}
    report: dict[str, Any] = {}
    start = time.perf_counter()
    try:
        solid = cx.paste(ridge, host.solid, face=host.face, h=h, w=w, report=report, **place)
    except ValueError as error:
        return Outcome(name, ridge_name, h, w, str(error)[:90]), None
    except Exception as error:
        return Outcome(name, ridge_name, h, w, f"{type(error).__name__}: {error}"[:90]), None
    error = abs(report["volume_added"] / report["volume_expected"] - 1)
    seconds = time.perf_counter() - start
    return Outcome(name, ridge_name, h, w, "solid", report["method"], error, seconds), solid


FREECAD = """
import json, Part, sys
bad = []
for path in PATHS:
    shape = Part.Shape()
    shape.importBrep(path)
    if not (shape.isValid() and len(shape.Solids) == 1 and shape.isClosed()):
        bad.append(path)
with open(OUT, "w") as file:
    json.dump(bad, file)
"""


def refused_by_freecad(solids: list[cq.Solid]) -> int | None:
    """How many of the solids FreeCAD finds faulty; None without FreeCAD."""
    program = shutil.which("freecadcmd") or shutil.which("FreeCADCmd")
    if program is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        paths = [str(Path(folder) / f"{i}.brep") for i in range(len(solids))]
        for solid, path in zip(solids, paths, strict=True):
            solid.exportBrep(path)
        out, script = Path(folder) / "out.json", Path(folder) / "check.py"
        script.write_text(f"PATHS = {paths!r}\nOUT = {str(out)!r}\n{FREECAD}")
        subprocess.run([program, str(script)], check=True, capture_output=True)
        return len(json.loads(out.read_text()))


def main() -> None:
    chosen = list(cases())[:: 8 if "--quick" in sys.argv else 1]
    outcomes, solids = [], []
    for case in chosen:
        outcome, solid = one(*case)
        outcomes.append(outcome)
        if solid is not None:
            solids.append(solid)
        print(outcome, file=sys.stderr, flush=True)
    if "--table" in sys.argv:
        with Path(sys.argv[sys.argv.index("--table") + 1]).open("w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file)
            rows.writerow(vars(outcomes[0]))
            rows.writerows(vars(outcome).values() for outcome in outcomes)
    show(outcomes, solids)


def show(outcomes: list[Outcome], solids: list[cq.Solid]) -> None:
    good = [o for o in outcomes if o.end == "solid"]
    # What geometry forbids: feet beyond the flanks, a face too small, a bend too tight.
    forbidden = ("width:", "expected a strip", "path: expected bends", "expected bends")
    possible = [o for o in outcomes if not o.end.startswith(forbidden)]
    report = Report()
    report.tell("pastes", str(len(outcomes)))
    report.add("of those that geometry allows: solids [%]", at_least(99), 100 * len(good) / len(possible))
    report.add("volume added / integral - 1, the largest", at_most(1e-3), max(o.volume_error for o in good))
    report.tell("median seconds, with all checks", f"{np.median([o.seconds for o in good]):.2f}")
    for method, count in Counter(o.method for o in good).most_common():
        report.tell(f"method {method}", str(count))
    for end, count in Counter(o.end for o in outcomes if o.end != "solid").most_common(12):
        report.tell(end, str(count))
    refused = refused_by_freecad(solids)
    if refused is not None:
        report.add("solids that FreeCAD finds faulty", at_most(0), refused)
    report.show()


if __name__ == "__main__":
    main()
