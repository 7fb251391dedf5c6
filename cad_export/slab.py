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
from ridgefeature.bspline import Surface, basis_matrix, greville, interpolate

_ACROSS = np.array([0.0, 0.0, 1.0, 1.0])  # knots of a ruled side from border to border


def make_slab(top: Surface, base: Surface, thickness: float, check: bool = True) -> TopoDS_Solid:
    """The solid from `top` down to a lower face `thickness` below `base`, each row along its own normal.

    `base` has the knots of `top`; down is against its normal du x dv. Lengths in the surface's unit. With
    check=False the search for faces that cross each other is left out. Raises ValueError when the thickness
    is not positive, the lower face folds or the top runs through it, or the solid fails its checks.
    """
    if not (np.isfinite(thickness) and thickness > 0):
        raise ValueError(f"expected a thickness above 0, got {thickness!r}; the slab lies below the surface")
    if not (np.array_equal(top.knots_u, base.knots_u) and np.array_equal(top.knots_v, base.knots_v)):
        raise ValueError("expected a base with the knots of the surface; make both from the same stations")
    up = _up(base)
    low = replace(base, poles=base.poles - thickness * up[:, None])
    _check_gap(top, low, up, thickness)
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
    check_solid(solid, volume, crossings=check)
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


def _check_gap(top: Surface, low: Surface, up: NDArray[np.float64], thickness: float) -> None:
    """Raise ValueError where the lower face folds over or reaches the top, on four samples a span."""
    (u0, u1), (v0, v1) = top.domain
    inside = 1e-6 * (u1 - u0)
    u = np.linspace(u0 + inside, u1 - inside, 4 * top.poles.shape[0])
    v = np.linspace(v0, v1, 4 * top.poles.shape[1])
    rows = basis_matrix(top.knots_u, top.degree_u, u) @ up
    gap = np.einsum("mkd,md->mk", top.on_grid(u, v) - low.on_grid(u, v), rows).min()
    if gap <= 0:
        raise ValueError(
            f"expected a thickness above {thickness - gap:.4g}, the depth of the surface, got {thickness:g}"
        )
    if np.einsum("mkd,md->mk", low.normal(u[:, None], v), rows).min() <= 0:
        raise ValueError(
            f"expected a thickness below the base's radius of curvature, got {thickness:g}; go thinner"
        )


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
