"""The ridge as a step in a chain of CadQuery calls: `invoke(ridge(...))` and `Workplane.pasteRidge`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cadquery as cq

from cad_export.carried import carried_by
from cad_export.pasting import paste
from ridgefeature.ridge import Ridge


def ridge(feature: Ridge, tag: str | None = None, **options: Any) -> Callable[[cq.Workplane], cq.Workplane]:
    """A step for `Workplane.invoke` that pastes the ridge on what is selected; see `pasteRidge`."""

    def step(workplane: cq.Workplane) -> cq.Workplane:
        return paste_ridge(workplane, feature, tag, **options)

    return step


def paste_ridge(
    workplane: cq.Workplane, feature: Ridge, tag: str | None = None, **options: Any
) -> cq.Workplane:
    """The chain's solid with the ridge pasted at every selected face, point or location: a new Workplane.

    On a face the ridge's middle comes to the face's, on a point or location there, on the face that it lies
    on; a location's x gives the direction, and so does a workplane's with nothing on its stack. With nothing
    but the solid selected it goes where `paste` puts it. tag: name under which the ridges' faces can be
    selected later, faces(tag=...). options: those of `paste`, h and w among them. Raises ValueError where
    there is no solid and as `paste` does.
    """
    found = workplane.findSolid()
    solid: Any = found if isinstance(found, cq.Solid) else _only_solid(found)
    known = {hash(face) for face, _ in carried_by(solid)}
    for place in [_place(item, workplane) for item in workplane.objects] or [_on_plane(workplane.plane)]:
        solid = paste(feature, solid, **{**place, **options})
    added = [cq.Face(face) for face, _ in carried_by(solid) if hash(face) not in known]
    faces = workplane.newObject(added)
    if tag is not None:
        faces.tag(tag)
    return faces.newObject([solid])


def _only_solid(shape: cq.Shape) -> cq.Solid:
    solids = shape.Solids()
    if len(solids) != 1:
        raise ValueError(f"expected one solid in the chain, got {len(solids)}; make one, or choose one")
    return solids[0]


def _place(item: Any, workplane: cq.Workplane) -> dict[str, Any]:
    """Where `paste` shall put the ridge for one item of the stack."""
    if isinstance(item, cq.Face):
        return {"face": item}
    if isinstance(item, cq.Location):
        return _on_plane(cq.Plane(workplane.plane.location * item))
    if isinstance(item, cq.Vector):
        return {"at": item.toTuple()}
    if isinstance(item, (cq.Edge, cq.Wire)):
        return {"path": item}
    if isinstance(item, cq.Vertex):
        return {"at": item.Center().toTuple()}
    if isinstance(item, cq.Shape):
        return {}
    raise ValueError(f"expected faces, points, locations or edges selected, got {type(item).__name__}")


def _on_plane(plane: cq.Plane) -> dict[str, Any]:
    return {"at": plane.origin.toTuple(), "direction": plane.xDir.toTuple()}
