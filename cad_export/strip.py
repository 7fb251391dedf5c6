"""What a strip of a face must hold before a ridge is set on it: no folds, no overlap, all on the face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.GCPnts import GCPnts_AbscissaPoint
from OCP.gp import gp_Pnt2d
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_EDGE, TopAbs_IN, TopAbs_ON, TopAbs_State, TopAbs_VERTEX
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape

from cad_export.host_surface import Host

Floats = NDArray[np.float64]

_STEP = 0.25  # of the strip's breadth, between samples along
_ACROSS = 9
_MOST = 800
_LEAST_SPEED = 0.02


class _Strip(Protocol):
    @property
    def host(self) -> Host: ...

    @property
    def length(self) -> float: ...

    @property
    def closed(self) -> bool: ...

    def breadth(self, s: Floats) -> Floats: ...

    def parameters(self, s: Floats, y: Floats) -> Floats: ...


@dataclass(frozen=True, eq=False)
class Samples:
    """A strip on a grid of n places along and m across: what tells whether a point lies in it."""

    s: Floats
    breadth: Floats
    y: Floats
    x: Floats
    points: Floats
    normal: Floats
    left: Floats
    ahead: Floats
    """(n, m, 3) square to left; its length is how far one goes along there for a step in s."""
    length: float
    closed: bool


def places_along(base: _Strip) -> Floats:
    """Arc lengths (n,) at which a base is looked at: between them the strip is nearly flat."""
    rough = base.breadth(np.linspace(0, base.length, 65)).min()
    n = int(np.clip(np.ceil(base.length / (_STEP * rough)), 16, _MOST)) + 1
    return np.linspace(0.0, base.length, n)


def check_seams(x: Floats, points: Floats, host: Host) -> None:
    """Raise ValueError where points at x (..., 2) are over a seam at which a surface closes without a period.

    Such surfaces, as those of a loft, are not evaluated beyond it: the strip would be squeezed flat there.
    """
    surface = BRep_Tool.Surface_s(host.face)
    u0, u1, v0, v1 = surface.Bounds()
    closed = (surface.IsUClosed(), surface.IsVClosed())
    for i, (low, high) in enumerate(((u0, u1), (v0, v1))):
        slack = 1e-9 * (high - low)
        beyond = (x[..., i] < low - slack) | (x[..., i] > high + slack)
        if closed[i] and not host.periods[i] and beyond.any():
            where = np.round(points[beyond][0], 4).tolist()
            raise ValueError(
                f"path: expected a strip clear of the seam at which the face closes, it runs over it near "
                f"{where}; move the path off the seam, or turn the host's sketch to move the seam"
            )


def samples_of(base: _Strip) -> Samples:
    """Samples of a base, at places_along it."""
    s = places_along(base)
    breadth = base.breadth(s)
    y = breadth[:, None] * np.linspace(-1, 1, _ACROSS)
    x = base.parameters(s, y)
    points, normal = base.host.frame(x[..., 0], x[..., 1])
    if not (np.isfinite(points).all() and np.isfinite(normal).all()):
        raise ValueError(
            "expected a strip that the face's surface has normals for; move it away from the surface's poles"
        )
    check_seams(x, points, base.host)
    across = np.gradient(points, axis=1)
    across -= normal * (across * normal).sum(axis=-1, keepdims=True)
    left = across / np.linalg.norm(across, axis=-1, keepdims=True)
    direction = np.cross(left, normal)
    steps = np.gradient(points, s, axis=0)
    ahead = direction * (steps * direction).sum(axis=-1, keepdims=True)
    return Samples(s, breadth, y, x, points, normal, left, ahead, base.length, base.closed)


class OffFaceError(ValueError):
    """The strip leaves the face over its outline."""


def check_strip(base: _Strip, samples: Samples | None = None, beyond: bool = False) -> None:
    """Raise ValueError where the strip folds, overlaps itself, or is not inside the face.

    beyond: whether it may leave the face over its outline, onto others; else that is an OffFaceError.
    """
    strip = samples_of(base) if samples is None else samples
    check_folds(strip)
    check_overlap(strip)
    try:
        check_inside(strip, base.host)
    except OffFaceError:
        if not beyond:
            raise


def speed_of(strip: Samples) -> Floats:
    """(n, m): how far one goes along at the samples for a step along the path; below 0 where it folds."""
    return np.asarray((strip.ahead * np.cross(strip.left, strip.normal)).sum(axis=-1), dtype=np.float64)


def check_folds(strip: Samples) -> None:
    """Raise ValueError where the path bends tighter than the strip is broad."""
    speed = speed_of(strip)
    i = int(speed.min(axis=1).argmin())
    if speed[i].min() < _LEAST_SPEED:
        raise ValueError(
            f"path: expected bends wider than half the strip's breadth, {strip.breadth[i]:.4g}, got a "
            f"tighter one at arc length {strip.s[i]:.4g}; use a gentler path, or a smaller ridge by "
            'ridge.stretched(length, fit="scale")'
        )


def check_overlap(strip: Samples) -> None:
    """Raise ValueError where a border of the strip lies in another part of it."""
    away = 2.5 * float(strip.breadth.max())
    for column in (0, -1):
        found = inside(strip, strip.points[:, column], strip.s, away)
        if found.any():
            at = strip.s[int(found.argmax())]
            raise ValueError(
                f"path: expected a strip that keeps clear of itself, it overlaps at arc length {at:.4g}; "
                "spread the path, or use a smaller ridge"
            )


def inside(strip: Samples, points: Floats, own: Floats | None = None, away: float = 0.0) -> NDArray[np.bool_]:
    """(q,) whether points (q, 3) lie in the strip; given their own s (q,), in a part `away` from there."""
    flat = {k: getattr(strip, k).reshape(-1, 3) for k in ("points", "normal", "left", "ahead")}
    s, y = np.repeat(strip.s, _ACROSS), strip.y.ravel()
    breadth = np.repeat(strip.breadth, _ACROSS)
    reach = 1.5 * max(strip.length / (len(strip.s) - 1), 2 * strip.breadth.max() / (_ACROSS - 1))
    found = np.zeros(len(points), dtype=bool)
    for start in range(0, len(points), 256):
        part = slice(start, start + 256)
        square = ((points[part, None] - flat["points"]) ** 2).sum(axis=-1)
        if own is not None:
            gap = np.abs(own[part, None] - s)
            gap = np.minimum(gap, strip.length - gap) if strip.closed else gap
            square = np.where(gap > away, square, np.inf)
        i = square.argmin(axis=1)
        d = points[part] - flat["points"][i]
        ahead = flat["ahead"][i]
        along = s[i] + (d * ahead).sum(axis=1) / (ahead * ahead).sum(axis=1)
        aside = np.abs(y[i] + (d * flat["left"][i]).sum(axis=1))
        ends = np.ones_like(aside, dtype=bool) if strip.closed else (along > 0) & (along < strip.length)
        found[part] = (square[np.arange(len(i)), i] < reach * reach) & (aside < breadth[i]) & ends
    return found


def check_inside(strip: Samples, host: Host) -> None:
    """Raise ValueError where the strip's border is off the face, or an edge or a pole lies in the strip."""
    edges, outer, poles = edge_points(host.face, _STEP * float(strip.breadth.min()))
    if len(poles) and inside(strip, poles).any():
        raise ValueError(
            "expected a strip clear of the surface's poles, it runs over one; move it away from the pole"
        )
    border = np.concatenate([strip.x[:, 0], strip.x[::-1, -1]])
    if not strip.closed:
        border = np.concatenate([border, strip.x[0], strip.x[-1]])
    out = ~in_face(host.face, border)
    if out.any():
        p = host.points(border[out][:1, 0], border[out][:1, 1])[0]
        hole = len(edges) > 0 and not outer[((edges - p) ** 2).sum(axis=1).argmin()]
    else:
        within = inside(strip, edges) if len(edges) else np.zeros(0, dtype=bool)
        if not within.any():
            return
        p, hole = edges[within.argmax()], not outer[within.argmax()]
    where = np.round(p, 4).tolist()
    advice = "move it by at= or path=, turn it by direction=, or use a smaller ridge"
    if hole:
        clear = "clear of the face's holes and of ridges pasted before"
        raise ValueError(f"expected a strip {clear}, it meets one near {where}; {advice}")
    raise OffFaceError(f"expected a strip inside the face, it leaves the face near {where}; {advice}")


