"""Which ridge features a CAD shape carries: records kept beside OCCT's surfaces, which outlive the shapes."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_BSplineSurface, Geom_Surface
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape

from cad_export import occt_arrays
from cad_export.geometry import topods
from cad_export.record import Carried, record_of

__all__ = ["Carried", "attach", "carried_by", "faces_of", "record_of"]

Floats = NDArray[np.float64]

_KEPT = 128  # surfaces remembered after their last shape has gone, so that moved copies still find them


class _Entry(NamedTuple):
    surface: Geom_Surface  # held, so that its identity is not given to another
    location: TopLoc_Location
    record: Carried | None  # None: taken off
    outline: tuple[int, ...] | None  # what a copy of the surface has in common with it


# A reload of this module keeps what is already attached.
_ENTRIES: OrderedDict[int, _Entry] = globals().get("_ENTRIES", OrderedDict())
_LOCK = threading.Lock()


def attach(face_or_surface: Any, record: Carried | None) -> None:
    """Let this face carry the record; None takes off the one that it has.

    Takes a cq.Face, anything whose `.wrapped` is a TopoDS_Face, that itself, or a Geom_Surface. The record
    belongs to the face's Geom_Surface, which booleans, locations and sewing hand on. Raises ValueError for
    anything else.
    """
    if isinstance(face_or_surface, Geom_Surface):
        surface, location = face_or_surface, TopLoc_Location()
    else:
        surface, location = _surface(_one_face(face_or_surface))
    if record is not None and not isinstance(record, Carried):
        raise ValueError(f"expected a Carried record or None, got {type(record).__name__}; make one first")
    with _LOCK:
        _ENTRIES.pop(id(surface), None)
        _ENTRIES[id(surface)] = _Entry(surface, location, record, _outline(surface))
        _forget()


def carried_by(shape: Any) -> list[tuple[TopoDS_Face, Carried]]:
    """The faces of a shape that carry a ridge feature, with their records, in the shape's order of faces.

    Takes a cq.Shape, anything whose `.wrapped` is a TopoDS_Shape, or that itself. A face that was cut in two
    comes twice. Copies whose surface was moved or copied (BRepBuilderAPI_Copy and BRepBuilderAPI_Transform,
    hence CadQuery's translate, rotate and copy) are known by their poles, equal up to a rigid motion. Scaled,
    mirrored and refitted copies carry nothing. Raises ValueError for what is no shape.
    """
    found = []
    for face in faces_of(topods(shape)):
        surface, location = _surface(face)
        with _LOCK:
            entry = _ENTRIES.get(id(surface))
            outline = None if entry else _outline(surface)
            candidates = (
                [e for e in _ENTRIES.values() if e.record and e.outline == outline] if outline else []
            )
        if entry:
            found += [(face, _moved(entry, entry.record, location, np.eye(4)))] if entry.record else []
        for other in reversed(candidates):  # the youngest first
            move = _rigid_motion(other.surface, surface)
            if other.record and move is not None:
                found.append((face, _moved(other, other.record, location, move)))
                break
    return found


def faces_of(shape: TopoDS_Shape) -> list[TopoDS_Face]:
    """All faces of a shape once each, in the order of OCCT's TopExp::MapShapes."""
    faces = occt_arrays.shape_map()
    TopExp.MapShapes_s(shape, TopAbs_FACE, faces)
    return [TopoDS.Face_s(faces.FindKey(i)) for i in range(1, faces.Extent() + 1)]


def _one_face(source: Any) -> TopoDS_Face:
    shape = topods(source)
    if shape.ShapeType() != TopAbs_FACE:
        raise ValueError(
            f"expected a face or a Geom_Surface, got {type(source).__name__} of another kind; select a face"
        )
    return TopoDS.Face_s(shape)


def _surface(face: TopoDS_Face) -> tuple[Geom_Surface, TopLoc_Location]:
    """The face's own surface and its place; the surface is the same object for all faces that share it."""
    location = TopLoc_Location()
    return BRep_Tool.Surface_s(face, location), location


def _forget() -> None:
    """Drop the oldest surfaces that no shape uses any more, but for those that are kept for copies.

    Looked for at 256, 512, ... surfaces: counting their users takes half a millisecond each.
    """
    n = len(_ENTRIES)
    if n < 2 * _KEPT or n & (n - 1):
        return
    # a handle of its own aside, OCCT's count is of the faces on it
    idle = [key for key, entry in _ENTRIES.items() if entry.surface.GetRefCount() <= 1]
    for key in idle[: n - _KEPT]:
        del _ENTRIES[key]


def _moved(entry: _Entry, record: Carried, location: TopLoc_Location, move: Floats) -> Carried:
    """The record with the motion from where it was attached to `location`, after `move` of the surface."""
    before = np.vstack([record.motion, (0.0, 0.0, 0.0, 1.0)])
    start = _matrix(entry.location)
    motion = _matrix(location) @ move @ np.linalg.inv(start) @ before
    if np.array_equal(_matrix(location), start) and np.array_equal(move, np.eye(4)):
        return record
    return replace(record, motion=tuple(tuple(row) for row in motion[:3].tolist()))


def _matrix(location: TopLoc_Location) -> Floats:
    move = location.Transformation()
    rows = [[move.Value(i, j) for j in range(1, 5)] for i in range(1, 4)]
    return np.array([*rows, [0.0, 0.0, 0.0, 1.0]])


def _rigid_motion(old: Geom_BSplineSurface, new: Geom_BSplineSurface) -> Floats | None:
    """The motion (4, 4) that takes the poles of `old` to those of `new`, as many; None if none does to 1e-9.

    Least squares by singular values (Kabsch 1976); mirrored poles are no match.
    """
    ends = [g.Pole(1, 1).Distance(g.Pole(g.NbUPoles(), g.NbVPoles())) for g in (old, new)]
    if abs(ends[0] - ends[1]) > 1e-9 * max(*ends, 1.0):  # cheap, and enough for nearly all others
        return None
    p, q = occt_arrays.pole_array(old).reshape(-1, 3), occt_arrays.pole_array(new).reshape(-1, 3)
    if np.array_equal(p, q):
        return np.eye(4)
    p0, q0 = p.mean(axis=0), q.mean(axis=0)
    u, _, vt = np.linalg.svd((q - q0).T @ (p - p0))
    turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    if np.abs((p - p0) @ turn.T + q0 - q).max() > 1e-9 * max(np.abs(p).max(), np.abs(q).max()):
        return None
    move = np.eye(4)
    move[:3, :3], move[:3, 3] = turn, q0 - turn @ p0
    return move


def _outline(g: Geom_Surface) -> tuple[int, ...] | None:
    """Numbers that tell most B-spline surfaces apart, None for others."""
    if not isinstance(g, Geom_BSplineSurface):
        return None
    return g.NbUPoles(), g.NbVPoles(), g.UDegree(), g.VDegree(), g.NbUKnots(), g.NbVKnots()
