"""How a pasted part was made: the host before its first paste, and every paste since."""

from __future__ import annotations

import zlib
from base64 import b64decode, b64encode
from collections import OrderedDict
from dataclasses import dataclass, replace
from functools import lru_cache
from io import BytesIO
from typing import Any

import cadquery as cq
import numpy as np
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from cad_export.carried import attach, faces_of
from cad_export.check import volume
from cad_export.geometry import topods
from cad_export.record import Carried

_KEPT = 32
"""Parts whose making is remembered, and hosts."""
_KEPT_TEXTS = 16


@dataclass(frozen=True, eq=False)
class Placement:
    """Where and how a ridge was pasted: what `paste` was given, and a point of the face under its middle."""

    on_face: tuple[float, float, float]
    at: Any
    direction: Any
    path: Any
    options: dict[str, Any]
    volume_added: float

    def document(self, order: int, part: _Part) -> dict[str, Any]:
        """As plain JSON data."""
        return {
            "order": order,
            "on_face": list(self.on_face),
            "at": _numbers(self.at),
            "direction": _numbers(self.direction),
            "path": None if self.path is None else to_text(topods(self.path)),
            "options": self.options,
            "part_volume": part.volume,
            "part_faces": len(faces_of(part.shape)),
        }


@dataclass(frozen=True, eq=False)
class _Part:
    """A part that `paste` made: its shape, held so that its identity stays its own, and its history."""

    shape: TopoDS_Shape
    volume: float
    host: dict[str, Any]
    pastes: int
    tshape: Any = None


_PARTS: OrderedDict[int, _Part] = globals().get("_PARTS", OrderedDict())


def to_text(shape: TopoDS_Shape) -> str:
    """A shape as ASCII: OCCT's binary BREP, compressed, in base 64."""
    stream = BytesIO()
    cq.Shape.cast(shape).exportBin(stream)
    return b64encode(zlib.compress(stream.getvalue())).decode("ascii")


@lru_cache(_KEPT_TEXTS)
def from_text(text: str) -> cq.Shape:
    """The shape that `to_text` wrote; the same one for the same text, so that what is known of it serves."""
    return cq.Shape.importBin(BytesIO(zlib.decompress(b64decode(text))))


def remember(
    host: TopoDS_Shape, part: TopoDS_Shape, face: TopoDS_Face, record: Carried | None, place: Placement
) -> None:
    """Let the ridge's face carry its feature and how the part was made."""
    if record is None:
        return
    before = _known(host)
    if before is None or not host.IsEqual(before.shape):
        before = _Part(host, volume(host, 1e-6), {"brep": to_text(host)}, 0)
        _keep(before)
    after = _Part(part, before.volume + place.volume_added, before.host, before.pastes + 1)
    _keep(after)
    document = place.document(before.pastes, after)
    attach(face, replace(record, placement=document, host=before.host))


def known_volume(shape: TopoDS_Shape) -> float | None:
    """The volume of a part that `paste` made or was given, wherever it was moved; None for any other."""
    found = _known(shape)
    return found.volume if found and found.shape.Orientation() == shape.Orientation() else None


def _known(shape: TopoDS_Shape) -> _Part | None:
    key = id(shape.TShape())
    if key in _PARTS:
        _PARTS.move_to_end(key)  # a slider asks for its host again and again
    return _PARTS.get(key)


def _keep(part: _Part) -> None:
    tshape = part.shape.TShape()
    _PARTS[id(tshape)] = replace(part, tshape=tshape)
    while len(_PARTS) > _KEPT:
        _PARTS.popitem(last=False)


def _numbers(value: Any) -> list[float] | None:
    return None if value is None else np.asarray(value, dtype=np.float64).tolist()
