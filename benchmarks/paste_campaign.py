"""Pastes of many ridges on many hosts: how many end in a checked solid, and why the others do not.

    python benchmarks/paste_campaign.py [--quick] [--jobs N] [--table FILE.csv] [--folder DIR]

8 hosts, 6 ridges, 4 heights, 3 widths: 576 pastes; --quick takes every seventh. Deterministic. With
freecadcmd on the path FreeCAD reads and checks every solid too.

Whether geometry allows a paste is found apart from paste, by sampling (`forbidden`): not where the width
asked for leaves no flank beside the feet (arithmetic: Ridge.resized); not where the strip of the narrowest
flanks that a ridge may have, LEAST_BORDER widths to either side, turns over on 601 by 13 places; and, looked
for where paste gives no solid, not where triangles of the ridge's surface on that strip, at the height asked
for, cross. Everything else is allowed: whatever error ends it, also one of OCCT's checks, is a failure.
"""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
import tempfile
import time
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, astuple, dataclass, fields, replace
from functools import cache, partial
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import cadquery as cq
import numpy as np
from numpy.typing import NDArray
from report import Report, at_least, at_most
from scipy.spatial import cKDTree

import cad_export as cx
import ridgefeature as rf
from cad_export.face_base import laid
from ridgefeature.merge import LEAST_BORDER
from ridgefeature.stations import Stations
from ridgefeature.synthetic import Spiral

UNNAMED = "unnamed: "
_HOOK = 3000.0  # m
HEIGHTS, WIDTHS = (-1.0, 0.25, 1.0, 3.0), (0.5, 1.0, 1.5)


@dataclass(frozen=True)
class Host:
    """A solid, the face to paste on, and a place and direction in the middle of it."""

    solid: cq.Solid
    face: cq.Face
    at: tuple[float, float, float]
    direction: tuple[float, float, float]
    ring: cq.Edge


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
    places = np.linspace(-130, 130, 14).tolist()
    grid = [[cq.Vector(*on_waves(x, y)) for y in places] for x in places]
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
        "torus": Host(torus.val(), torus.faces().val(), (0, -240, 0), (1, 0, 0), ring(on_torus, 40)),
        "spline": Host(spline.val(), spline.faces(">Z").val(), (0, 0, 0), (1, 0, 0), ring(on_waves, 60)),
    }  # fmt: skip


def on_torus(x: float, z: float) -> tuple[float, float, float]:
    """The point of the torus in front of (x, z)."""
    return x, -(((180 + (60 * 60 - z * z) ** 0.5) ** 2 - x * x) ** 0.5), z


def on_waves(x: float, y: float) -> tuple[float, float, float]:
    return x, y, float(8 * np.sin(x / 60) * np.cos(y / 70))


def ring(lift: Callable[[float, float], tuple[float, float, float]], radius: float) -> cq.Edge:
    """A circle laid onto a surface."""
    turns = 2 * np.pi * np.arange(96) / 96
    points = [lift(radius * float(np.cos(t)), radius * float(np.sin(t))) for t in turns]
    return cq.Edge.makeSpline([cq.Vector(*p) for p in points], periodic=True)


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
    found = rf.register(points, at=(17429, 19603, 518))
    # at its start it hooks, tighter than it is wide: no place for another width
    names, own = [f.name for f in fields(Stations)], found.arc_length >= _HOOK
    rest: dict[str, Any] = {name: getattr(found, name)[own] for name in names}
    rest["arc_length"] = rest["arc_length"] - rest["arc_length"][0]
    return replace(found, **rest).stretched(5000.0, "trim").stretched(100.0, "scale")


@dataclass(frozen=True)
class Case:
    """One paste."""

    host: str
    ridge: str
    h: float
    w: float


@dataclass(frozen=True)
class Outcome:
    """One row of the table."""

    host: str
    ridge: str
    h: float
    w: float
    end: str
    """solid, or the error in words."""
    method: str = ""
    volume_error: float = 0.0
    seconds: float = 0.0
    forbidden: str = ""
    """Why geometry does not allow it; found by sampling, not by paste."""


def cases() -> list[Case]:
    names = ("straight", "S", "spiral", "ring", "noisy", "real")
    return [Case(*case) for case in product(hosts(), names, HEIGHTS, WIDTHS)]


@cache
def material() -> tuple[dict[str, Host], dict[str, rf.Ridge]]:
    """Hosts and ridges, made once a process."""
    return hosts(), ridges()


