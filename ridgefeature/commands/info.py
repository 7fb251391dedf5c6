"""`ridgefeature info`: what a file holds."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

from ridgefeature.commands import interrupts, output
from ridgefeature.commands.console import point, print_json, print_table
from ridgefeature.commands.feature_file import CAD, load_feature
from ridgefeature.readable import number
from ridgefeature.settings import Settings

Found = tuple[str, list[tuple[str, str]], dict[str, Any]]
_ASSUMED = ", assumed: such files are read without one; --unit gives another"


def run(file: Path, unit: str | None, as_json: bool) -> None:
    """Print it. Raises ValueError or OSError for a file that cannot be read."""
    with interrupts.at_once():
        title, rows, document = _found(file, unit)
    interrupts.check()
    if as_json:
        print_json({"file": str(file), **document})
    else:
        print_table(f"{file}: {title}", rows)


def _found(file: Path, unit: str | None) -> Found:
    suffix = file.suffix.lower()
    if suffix == ".json":
        return _feature(file)
    return _step(file) if suffix in CAD and unit is None else _scan(file, unit)


def _feature(file: Path) -> Found:
    ridge = load_feature(file)
    default = Settings()
    changed = [
        f"{f.name} {getattr(ridge.settings, f.name)}"
        for f in fields(Settings)
        if getattr(ridge.settings, f.name) != getattr(default, f.name)
    ]
    source = (
        "not known" if ridge.source is None else f"{ridge.source.name}, sha256 {ridge.source.sha256[:12]}..."
    )
    rows = [
        *output.rows(ridge),
        ("registered from", source),
        ("settings changed", ", ".join(changed) or "none"),
    ]
    return "a ridge feature", rows, {"kind": "feature", **output.document(ridge)}


def _scan(file: Path, unit: str | None) -> Found:
    from ridgefeature.grid import build_grid, typical_spacing
    from ridgefeature.io.read import FORMATS, read_scan

    scan = read_scan(file, unit=unit)
    form = FORMATS[file.suffix.lower()]
    assumed = unit is None and form.unit is None
    low, high = scan.bounds
    spacing = typical_spacing(build_grid(scan.points))
    middle = scan.points[((scan.points - 0.5 * (low + high)) ** 2).sum(axis=1).argmin()]
    rows = [
        ("points", f"{len(scan):,}"),
        ("unit", f"{scan.unit}{_ASSUMED if assumed else ''}"),
        ("lowest x y z", point(low)),
        ("highest x y z", point(high)),
        ("size", f"{' x '.join(number(x) for x in high - low)} {scan.unit}"),
        ("typical spacing", f"{number(spacing, 3)} {scan.unit}"),
        ("a point in the middle", point(middle)),
    ]
    document = {
        "kind": "scan",
        "points": len(scan),
        "unit": scan.unit,
        "unit_assumed": assumed,
        "low": low.tolist(),
        "high": high.tolist(),
        "spacing": float(spacing),
    }
    return f"{form.title}, read as a scan", rows, document


def _step(file: Path) -> Found:
    """Shapes and their box; and the feature, where one is carried."""
    if not file.is_file():
        raise FileNotFoundError(f"{file}: there is no such file: check the path")
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID
    from OCP.TopExp import TopExp
    from OCP.TopTools import TopTools_IndexedMapOfShape

    import cad_export
    from cad_export.step_properties import records_in

    shape = cad_export.read_step(file)
    counts = {}
    for name, kind in (("solids", TopAbs_SOLID), ("faces", TopAbs_FACE)):
        found = TopTools_IndexedMapOfShape()
        TopExp.MapShapes_s(shape, kind, found)
        counts[name] = found.Extent()
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    ends = box.Get()
    low, high = ends[:3], ends[3:]
    rows = [(name, f"{count:,}") for name, count in counts.items()]
    rows += [("unit", "mm"), ("lowest x y z", point(low)), ("highest x y z", point(high))]
    carried = [_carried(record) for record in records_in(file)]
    rows += [
        (
            f"carries {one['name']}",
            f"{number(one['length'])} {one['unit']} long, {one['templates']} templates fitted, "
            f"h {number(one['h'])}, w {number(one['w'])}{', pasted' if one['pasted'] else ''}",
        )
        for one in carried
    ] or [("carries", "no ridge feature")]
    box_of = {"unit": "mm", "low": list(low), "high": list(high)}
    return "a STEP file", rows, {"kind": "step", **counts, **box_of, "features": carried}


def _carried(record: Any) -> dict[str, Any]:
    """What to tell of a feature in a STEP file; h and w are the rates at which it stands there."""
    return {
        "name": record.name,
        "unit": record.feature["unit"],
        "length": record.feature["stations"]["arc_length"][-1],
        "templates": len(record.feature["templates"]),
        "h": record.h,
        "w": record.w,
        "pasted": record.placement is not None,
    }
