"""A slab under a surface: the surface itself, a lower face and ruled sides. OCP only, no cadquery.

All faces are B-splines built from the surface's own poles and knots, so neighbours share their borders
exactly and sewing has nothing to approximate.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeSolid, BRepBuilderAPI_Sewing
from OCP.BRepLib import BRepLib
from OCP.TopAbs import TopAbs_REVERSED, TopAbs_SHELL
from OCP.TopoDS import TopoDS, TopoDS_Solid

from cad_export.check import check_solid
from cad_export.geometry import DEGENERATE, make_face
from cad_export.mesh_crossings import crosses_itself, welded
from ridgefeature.bspline import Surface, basis_matrix, greville, interpolate

_SAMPLES = (200, 40)
"""Most samples along and across in which faces that cross are looked for."""
_BISECTIONS = 6
"""Thicknesses tried to tell one that goes."""
_ACROSS = np.array([0.0, 0.0, 1.0, 1.0])  # knots of a ruled side from border to border


def make_slab(top: Surface, base: Surface, thickness: float, check: bool = True) -> TopoDS_Solid:
    """The solid from `top` down to a lower face `thickness` below `base`, each row along its own normal.

    `base` has the knots of `top`; down is against its normal du x dv. Lengths in the surface's unit. With
    check=False the search for faces that cross each other, on samples, is left out. Raises ValueError when
    the thickness is not positive, the lower face folds or the top runs through it, each with the thickness
    that goes, or the solid fails its checks.
    """
    if not (np.isfinite(thickness) and thickness > 0):
        raise ValueError(f"expected a thickness above 0, got {thickness!r}; the slab lies below the surface")
    if not (np.array_equal(top.knots_u, base.knots_u) and np.array_equal(top.knots_v, base.knots_v)):
        raise ValueError("expected a base with the knots of the surface; make both from the same stations")
    up = _up(base)
    _check_thickness(thickness, *thickness_range(top, base))
    low = replace(base, poles=base.poles - thickness * up[:, None])
    if check:
        _check_crossings(top, base, up, thickness)
    sides = _sides(top, low)
    volume = top.flux() - low.flux() + sum(side.flux() for side in sides)
    sewing = BRepBuilderAPI_Sewing(DEGENERATE * 10)
    sewing.Add(make_face(top))
    sewing.Add(make_face(low).Reversed())
    for side in sides:
        sewing.Add(make_face(side))
    sewing.Perform()
    shell = sewing.SewedShape()
    if shell.IsNull() or shell.ShapeType() != TopAbs_SHELL or sewing.NbFreeEdges() > 0:
        raise ValueError(
            "expected borders that close into one shell; check that the surface does not touch itself"
        )
    shell.Closed(BRep_Tool.IsClosed_s(shell))  # sewing leaves the flag out where a border is a point
    solid = BRepBuilderAPI_MakeSolid(TopoDS.Shell_s(shell)).Solid()
    BRepLib.OrientClosedSolid_s(solid)
    if (
        solid.Orientation() == TopAbs_REVERSED
    ):  # turn the shell instead: some readers drop a solid's orientation
        solid = BRepBuilderAPI_MakeSolid(TopoDS.Shell_s(shell.Reversed())).Solid()
    check_solid(solid, volume, crossings=False)
    return solid


def _up(base: Surface) -> NDArray[np.float64]:
    """Poles (nu, 3) of the rows' mean unit normals, as a spline along u."""
    (u0, u1), _ = base.domain
    inside = 1e-6 * (u1 - u0)  # an end may be a point, which has no normal
    u = np.clip(greville(base.knots_u, base.degree_u), u0 + inside, u1 - inside)
    rows = base.normal(u[:, None], greville(base.knots_v, base.degree_v)).mean(axis=1)
    if base.closed[0]:
        rows[[0, -1]] = rows[0] + rows[-1]
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    if not np.all(length > 1e-3):
        raise ValueError(
            "expected a base with a normal in every row, got a collapsed or wrapped one; shorten it"
        )
    return interpolate(base.knots_u, base.degree_u, rows / length)


