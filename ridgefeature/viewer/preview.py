"""A ridge pasted on a part: the solid, and its triangles for the page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ridgefeature.ridge import Ridge
from ridgefeature.scan import millimetres_per

Array = NDArray[np.float64]
Corners = NDArray[np.int64]
HOSTS = ("plane", "cylinder", "sphere")
_ROOM = 1.1
"""Size of a host's face, in that of what a ridge may need."""
_FINE, _BEND = 1e-3, 0.25
"""Distance of triangles from the surface, in the part's size; angle between two of them."""


@dataclass(frozen=True, eq=False)
class Part:
    """A host with a ridge on it, in millimetres."""

    solid: Any
    """cq.Solid."""
    points: Array
    host: Corners
    grown: Corners
    """(m, 3) corners of the triangles of the host's own faces, and of the ridge's."""
    told: str
    """Volumes in words."""


def host_for(kind: str, ridge: Ridge) -> tuple[Any, Array]:
    """A solid, one of HOSTS, with room for a ridge, and the place (3,) on it where the ridge may go.

    Raises ValueError for any other kind.
    """
    import cadquery as cq

    size = millimetres_per(ridge.unit)
    border, height = size * float(ridge.border.max()), size * float(np.abs(ridge.height).max())
    spine = size * ridge.spine
    # Its middle comes to the place, and it may lead anywhere from there.
    apart = np.linalg.norm(spine - spine[len(spine) // 2], axis=1)
    extent = 2.0 * _ROOM * (float(apart.max()) + border)
    if kind == "plane":
        thick = max(0.08 * extent, 1.5 * height)
        return cq.Workplane().box(extent, extent, thick).val(), np.array([0.0, 0.0, 0.5 * thick])
    if kind == "cylinder":
        radius = max(0.4 * extent, 4.0 * height)
        return cq.Workplane().cylinder(extent, radius).val(), np.array([-radius, 0.0, 0.0])
    if kind == "sphere":
        radius = max(0.6 * extent, 4.0 * height)
        return cq.Workplane().sphere(radius).val(), np.array([-radius, 0.0, 0.0])
    raise ValueError(f"host: expected one of {', '.join(HOSTS)}, got {kind!r}; choose one")


def host_from(path: Path) -> Any:
    """The solid of a STEP file. Raises ValueError where there is none, or several."""
    import cadquery as cq

    import cad_export as cx

    solids = cq.Shape.cast(cx.read_step(path)).Solids()
    if len(solids) != 1:
        raise ValueError(f"{path.name}: expected one solid to paste on, found {len(solids)}; export it alone")
    return solids[0]


def nearest_on(host: Any, place: Array) -> Array:
    """The place (3,) of a host that is nearest to another (BRepExtrema_DistShapeShape)."""
    import cadquery as cq
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape

    vertex = cq.Vertex.makeVertex(*map(float, place))
    found = BRepExtrema_DistShapeShape(vertex.wrapped, host.wrapped).PointOnShape2(1)
    return np.array([found.X(), found.Y(), found.Z()])


def direction_on(host: Any, at: Array, ridge: Ridge, turn: float) -> Array | None:
    """The direction (3,) of a ridge on the face at a place (3,): its own, turned by so many degrees.

    None, which leaves it to `cad_export.paste`, for no turn.
    """
    if not turn:
        return None
    import cadquery as cq

    from cad_export.face_base import direction_at

    place = cq.Vertex.makeVertex(*map(float, at))
    face = min(host.Faces(), key=lambda f: f.distance(place))
    along, normal = direction_at(face, ridge, at)
    angle = np.radians(turn)
    return np.asarray(np.cos(angle) * along + np.sin(angle) * np.cross(normal, along))


def pasted(ridge: Ridge, host: Any, at: Array, turn: float = 0.0) -> Part:
    """The ridge on the face of a host that is nearest to a place (3,), turned there by so many degrees.

    It has passed the fast certificate of `cad_export.paste`, not its search for self-intersections. Raises
    ValueError as that does.
    """
    import cad_export as cx

    report: dict[str, Any] = {}
    direction = direction_on(host, at, ridge, turn)
    solid = cx.paste(ridge, host, at=at, direction=direction, check=False, report=report)
    told = f"{report['volume_added']:+,.4g} mm3 by the ridge, {report['volume_expected']:+,.4g} expected"
    return Part(solid, *_triangles(solid, [face for face, _ in cx.carried_by(solid)]), told)


def bare(host: Any) -> Part:
    """A host without a ridge."""
    return Part(host, *_triangles(host, []), "")


def _triangles(solid: Any, grown: list[Any]) -> tuple[Array, Corners, Corners]:
    import cadquery as cq

    box = cq.BoundBox._fromTopoDS(solid.wrapped, optimal=False)
    tolerance, first = _FINE * box.DiagonalLength, 0
    places: list[Array] = []
    corners: tuple[list[Corners], list[Corners]] = ([], [])
    for face in solid.Faces():
        points, triangles = face.tessellate(tolerance, _BEND)
        places.append(np.array([p.toTuple() for p in points]).reshape(-1, 3))
        own = any(face.wrapped.IsSame(other) for other in grown)
        corners[own].append(np.array(triangles, dtype=np.int64).reshape(-1, 3) + first)
        first += len(points)
    empty = np.empty((0, 3), dtype=np.int64)
    host, ridge = (np.concatenate(c) if c else empty for c in corners)
    return np.concatenate(places), host, ridge
