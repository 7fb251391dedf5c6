"""The record of a ridge feature that a CAD shape or a STEP file carries. Plain data, without OCCT."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

from ridgefeature.io.feature import from_document, to_document
from ridgefeature.ridge import Ridge

Matrix = tuple[tuple[float, ...], ...]

UNMOVED: Matrix = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))


@dataclass(frozen=True)
class Carried:
    """A ridge feature on a face of a CAD shape, as plain JSON data.

    name: of the face; STEP files number equal ones. feature: the ridge as registered, the document of its
    .ridge.json. h, w: the rates at which the face was made. placement, host: what is needed to paste it
    again, or None. motion: the rigid motion of the face since the record was attached, as the three upper
    rows (3, 4) of its matrix, lengths in the shape's unit.
    """

    name: str
    feature: dict[str, Any]
    h: float = 1.0
    w: float = 1.0
    placement: dict[str, Any] | None = None
    host: dict[str, Any] | None = None
    motion: Matrix = UNMOVED


_KEPT = 8

_RIDGES: deque[tuple[dict[str, Any], Ridge]] = deque(maxlen=_KEPT)
"""The ridges of documents that were asked for lately."""
_DOCUMENTS: WeakKeyDictionary[Ridge, dict[str, Any]] = WeakKeyDictionary()


def record_of(ridge: Any, h: float = 1, w: float = 1, name: str = "ridge") -> Carried | None:
    """The record of a Ridge at rates h and w; None for anything else, which has no feature to carry.

    Records of one Ridge share its document: do not change it.
    """
    if not isinstance(ridge, Ridge):
        return None
    if ridge not in _DOCUMENTS:  # a Ridge does not change
        _DOCUMENTS[ridge] = to_document(ridge)
    return Carried(name, _DOCUMENTS[ridge], float(h), float(w))


def ridge_in(record: Carried) -> Ridge:
    """The ridge of a record, as registered; the same one for equal documents, so that sliders are warm."""
    document = record.feature
    for known, ridge in _RIDGES:
        if known == document:
            return ridge
    ridge = from_document(document)
    _RIDGES.append((document, ridge))
    return ridge