def placed(case: Case) -> tuple[rf.Ridge, Host, dict[str, Any]]:
    """Ridge, host, and where it goes."""
    all_hosts, all_ridges = material()
    host, ringed = all_hosts[case.host], case.ridge == "ring"
    place: dict[str, Any] = {"path": host.ring} if ringed else {"at": host.at, "direction": host.direction}
    return all_ridges["spiral" if ringed else case.ridge], host, place


def forbidden(case: Case, crossings: bool) -> str:
    """Why geometry does not allow a paste, or nothing; looks for crossings, which takes longer, if told."""
    ridge, host, place = placed(case)
    base, fitted = laid(host.face, ridge, **place)
    try:
        fitted = fitted.resized(h=case.h, w=case.w)
    except ValueError:
        return "the feet are beyond the flanks"
    s, half = np.linspace(0, base.length, 601), LEAST_BORDER * fitted.width
    y = np.interp(s, fitted.arc_length, half)[:, None] * np.linspace(-1, 1, 13)
    points, normals = base(s, y)
    ahead, aside = np.gradient(points, axis=0), np.gradient(points, axis=1)
    if ((np.cross(ahead, aside) * normals).sum(axis=-1) <= 0).any():
        return "the strip turns over"
    if not crossings:
        return ""
    surface = replace(fitted, border=1.001 * half).surface(base)
    u, v = (np.linspace(*domain, n) for domain, n in zip(surface.domain, (401, 41), strict=True))
    return "the surface crosses itself" if crosses(surface.on_grid(u, v), base.closed) else ""


def crosses(grid: NDArray[np.float64], closed: bool) -> bool:
    """Whether sides of the triangles of a grid of points (n, m, 3) run through triangles apart from them."""
    n, m = grid.shape[:2]
    i, j = (a.ravel() for a in np.indices((n - 1, m - 1)))
    a, b, c, d = (grid[i + p, j + q] for p, q in ((0, 0), (1, 0), (1, 1), (0, 1)))
    corners = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    place = np.tile(np.stack([i, j], axis=1), (2, 1))
    centre = corners.mean(axis=1)
    reach = np.linalg.norm(corners - centre[:, None], axis=-1).max()
    near = cKDTree(centre).query_pairs(2 * reach, output_type="ndarray")
    gap = np.abs(place[near[:, 0]] - place[near[:, 1]])
    along = np.minimum(gap[:, 0], n - 1 - gap[:, 0]) if closed else gap[:, 0]
    near = near[(along > 1) | (gap[:, 1] > 1)]
    both = [(corners[near[:, k]], corners[near[:, 1 - k]]) for k in (0, 1)]
    return any(pierced(one, other).any() for one, other in both)