def in_face(face: TopoDS_Face, x: Floats) -> NDArray[np.bool_]:
    """(n,) whether parameters (n, 2), on whatever period, lie inside the face (BRepTopAdaptor_FClass2d)."""
    classifier = BRepTopAdaptor_FClass2d(face, 1e-9)
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    du, dv = 1e-6 * (u1 - u0), 1e-6 * (v1 - v0)

    def state(u: float, v: float) -> TopAbs_State:
        return classifier.Perform(gp_Pnt2d(u, v))

    def inner(u: float, v: float) -> bool:
        found = state(u, v)
        if found != TopAbs_ON:
            return bool(found == TopAbs_IN)
        # on the seam the face lies all around, on its border it does not
        return all(state(u + a, v + b) == TopAbs_IN for a in (-du, du) for b in (-dv, dv))

    return np.array([inner(u, v) for u, v in x.tolist()], dtype=bool)


def edge_points(face: TopoDS_Face, step: float) -> tuple[Floats, NDArray[np.bool_], Floats]:
    """Points (n, 3) on the face's edges about `step` apart, which are on its outer wire, poles (p, 3).

    Seams are left out: there the face goes on.
    """
    outer_wire = BRepTools.OuterWire_s(face)
    points, outer, poles = [np.empty((0, 3))], [np.empty(0, dtype=bool)], [np.empty((0, 3))]
    for shape in _all(face, TopAbs_EDGE):
        edge = TopoDS.Edge_s(shape)
        if BRep_Tool.Degenerated_s(edge):
            corners = [BRep_Tool.Pnt_s(TopoDS.Vertex_s(v)) for v in _all(edge, TopAbs_VERTEX)]
            poles += [np.array([[p.X(), p.Y(), p.Z()]]) for p in corners]
            continue
        if BRep_Tool.IsClosed_s(edge, face):
            continue
        curve = BRepAdaptor_Curve(edge)
        n = int(np.clip(GCPnts_AbscissaPoint.Length_s(curve, 1e-3) / step, 8, 2000)) + 1
        places = [
            curve.Value(t) for t in np.linspace(curve.FirstParameter(), curve.LastParameter(), n).tolist()
        ]
        points.append(np.array([(p.X(), p.Y(), p.Z()) for p in places]))
        outer.append(np.full(n, any(edge.IsSame(other) for other in _all(outer_wire, TopAbs_EDGE))))
    return np.concatenate(points), np.concatenate(outer), np.concatenate(poles)


