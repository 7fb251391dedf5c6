"""The surface under a host face, evaluated at many places at once: points, derivatives, outward normals.

OCP only, no cadquery. Planes and surfaces of revolution that OCCT has by name are evaluated in closed form,
non-rational B-splines by their poles; all others place by place by BRepAdaptor_Surface.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import factorial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from OCP.Adaptor3d import Adaptor3d_Surface
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.GeomAbs import (
    GeomAbs_BSplineSurface,
    GeomAbs_Cone,
    GeomAbs_Cylinder,
    GeomAbs_Plane,
    GeomAbs_Sphere,
    GeomAbs_Torus,
)
from OCP.gp import gp_Ax3, gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Face

from cad_export.geometry import from_occt
from ridgefeature.bspline import Surface

Floats = NDArray[np.float64]
Jet = tuple[Floats, ...]
"""Points and derivatives P, Pu, Pv, Puu, Puv, Pvv, each (..., 3)."""


class Evaluator(Protocol):
    """Points and derivatives at parameters of one shape; order 1: at least those up to Pv."""

    def __call__(self, u: Floats, v: Floats, order: int = 2) -> Jet: ...


@dataclass(frozen=True, eq=False)
class Host:
    """The surface under a face; u and v may run over its seams and on beyond them."""

    face: TopoDS_Face
    jet: Evaluator
    periods: tuple[float, float]
    """Length of the parameter range along u and v where the surface closes on itself, else 0."""
    outward: float
    """1 where the face's outward normal is du x dv, else -1."""
    straight: bool = False
    """Whether geodesics are straight lines in u and v, as on planes and cylinders."""

    def points(self, u: Floats, v: Floats) -> Floats:
        """Points (..., 3)."""
        return self.jet(u, v, 1)[0]

    def frame(self, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Points and outward unit normals (..., 3)."""
        p, pu, pv = self.jet(u, v, 1)[:3]
        return p, self.normal(pu, pv)

    def normal(self, pu: Floats, pv: Floats) -> Floats:
        """Outward unit normals for derivatives (..., 3)."""
        cross = _cross(pu, pv)
        length = np.sqrt(dot(cross, cross))
        return cross * (self.outward / np.where(length > 0, length, np.nan))[..., None]

    def parameters(self, vector: Floats, pu: Floats, pv: Floats) -> Floats:
        """(..., 2): the rates of u and v at which one moves by `vector` (..., 3), as far as it is tangent."""
        e, f, g = dot(pu, pu), dot(pu, pv), dot(pv, pv)
        a, b = dot(vector, pu), dot(vector, pv)
        det = e * g - f * f
        return np.stack([a * g - b * f, b * e - a * f], axis=-1) / det[..., None]

    def left(self, rate: Floats, pu: Floats, pv: Floats) -> Floats:
        """(..., 2): rates of u and v square to rates (..., 2), to their left with the normal upwards."""
        e, f, g = dot(pu, pu), dot(pu, pv), dot(pv, pv)
        a, b = rate[..., 0], rate[..., 1]
        size = self.outward / np.sqrt(e * g - f * f)
        return np.stack([-(f * a + g * b) * size, (e * a + f * b) * size], axis=-1)

    def foot(self, points: Floats, start: Floats) -> Floats:
        """Parameters (..., 2) of the foot points of points (..., 3), by Newton steps from start (..., 2)."""
        x = np.array(start, dtype=np.float64)
        for _ in range(30):
            p, pu, pv, puu, puv, pvv = self.jet(x[..., 0], x[..., 1])
            gap = points - p
            a, b = dot(gap, pu), dot(gap, pv)
            e, f, g = dot(pu, pu) - dot(gap, puu), dot(pu, pv) - dot(gap, puv), dot(pv, pv) - dot(gap, pvv)
            step = np.stack([a * g - b * f, b * e - a * f], axis=-1) / (e * g - f * f)[..., None]
            x += step
            size = np.linalg.norm(step[..., :1] * pu + step[..., 1:] * pv, axis=-1)
            if not np.max(size) > 1e-13 * (1 + np.abs(p).max()):
                break
        return x


def dot(a: Floats, b: Floats) -> Floats:
    """Scalar products (...) of vectors (..., 3); faster than a sum over so short an axis."""
    return np.asarray(np.einsum("...i,...i->...", a, b))


def _cross(a: Floats, b: Floats) -> Floats:
    """Vector products (..., 3), by coordinates: three times as fast as np.cross for many."""
    (ax, ay, az), (bx, by, bz) = (np.ascontiguousarray(c.reshape(-1, 3).T) for c in (a, b))
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]).T.reshape(a.shape)


def host_of(face: TopoDS_Face) -> Host:
    """The surface under a face, placed by the face's location."""
    adaptor = BRepAdaptor_Surface(face, False)
    kind = adaptor.GetType()
    periods = (
        float(adaptor.UPeriod()) if adaptor.IsUPeriodic() else 0.0,
        float(adaptor.VPeriod()) if adaptor.IsVPeriodic() else 0.0,
    )
    outward = -1.0 if face.Orientation() == TopAbs_REVERSED else 1.0
    rational = adaptor.IsURational() or adaptor.IsVRational()
    by_poles = _spline(adaptor, periods) if kind == GeomAbs_BSplineSurface and not rational else None
    jet = elementary(adaptor) or by_poles or _one_by_one(adaptor)
    return Host(face, jet, periods, outward, straight=kind in (GeomAbs_Plane, GeomAbs_Cylinder))


def elementary(adaptor: Adaptor3d_Surface) -> Evaluator | None:
    """A plane or a surface of revolution that OCCT has by name, in closed form; None for others."""
    kind = adaptor.GetType()
    if kind == GeomAbs_Plane:
        return _plane(_axes(adaptor.Plane().Position()))
    if kind == GeomAbs_Cylinder:
        form = adaptor.Cylinder()
        radius = form.Radius()
        return _revolved(
            _axes(form.Position()), lambda v: (radius + 0 * v, 0 * v, 0 * v, v, 1 + 0 * v, 0 * v)
        )
    if kind == GeomAbs_Cone:
        form = adaptor.Cone()
        radius, sin, cos = form.RefRadius(), np.sin(form.SemiAngle()), np.cos(form.SemiAngle())
        return _revolved(
            _axes(form.Position()),
            lambda v: (radius + v * sin, sin + 0 * v, 0 * v, v * cos, cos + 0 * v, 0 * v),
        )
    if kind in (GeomAbs_Sphere, GeomAbs_Torus):
        form = adaptor.Sphere() if kind == GeomAbs_Sphere else adaptor.Torus()
        large = 0.0 if kind == GeomAbs_Sphere else form.MajorRadius()
        return _revolved(_axes(form.Position()), _circle(large, _small_radius(form)))
    return None


def _small_radius(form: Any) -> float:
    return float(form.MinorRadius() if hasattr(form, "MinorRadius") else form.Radius())


def _axes(position: gp_Ax3) -> Floats:
    """Rows (4, 3): origin, x, y and z of a placement, which may be left-handed."""
    places = (position.Location(), position.XDirection(), position.YDirection(), position.Direction())
    return np.array([(a.X(), a.Y(), a.Z()) for a in places])


def _plane(axes: Floats) -> Evaluator:
    def jet(u: Floats, v: Floats, order: int = 2) -> Jet:
        points = axes[0] + u[..., None] * axes[1] + v[..., None] * axes[2]
        zero = np.zeros_like(points)
        return points, zero + axes[1], zero + axes[2], zero, zero, zero

    return jet


def _circle(large: float, small: float) -> Callable[[Floats], Jet]:
    def meridian(v: Floats) -> Jet:
        c, s = small * np.cos(v), small * np.sin(v)
        return large + c, -s, -c, s, c, -s

    return meridian


def _revolved(axes: Floats, meridian: Callable[[Floats], Jet]) -> Evaluator:
    """r(v) (cos u x + sin u y) + z(v) z, for r, r', r'', z, z', z'' from the meridian."""

    turn = np.ascontiguousarray(axes[1:].T)

    def placed(*parts: Floats) -> Floats:
        # by coordinates, in memory too: twice as fast as point by point
        flat = turn @ np.array(parts).reshape(3, -1)
        return flat.T.reshape(*parts[0].shape, 3)

    def jet(u: Floats, v: Floats, order: int = 2) -> Jet:
        u, v = np.broadcast_arrays(u, v)
        cos, sin, none = np.cos(u), np.sin(u), 0.0 * u
        r, dr, ddr, z, dz, ddz = meridian(v)
        first = (
            axes[0] + placed(r * cos, r * sin, z),
            placed(-r * sin, r * cos, none),
            placed(dr * cos, dr * sin, dz),
        )
        if order == 1:
            return first
        return (
            *first,
            placed(-r * cos, -r * sin, none),
            placed(-dr * sin, dr * cos, none),
            placed(ddr * cos, ddr * sin, ddz),
        )

    return jet


def _spline(adaptor: BRepAdaptor_Surface, periods: tuple[float, float]) -> Evaluator:
    """By the coefficients of every patch in powers: quicker than basis functions for few places at a time."""
    surface = from_occt(adaptor.BSpline())
    breaks, coefficients = _patches(surface)
    orders = tuple(np.arange(c) for c in coefficients.shape[2:4])

    def jet(u: Floats, v: Floats, order: int = 2) -> Jet:
        u, v = np.broadcast_arrays(u, v)
        spans, powers = [], []
        for t, period, edges, exponents in zip((u, v), periods, breaks, orders, strict=True):
            inside = edges[0] + np.mod(t - edges[0], period) if period else t
            # beyond the border there is no surface; what runs there is refused as off the face
            inside = np.clip(inside, edges[0], edges[-1])
            span = np.clip(np.searchsorted(edges, inside, side="right") - 1, 0, len(edges) - 2)
            spans.append(span)
            powers.append(_powers(inside - edges[span], exponents))
        near = coefficients[spans[0], spans[1]]
        rows = np.einsum("...dj,...ijx->...dix", powers[1], near)  # by derivatives of v
        along = powers[0]
        pairs = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))[: 3 if order == 1 else 6]
        return tuple(np.einsum("...i,...ix->...x", along[..., a, :], rows[..., b, :, :]) for a, b in pairs)

    return jet


