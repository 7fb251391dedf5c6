"""Regenerate: a pasted part made again with its ridges at other heights and widths."""

from __future__ import annotations

import os
from collections import deque
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import cadquery as cq
import numpy as np
from OCP.gp import gp_Trsf
from OCP.TopAbs import TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shape

from cad_export.carried import carried_by, faces_of
from cad_export.check import subshapes, volume
from cad_export.geometry import topods
from cad_export.loading import carried_in
from cad_export.paste_history import from_text, known_volume
from cad_export.pasting import check_rates, paste
from cad_export.record import Carried, ridge_in
from cad_export.step_file import read_step
from cad_export.step_model import named

_SAME_VOLUME = 1e-5


def regenerate(
    part: Any, h: float | None = None, w: float | None = None, name: str | None = None, check: bool = True
) -> cq.Solid:
    """A part that `paste` made, made again with its ridges at the rates h and w.

    part: the path of a STEP file that `step` wrote, or the solid itself; a Workplane serves too. What is left
    out of h and w stays as it was. name: of the only ridge to change, as the STEP file names it; without it
    all of them change. The host of the first paste and every placement are stored with the part. Raises
    ValueError for a part without a pasted ridge, several solids, an unknown name, and a part that was changed
    after its last paste: what was done to it since is not known, so run the script that made it instead. Of
    what was pasted before such a change, and pasted on later, the same holds.
    """
    check_rates(**{which: rate for which, rate in (("h", h), ("w", w)) if rate is not None})
    shape, records = _read(part)
    pasted = [_Paste(r, r.placement, r.host["brep"]) for r in records if r.placement and r.host]
    if not pasted:
        raise ValueError(
            "part: expected one with a pasted ridge, got none; paste a ridge first, or give a ridge alone "
            "other rates by resized"
        )
    solids = subshapes(shape, TopAbs_SOLID)
    if len(solids) != 1:
        raise ValueError(
            f"part: expected one solid, got {len(solids)}; give one of them: those of a STEP file "
            "are cq.Shape.cast(cad_export.read_step(file)).Solids()"
        )
    chain = _chain(shape, pasted)
    _check_name(name, [p.record.name for p in chain], [p.record.name for p in pasted])
    solid: Any = from_text(chain[0].host)
    for step in chain:
        chosen = name is None or step.record.name == name
        make = _again if step is chain[-1] else _again_or_kept
        solid = make(solid, step, h if chosen else None, w if chosen else None, check)
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
    # named as in a STEP file; the faces of a ridge that was cut in two are one
    return shape, list({record.name: record for _, record in named(carried_by(shape))}.values())


def _chain(shape: TopoDS_Shape, pasted: list[_Paste]) -> list[_Paste]:
    """The pastes on one host, in order, that made the shape as it is.

    A part that was changed and then pasted on again is the host of another chain.
    """
    faces, made = len(faces_of(shape)), []
    for host in dict.fromkeys(p.host for p in pasted):
        chain = sorted((p for p in pasted if p.host == host), key=lambda p: int(p.place["order"]))
        place = chain[-1].place
        if faces != place["part_faces"] or not _has_volume(shape, place["part_volume"]):
            made.append(f"{place['part_faces']} faces and the volume {place['part_volume']:.9g}")
        elif [p.place["order"] for p in chain] == list(range(len(chain))):
            return chain
    if not made:
        raise ValueError("part: some of its pasted ridges are missing; run the script that made it instead")
    raise ValueError(
        f"part: expected {' or '.join(made)} that its last paste left, got {faces} and "
        f"{volume(shape, 1e-6):.9g}: it was changed since; run the script that made it instead"
    )


def _has_volume(shape: TopoDS_Shape, expected: float) -> bool:
    """Whether a shape has this volume, to _SAME_VOLUME. Of a part that paste made here it is known."""
    known = known_volume(shape)
    if known is not None:
        return abs(known - expected) <= _SAME_VOLUME * abs(known)
    half = 0.5 * _SAME_VOLUME  # measured to one half and off by no more than the other: true, and faster
    for accuracy, room in ((half, half), (1e-6, _SAME_VOLUME)):
        found = volume(shape, accuracy)
        if abs(found - expected) <= room * abs(found):
            return True
    return False


def _check_name(name: str | None, known: list[str], all_names: list[str]) -> None:
    """Whether the ridges that are meant can change: all of them without a name."""
    told = ", ".join(map(repr, known))
    fixed = [other for other in all_names if other not in known]
    if name is None and fixed:
        raise ValueError(
            f"name: expected one of {told}, got none: the part was changed after the paste of "
            f"{', '.join(map(repr, fixed))}, which cannot change any more; name one, or run the script that "
            "made it instead"
        )
    if name in fixed:
        raise ValueError(
            f"name: expected one of {told}, got {name!r}, after whose paste the part was changed; run the "
            "script that made it instead"
        )
    if name is not None and name not in known:
        raise ValueError(f"name: expected one of {told}, got {name!r}")


_INNER: deque[tuple[Any, tuple[Any, ...], cq.Solid]] = deque(maxlen=8)
"""Parts that the last paste was made on lately, by what they were made of: a slider of the last asks again.

The last part itself is not kept: it is the caller's, who may move it.
"""


def _again_or_kept(solid: Any, *how: Any) -> cq.Solid:
    for host, known, made in _INNER:
        if host is solid and known == how:
            return made
    made = _again(solid, *how)
    _INNER.append((solid, how, made))
    return made


def _again(solid: Any, step: _Paste, h: float | None, w: float | None, check: bool) -> cq.Solid:
    """One paste repeated at other rates."""
    record, place = step.record, step.place
    path = None if place["path"] is None else from_text(place["path"])
    return paste(
        ridge_in(record),
        solid,
        face=_face_at(solid, tuple(place["on_face"])),
        path=path,
        at=place["at"],
        direction=place["direction"],
        h=record.h if h is None else h,
        w=record.w if w is None else w,
        check=check,
        name=record.name,
        **place["options"],
    )


@lru_cache(_INNER.maxlen)
def _face_at(solid: cq.Shape, at: tuple[float, float, float]) -> cq.Face:
    """The face of a solid nearest to a point, kept as the solids are."""
    return min(solid.Faces(), key=lambda face: face.distance(cq.Vertex.makeVertex(*at)))


def _moved(solid: cq.Solid, record: Carried) -> cq.Solid:
    """The solid where the part is now."""
    rows = np.array(record.motion)
    if np.array_equal(rows, np.eye(4)[:3]):
        return solid
    move = gp_Trsf()
    move.SetValues(*rows.ravel().tolist())
    return cq.Solid(solid.wrapped.Moved(TopLoc_Location(move)))