def inner_point(host: Host) -> Floats:
    """Parameters (2,) of the point inside the face nearest to its centre of area.

    Of several, as on a tube, the one in the middle of the parameters. On a grid of 21 by 21; where it lies
    inside the face, the foot of the centre itself.
    """
    face, properties = host.face, GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, properties)
    c = properties.CentreOfMass()
    centre = np.array([c.X(), c.Y(), c.Z()])
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    parts = (np.arange(21) + 0.5) / 21
    grid = np.stack(np.meshgrid(u0 + (u1 - u0) * parts, v0 + (v1 - v0) * parts, indexing="ij"), axis=-1)
    grid = grid.reshape(-1, 2)
    grid = grid[in_face(face, grid)]
    if not len(grid):
        raise ValueError("face: expected one with room for a ridge, found none; choose another or give at=")
    far = np.linalg.norm(host.points(grid[:, 0], grid[:, 1]) - centre, axis=1)
    off = np.abs((grid - [0.5 * (u0 + u1), 0.5 * (v0 + v1)]) / [u1 - u0, v1 - v0]).max(axis=1)
    size = np.ptp(host.points(grid[:, 0], grid[:, 1]), axis=0).max()
    best = grid[np.lexsort((off, np.round(far / (1e-6 * size + 1e-300))))[0]]
    with np.errstate(all="ignore"):
        foot = host.foot(centre[None], best[None])
    if np.isfinite(foot).all() and in_face(face, foot)[0]:
        gap = np.linalg.norm(host.points(foot[:, 0], foot[:, 1])[0] - centre)
        best = foot[0] if gap < far.min() * (1 - 1e-6) else best
    return np.asarray(best, dtype=np.float64)


def longer_direction(host: Host, place: Floats) -> Floats:
    """(3,) the parametric direction along which the face is longer, at parameters (2,)."""
    u0, u1, v0, v1 = BRepTools.UVBounds_s(host.face)
    t = np.linspace(0, 1, 65)
    along_u = host.points(u0 + (u1 - u0) * t, place[1] + 0 * t)
    along_v = host.points(place[0] + 0 * t, v0 + (v1 - v0) * t)
    lengths = [np.linalg.norm(np.diff(p, axis=0), axis=1).sum() for p in (along_u, along_v)]
    return host.jet(place[0], place[1], 1)[1 if lengths[0] >= lengths[1] else 2]


def _all(shape: TopoDS_Shape, kind: object) -> list[TopoDS_Shape]:
    explorer, found = TopExp_Explorer(shape, kind), []
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found
