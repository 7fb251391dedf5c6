"""Regenerate: a pasted part made again with its ridges at other heights and widths."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cadquery as cq
import numpy as np
from OCP.gp import gp_Trsf
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shape

from cad_export.carried import carried_by, faces_of
from cad_export.check import volume
from cad_export.geometry import topods
from cad_export.loading import carried_in
from cad_export.paste_history import from_text
from cad_export.pasting import paste
from cad_export.record import Carried
from cad_export.step_file import read_step
from ridgefeature.io.feature import from_document

_SAME_VOLUME = 1e-5


def regenerate(
    part: Any, h: float | None = None, w: float | None = None, name: str | None = None, check: bool = True
) -> cq.Solid:
    """A part that `paste` made, made again with its ridges at the rates h and w.

    part: the path of a STEP file that `step` wrote, or the solid itself; a Workplane serves too. What is left
    out of h and w stays as it was. name: of the only ridge to change, as the STEP file names it; without it
    all of them change. The host of the first paste and every placement are stored with the part. Raises
    ValueError for a part without a pasted ridge, an unknown name, and a part that was changed after its last
    paste: what was done to it since is not known, so run the script that made it instead.
    """
    shape, records = _read(part)
    pasted = [_Paste(r, r.placement, r.host["brep"]) for r in records if r.placement and r.host]
    if not pasted:
        raise ValueError("part: expected one with a pasted ridge, got none; paste a ridge first")
    pasted.sort(key=lambda paste: int(paste.place["order"]))
    chain = [p for p in pasted if p.host == pasted[-1].host]
    if [p.place["order"] for p in chain] != list(range(len(chain))):
        raise ValueError("part: some of its pasted ridges are missing; run the script that made it instead")
    _check_unchanged(shape, chain[-1].place)
    names = [p.record.name for p in chain]
    if name is not None and name not in names:
        raise ValueError(f"name: expected one of {', '.join(names)}, got {name!r}")
    solid: Any = from_text(chain[0].host)
    for step in chain:
        chosen = name is None or step.record.name == name
        solid = _again(solid, step, h if chosen else None, w if chosen else None, check)
    return _moved(solid, chain[-1].record)


@dataclass(frozen=True)
class _Paste:
    """One paste of a part's history."""

    record: Carried
    place: dict[str, Any]
    host: str


def _read(part: Any) -> tuple[TopoDS_Shape, list[Carried]]:
    if isinstance(part, (str, os.PathLike)):
        path = Path(part)
        return read_step(path), carried_in(path)
    values = part.vals() if hasattr(part, "vals") else [part]
    if len(values) != 1:
        raise ValueError(f"part: expected one shape, got {len(values)}; choose one")
    shape = topods(values[0])
    return shape, [record for _, record in carried_by(shape)]


def _check_unchanged(shape: TopoDS_Shape, place: dict[str, Any]) -> None:
    found, made = volume(shape, 1e-6), place["part_volume"]
    if len(faces_of(shape)) != place["part_faces"] or abs(found - made) > _SAME_VOLUME * abs(made):
        raise ValueError(
            f"part: expected {place['part_faces']} faces and the volume {made:.9g} that its last paste left, "
            f"got {len(faces_of(shape))} and {found:.9g}: it was changed since; run the script that made it "
            "instead"
        )


def _again(solid: Any, step: _Paste, h: float | None, w: float | None, check: bool) -> cq.Solid:
    """One paste repeated at other rates."""
    record, place = step.record, step.place
    path = None if place["path"] is None else from_text(place["path"])
    at = np.array(place["on_face"])
    face = min(solid.Faces(), key=lambda f: f.distance(cq.Vertex.makeVertex(*at)))
    return paste(
        from_document(record.feature),
        solid,
        face=face,
        path=path,
        at=place["at"],
        direction=place["direction"],
        h=record.h if h is None else h,
        w=record.w if w is None else w,
        check=check,
        name=record.name,
        **place["options"],
    )


def _moved(solid: cq.Solid, record: Carried) -> cq.Solid:
    """The solid where the part is now."""
    rows = np.array(record.motion)
    if np.array_equal(rows, np.eye(4)[:3]):
        return solid
    move = gp_Trsf()
    move.SetValues(*rows.ravel().tolist())
    return cq.Solid(solid.wrapped.Moved(TopLoc_Location(move)))
