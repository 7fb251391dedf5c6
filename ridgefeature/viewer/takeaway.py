"""What can be taken away: a ridge as STEP, feature file, FreeCAD macro, pictures and CadQuery script."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ridgefeature.scan import Scan
from ridgefeature.viewer.session import Feature

_SCRIPT = '''"""{name}, to be regenerated at any height and width. Keep {feature} beside this file."""

from pathlib import Path

import cadquery as cq

import cad_export as cx
import ridgefeature as rf

h = {h:g}  # height and width as rates: 1 is as in the feature file
w = {w:g}

here = Path(__file__).parent if "__file__" in globals() else Path.cwd()
ridge = rf.load(here / "{feature}")
result = cq.Workplane(cx.face({ridge}, unit="mm"))
if "show_object" in globals():
    show_object(result)  # noqa: F821
else:
    cx.write(result, here / "{stem}.step")
'''


def stem_of(name: str) -> str:
    """A file name, without its suffix, for what bears this name: nothing but letters, digits and dashes."""
    return re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower() or "ridge"


def _step(feature: Feature, scan: Scan | None, path: Path) -> None:
    from cad_export import step

    step(feature.ridge, path)


def _json(feature: Feature, scan: Scan | None, path: Path) -> None:
    feature.ridge.save(path)


def _macro(feature: Feature, scan: Scan | None, path: Path) -> None:
    from cad_export import write

    write(feature.ridge, path)


def _profile(feature: Feature, scan: Scan | None, path: Path) -> None:
    from ridgefeature import plot

    plot.profile(feature.ridge, path, scan, feature.registered)


def _view(feature: Feature, scan: Scan | None, path: Path) -> None:
    from ridgefeature import plot

    plot.view(_needed(scan), feature.ridge, path)


def _deviation(feature: Feature, scan: Scan | None, path: Path) -> None:
    from ridgefeature import plot

    plot.deviation(_needed(scan), feature.registered, path)


def _script(feature: Feature, scan: Scan | None, path: Path) -> None:
    """The script and, beside it, the feature that it loads, in one archive."""
    import zipfile

    stem = stem_of(feature.name)
    part = path.with_name(f"{stem}.ridge.json")
    feature.begun.save(part)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(f"{stem}.py", script(feature))
        archive.write(part, part.name)


KINDS: dict[str, tuple[str, Callable[[Feature, Scan | None, Path], None]]] = {
    "step": (".step", _step),
    "json": (".ridge.json", _json),
    "macro": (".FCMacro", _macro),
    "script": ("-cadquery.zip", _script),
    "profile": ("-profile.png", _profile),
    "view": ("-view.png", _view),
    "deviation": ("-deviation.png", _deviation),
}
"""What each is called, how its file name ends, and what writes it."""


def script(feature: Feature) -> str:
    """A CadQuery script that regenerates the ridge, with its rates at the top."""
    stem = stem_of(feature.name)
    between = "" if feature.between is None else f", between=({feature.between[0]:g}, {feature.between[1]:g})"
    return _SCRIPT.format(
        name=feature.name.replace('"', "'").replace("\\", "/"),
        h=feature.h,
        w=feature.w,
        stem=stem,
        feature=f"{stem}.ridge.json",
        ridge=f"ridge.resized(h=h, w=w{between})",
    )


def write(kind: str, feature: Feature, scan: Scan | None, folder: Path) -> Path:
    """Write one of `KINDS` to a folder. Raises ValueError for any other, and as its writer does."""
    if kind not in KINDS:
        raise ValueError(f"expected one of {', '.join(KINDS)}, got {kind!r}; choose one")
    suffix, writer = KINDS[kind]
    path = folder / f"{stem_of(feature.name)}{suffix}"
    writer(feature, scan, path)
    return path


def _needed(scan: Scan | None) -> Scan:
    if scan is None:
        raise ValueError("expected an open scan for this picture, there is none; open it first")
    return scan


def part(solid: Any, folder: Path) -> Path:
    """Write a solid with its ridges as STEP to a folder."""
    from cad_export import step

    path = folder / "part.step"
    step(solid, path)
    return path
