"""Which solid and which of its faces a ridge is pasted on."""

from __future__ import annotations

from typing import Any

import cadquery as cq
from numpy.typing import ArrayLike
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape

from cad_export.carried import carried_by, faces_of
from cad_export.check import subshapes
from cad_export.face_base import vector
from cad_export.geometry import topods
from cad_export.inset import face_of
from cad_export.room import check_room
from ridgefeature.ridge import Ridge

_FACE = "a face of the host, a selector of one such as '>Z', or a Workplane on which one is selected"


def solid_of(host: Any) -> TopoDS_Shape:
    """The only solid in a shape or on a Workplane's stack."""
    shapes = host.vals() if hasattr(host, "vals") else [host]
    solids = [solid for shape in shapes for solid in subshapes(topods(shape), TopAbs_SOLID)]
    if len(solids) != 1:
        raise ValueError(f"host: expected one solid, got {len(solids)}; make one, or choose one of them")
    return solids[0]


def chosen_face(solid: TopoDS_Shape, face: Any, path: Any, at: ArrayLike | None, ridge: Ridge) -> TopoDS_Face:
    """The given face; else the one nearest to the place or path, else the largest. As the solid holds it.

    ridge: in millimetres. Raises ValueError where there is no such face, or none with room for it.
    """
    if face is not None:
        return face_of(solid, _given(solid, face))
    faces = faces_of(solid)
    if path is not None or at is not None:
        goal = _vertex(at) if path is None else topods(path)
        nearest = min(faces, key=lambda f: BRepExtrema_DistShapeShape(goal, f).Value())
        _check_free(solid, nearest, "at" if path is None else "path")
        return face_of(solid, nearest)
    areas = [cq.Face(f).Area() for f in faces]
    largest = max(areas)
    found = faces[areas.index(largest)]
    if sum(a > (1 - 1e-6) * largest for a in areas) > 1:
        check_room(solid, found, ridge, "host")
        raise ValueError("face: the host has several largest faces; give face=, at= or path=")
    return face_of(solid, found)


def _given(solid: TopoDS_Shape, face: Any) -> TopoDS_Face:
    """The face that is meant: itself, or the only one that is selected."""
    found, said = [face], type(face).__name__
    if isinstance(face, (str, cq.Selector)):
        found = _select(solid, face)
        said = f"{len(found)} faces by {face!r}" if isinstance(face, str) else f"{len(found)} faces"
    elif hasattr(face, "vals"):
        found = face.vals()
        said = f"a {said} with {', '.join(type(one).__name__ for one in found) or 'nothing'}"
    shape = getattr(found[0], "wrapped", found[0]) if len(found) == 1 else None
    if not isinstance(shape, TopoDS_Shape) or shape.IsNull() or shape.ShapeType() != TopAbs_FACE:
        raise ValueError(f"face: expected {_FACE}, got {said}; select one face, or leave it out")
    return TopoDS.Face_s(shape)


def _select(solid: TopoDS_Shape, selector: str | cq.Selector) -> list[Any]:
    try:
        return list(cq.Workplane(cq.Solid(solid)).faces(selector).vals())
    except Exception as error:  # the selectors' parser has exceptions of its own
        raise ValueError(
            f"face: expected {_FACE}, got {selector!r}, which selects none; correct it"
        ) from error


def _check_free(solid: TopoDS_Shape, face: TopoDS_Face, place: str) -> None:
    """Raise ValueError where the face that was found is that of a ridge: nobody asked for a ridge on it."""
    for other, record in carried_by(solid):
        if other.IsSame(face):
            raise ValueError(
                f"{place}: expected a place clear of ridges pasted before, {record.name!r} is there; give "
                "another place, face= to set this ridge on that one, or paste on the host as it was before"
            )


def _vertex(at: ArrayLike | None) -> TopoDS_Shape:
    return BRepBuilderAPI_MakeVertex(gp_Pnt(*vector(at, "at").tolist())).Vertex()
