"""A ridge as a FreeCAD macro: the template beside this file with the ridge's data in it."""

from __future__ import annotations

import json
import os
import threading
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from cad_export.freecad.affine import affine_poles
from cad_export.freecad.curved import curved_surface
from ridgefeature import Ridge
from ridgefeature.io.feature import to_document
from ridgefeature.scan import millimetres_per

SUFFIX = ".FCMacro"


def write_macro(ridge: Ridge, path: str | os.PathLike[str]) -> Path:
    """Write a macro that makes the ridge a FreeCAD object, and return its path.

    The macro needs FreeCAD alone. Its object, a Part::FeaturePython, has the rates Height and Width as
    properties (1 = as registered) and makes its B-spline face from them again, in millimetres; it refuses
    the rates that `ridge.resized` refuses. The macro also carries the feature as JSON. Every number is exact
    to the last bit; the poles are combined in the macro, exact to 1e-12 of the largest coordinate. On a base
    that is curved across they are not affine in the width: the macro makes them with numpy, which FreeCAD
    brings, and takes rates of the width above 0.05.
    The file is written beside the path and renamed.
    Raises ValueError for something that is no Ridge or a name that does not end in .FCMacro, OSError where
    the file cannot be written.
    """
    target = Path(path)
    if not isinstance(ridge, Ridge):
        raise ValueError(f"expected a Ridge, got {type(ridge).__name__}; register or load one first")
    if target.suffix.lower() != SUFFIX.lower():
        raise ValueError(f"expected a file name that ends in {SUFFIX}, got {target.name!r}; rename it")
    if not target.parent.is_dir():
        raise FileNotFoundError(f"expected a folder to write to, got {str(target.parent)!r}; create it first")
    template = Template(files(__package__).joinpath("ridge.FCMacro").read_text(encoding="ascii"))
    text = template.substitute(data=_literal(ridge))
    beside = target.with_name(f".{target.name}.{os.getpid()}-{threading.get_ident()}.part")
    try:
        beside.write_text(text, encoding="ascii")
        os.replace(beside, target)
    finally:
        beside.unlink(missing_ok=True)
    return target


def _literal(ridge: Ridge) -> str:
    """The macro's data as JSON, in a form that may stand between r-quotes in Python."""
    source = "unknown" if ridge.source is None else f"{ridge.source.name}, SHA-256 {ridge.source.sha256}"
    parts = (
        f'{{"source": {json.dumps(source)}',
        f'"surface": {_surface(ridge)}',
        f'"feature": {json.dumps(to_document(ridge), indent=1)}}}',
    )
    # JSON never has three quotes in a row, and raw quotes leave its backslashes alone.
    return ",\n".join(parts)


def _surface(ridge: Ridge) -> str:
    """The surface as JSON: for a flat base one row of poles a line, x, y, z of each pole in millimetres."""
    surface = ridge.surface()
    entries: dict[str, Any] = {}
    for name in "uv":
        knots, counts = np.unique(getattr(surface, f"knots_{name}"), return_counts=True)
        entries[f"degree_{name}"] = getattr(surface, f"degree_{name}")
        entries[f"knots_{name}"] = knots.tolist()
        entries[f"multiplicities_{name}"] = counts.tolist()
    if ridge.curvature.any():
        return json.dumps(entries | curved_surface(ridge), indent=1)
    poles, factor = affine_poles(ridge), millimetres_per(ridge.unit)
    entries["largest_width"] = poles.largest_width
    lines = [f'"{name}": {json.dumps(value)}' for name, value in entries.items()]
    for name in ("fixed", "per_height", "per_width"):
        rows = (factor * getattr(poles, name)).reshape(len(poles.fixed), -1).tolist()
        lines.append(f'"{name}": [\n' + ",\n".join(json.dumps(row) for row in rows) + "\n]")
    return "{\n" + ",\n".join(lines) + "\n}"