def thickness_range(top: Surface, base: Surface) -> tuple[float, float, float]:
    """Above which thickness the top is clear of the lower face, below which that does not fold, and where.

    The lower face is base - t up(u), so both are linear in t at every place: four samples a span tell them.
    The last value is the parameter u of the place that folds first.
    """
    (u0, u1), (v0, v1) = base.domain
    inside = 1e-6 * (u1 - u0)
    u = np.linspace(u0 + inside, u1 - inside, 4 * base.poles.shape[0])
    v = np.linspace(v0, v1, 4 * base.poles.shape[1])
    up = _up(base)
    rows, turn = (basis_matrix(base.knots_u, base.degree_u, u, order) @ up for order in (0, 1))
    depth = -float(np.einsum("mkd,md->mk", top.on_grid(u, v) - base.on_grid(u, v), rows).min())
    along, across = base.on_grid(u, v, (1, 0)), base.on_grid(u, v, (0, 1))
    area = np.einsum("mkd,md->mk", np.cross(along, across), rows)
    loss = np.einsum("mkd,md->mk", np.cross(turn[:, None], across), rows)
    with np.errstate(divide="ignore", invalid="ignore"):
        folds = np.where(loss > 0, area / loss, np.where(area > 0, np.inf, 0.0)).min(axis=1)
    return max(0.0, depth), float(folds.min()), float(u[folds.argmin()])


def _check_thickness(thickness: float, least: float, most: float, where: float) -> None:
    """Raise ValueError unless the thickness is within its range."""
    if least < thickness < most:
        return
    shorter = 'take a stretch of the ridge by ridge.stretched(length, "trim")'
    place = f"at arc length {where:.3f}"
    if most <= 0:
        raise ValueError(
            f"expected a base that does not fold, got one that does {place}, where the path bends more "
            f"sharply than the flanks are broad: no thickness goes; {shorter}, or register with a smaller "
            "border"
        )
    if most <= least:
        raise ValueError(
            f"thickness: none goes: expected one above {least:.4g}, the depth of the surface, and below "
            f"{most:.4g}, the base's radius of curvature {place}; {shorter}, or an h nearer to 0"
        )
    most = most * (1 - 1e-3)
    if thickness <= least:
        below = f" and below {most:.4g}" if np.isfinite(most) else ""
        raise ValueError(
            f"expected a thickness above {least:.4g}, the depth of the surface{below}, got {thickness:g}"
        )
    raise ValueError(
        f"expected a thickness of at most {most:.4g}, within the base's radius of curvature {place}, got "
        f"{thickness:g}; go thinner, or {shorter}"
    )


def _check_crossings(top: Surface, base: Surface, up: NDArray[np.float64], thickness: float) -> None:
    """Raise ValueError where the slab runs through itself, with the largest thickness found that does not."""

    def crosses(t: float) -> bool:
        return crosses_itself(*_mesh(top, replace(base, poles=base.poles - t * up[:, None])))

    if not crosses(thickness):
        return
    good, bad = thickness_range(top, base)[0], thickness
    lowest = good
    for _ in range(_BISECTIONS):
        middle = 0.5 * (good + bad)
        good, bad = (good, middle) if crosses(middle) else (middle, bad)
    which = f"one of at most {good:.4g} has none" if good > lowest else "thinner ones have some too"
    raise ValueError(
        f"expected a solid without self-intersections, got a thickness of {thickness:g}; {which}, or take a "
        'stretch of the ridge by ridge.stretched(length, "trim")'
    )


def _mesh(top: Surface, low: Surface) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices and triangles of the slab: up to two samples a span, on its sides about as high as long."""
    (u0, u1), (v0, v1) = top.domain
    rows, columns = (min(2 * n, most) for n, most in zip(top.poles.shape, _SAMPLES, strict=False))
    u, v = np.linspace(u0, u1, rows), np.linspace(v0, v1, columns)
    above, below = top.on_grid(u, v), low.on_grid(u, v)
    broad = float(np.median(np.linalg.norm(np.diff(above, axis=0), axis=-1)))
    high = float(np.linalg.norm(above[:, 0] - below[:, 0], axis=-1).max())
    part = np.linspace(0, 1, int(np.clip(high / max(broad, 1e-300), 1, 40)) + 1)[:, None, None]
    sides = []
    if not top.closed[0]:
        sides += [above[None, i] * (1 - part) + below[None, i] * part for i in (0, -1)]
    if not top.closed[1]:
        sides += [above[None, :, k] * (1 - part) + below[None, :, k] * part for k in (0, -1)]
    return welded([above, below, *sides])


def _sides(top: Surface, low: Surface) -> list[Surface]:
    """Ruled faces from border to border, normals outwards; none along a seam or at a point."""
    p, q = top.poles, low.poles
    along, across = (top.knots_u, top.degree_u), (top.knots_v, top.degree_v)
    pairs = []
    if not top.closed[0]:
        pairs += [(p[0], q[0], across), (q[-1], p[-1], across)]
    if not top.closed[1]:
        pairs += [(q[:, 0], p[:, 0], along), (p[:, -1], q[:, -1], along)]
    return [
        Surface(np.stack([a, b], axis=1), knots, _ACROSS, degree, 1)
        for a, b, (knots, degree) in pairs
        if np.ptp(a, axis=0).max() > DEGENERATE
    ]