def pierced(triangles: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(k,) whether a side of the others (k, 3, 3) runs through triangles (k, 3, 3) (Moeller, Trumbore)."""
    found = np.zeros(len(triangles), dtype=bool)
    a, e, f = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    for k in range(3):
        start, way = others[:, k], others[:, (k + 1) % 3] - others[:, k]
        p = np.cross(way, f)
        with np.errstate(all="ignore"):  # a side along the triangle's plane pierces nothing
            scale = 1 / (e * p).sum(axis=-1)
            u = ((start - a) * p).sum(axis=-1) * scale
            q = np.cross(start - a, e)
            v, t = (way * q).sum(axis=-1) * scale, (f * q).sum(axis=-1) * scale
            found |= (u > 0) & (v > 0) & (u + v < 1) & (t > 0) & (t < 1)
    return found


def pasted(case: Case, check: bool, report: dict[str, Any] | None = None) -> cq.Solid:
    ridge, host, place = placed(case)
    options: dict[str, Any] = {"h": case.h, "w": case.w, "check": check, "report": report}
    return cx.paste(ridge, host.solid, face=host.face, **options, **place)


def outcome_of(case: Case, brep: Path) -> Outcome:
    """The outcome of one paste; its solid is written to a file."""
    report: dict[str, Any] = {}
    start = time.perf_counter()
    try:
        solid = pasted(case, True, report)
    except ImportError:
        raise
    except Exception as error:
        seconds = time.perf_counter() - start
        end = str(error) if isinstance(error, ValueError) else f"{UNNAMED}{type(error).__name__}: {error}"
        return Outcome(*astuple(case), end, seconds=seconds)
    seconds = time.perf_counter() - start
    solid.exportBrep(str(brep))
    error = abs(report["volume_added"] / report["volume_expected"] - 1)
    return Outcome(*astuple(case), "solid", report["method"], error, seconds)


def kept_outcome(case: Case, folder: Path) -> Outcome:
    """The outcome of one paste, from the folder where it is there."""
    name = "_".join(str(part).replace(" ", "-") for part in astuple(case))
    file = folder / f"{name}.json"
    if file.exists():
        return Outcome(**json.loads(file.read_text()))
    material()
    outcome = outcome_of(case, folder / f"{name}.brep")
    outcome = replace(outcome, forbidden=forbidden(case, crossings=outcome.end != "solid"))
    file.write_text(json.dumps(asdict(outcome)))
    print(outcome, file=sys.stderr, flush=True)
    return outcome


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


def refused_by_freecad(folder: Path) -> list[str] | None:
    """The solids in the folder that FreeCAD finds faulty; None without FreeCAD."""
    program = shutil.which("freecadcmd") or shutil.which("FreeCADCmd")
    if program is None:
        return None
    paths = sorted(str(path) for path in folder.glob("*.brep"))
    with tempfile.TemporaryDirectory() as other:
        out, script = Path(other) / "out.json", Path(other) / "check.py"
        script.write_text(f"PATHS = {paths!r}\nOUT = {str(out)!r}\n{FREECAD}")
        subprocess.run([program, str(script)], check=True, capture_output=True)
        return [Path(path).stem for path in json.loads(out.read_text())]


def main() -> None:
    options = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    options.add_argument("--quick", action="store_true", help="every seventh paste")
    options.add_argument("--table", type=Path, help="where to write the table, as CSV")
    options.add_argument("--jobs", type=int, default=1, help="how many processes share the pastes")
    options.add_argument("--folder", type=Path, help="keeps outcomes and solids; what is there is not redone")
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        run = partial(kept_outcome, folder=folder)
        # in seven turns, each over all hosts and ridges, so that a run cut short tells of all of them
        chosen = [case for turn in range(1 if given.quick else 7) for case in cases()[turn::7]]
        with ProcessPoolExecutor(given.jobs, mp_context=get_context("spawn")) as pool:
            outcomes = list(pool.map(run, chosen))
        if given.table:
            with given.table.open("w", newline="", encoding="utf-8") as file:
                rows = csv.writer(file)
                rows.writerow(asdict(outcomes[0]))
                rows.writerows(astuple(outcome) for outcome in outcomes)
        show(outcomes, refused_by_freecad(folder))


def show(outcomes: list[Outcome], refused: list[str] | None) -> None:
    good = [o for o in outcomes if o.end == "solid"]
    allowed = [o for o in outcomes if not o.forbidden]
    wrong = [o for o in allowed if o.end != "solid"]
    report = Report()
    report.tell("pastes", str(len(outcomes)))
    report.tell("solids", str(len(good)))
    report.tell("geometry allows", str(len(allowed)))
    report.add("of those: solids [%]", at_least(99), 100 * (1 - len(wrong) / max(1, len(allowed))))
    report.add("solids though geometry forbids", at_most(0), sum(bool(o.forbidden) for o in good))
    report.add("errors without a name", at_most(0), sum(o.end.startswith(UNNAMED) for o in outcomes))
    worst = max((o.volume_error for o in good), default=float("nan"))
    report.add("volume added / integral - 1, the largest", at_most(1e-3), worst)
    for host in hosts():
        seconds = [o.seconds for o in outcomes if o.host == host]
        if seconds:
            told = f"{np.median(seconds):.2f}, {max(seconds):.1f}"
            report.tell(f"{host}: seconds with all checks, median and most", told)
    for method, count in Counter(o.method for o in good).most_common():
        report.tell(f"method {method}", str(count))
    for why, count in Counter(o.forbidden for o in outcomes if o.forbidden).most_common():
        report.tell(f"forbidden: {why}", str(count))
    for o in wrong:
        report.tell(f"failed: {o.host}, {o.ridge}, h {o.h:g}, w {o.w:g}", o.end)
    if refused is not None:
        report.add("solids that FreeCAD finds faulty", at_most(0), len(refused), ", ".join(refused))
    report.show()


if __name__ == "__main__":
    main()