def _powers(t: Floats, order: NDArray[np.intp]) -> Floats:
    """(..., 3, n): 1, t, t^2, ... and their first two derivatives."""
    plain = t[..., None] ** order
    first = np.zeros_like(plain)
    first[..., 1:] = plain[..., :-1] * order[1:]
    second = np.zeros_like(plain)
    second[..., 1:] = first[..., :-1] * order[1:]
    return np.stack([plain, first, second], axis=-2)


def _patches(surface: Surface) -> tuple[tuple[Floats, Floats], Floats]:
    """Breaks along u and v, and coefficients (m, n, degree_u + 1, degree_v + 1, 3) of powers from each."""
    breaks = tuple(
        np.unique(knots[degree : len(knots) - degree])
        for knots, degree in ((surface.knots_u, surface.degree_u), (surface.knots_v, surface.degree_v))
    )
    terms = [
        [
            surface.on_grid(breaks[0][:-1], breaks[1][:-1], (i, j)) / (factorial(i) * factorial(j))
            for j in range(surface.degree_v + 1)
        ]
        for i in range(surface.degree_u + 1)
    ]
    return (breaks[0], breaks[1]), np.ascontiguousarray(np.array(terms).transpose(2, 3, 0, 1, 4))


def _one_by_one(adaptor: BRepAdaptor_Surface) -> Evaluator:
    """A call of OCCT for each place."""
    ends = (
        (adaptor.IsUPeriodic(), adaptor.FirstUParameter(), adaptor.LastUParameter()),
        (adaptor.IsVPeriodic(), adaptor.FirstVParameter(), adaptor.LastVParameter()),
    )
    limits = [(-np.inf, np.inf) if periodic else (low, high) for periodic, low, high in ends]
    p, d = gp_Pnt(), [gp_Vec() for _ in range(5)]

    def jet(u: Floats, v: Floats, order: int = 2) -> Jet:
        evaluate, rates = (adaptor.D1, d[:2]) if order == 1 else (adaptor.D2, d)
        found = (p, *rates) if order == 1 else (p, d[0], d[1], d[2], d[4], d[3])  # OCCT's order: uu, vv, uv
        uu, vv = np.broadcast_arrays(np.clip(u, *limits[0]), np.clip(v, *limits[1]))
        values: list[float] = []
        for a, b in zip(uu.ravel().tolist(), vv.ravel().tolist(), strict=True):
            evaluate(a, b, p, *rates)
            for x in found:
                values += (x.X(), x.Y(), x.Z())
        shaped = np.array(values).reshape(*uu.shape, len(found), 3)
        return tuple(shaped[..., j, :] for j in range(len(found)))

    return jet
