"""Paths on a host face: a ridge's own path developed onto it, or an edge or wire projected to it.

OCP only, no cadquery. Curves on the surface obey x'' = -S + k L in its parameters: S the acceleration that
the parametrisation brings, k the geodesic curvature, L the unit vector to the left (do Carmo, Differential
Geometry of Curves and Surfaces, 4-4); integrated by the classical Runge-Kutta method.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepTools import BRepTools_WireExplorer
from OCP.gp import gp_Pnt, gp_Vec
from OCP.ShapeAnalysis import ShapeAnalysis_Surface
from OCP.TopAbs import TopAbs_EDGE, TopAbs_REVERSED, TopAbs_WIRE
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape
from scipy.interpolate import CubicSpline

from cad_export.geometry import DEGENERATE, topods
from cad_export.host_surface import Host
from ridgefeature.base import geodesic_curvature
from ridgefeature.stations import Stations

Floats = NDArray[np.float64]

CORNER = 1e-3
"""Radians by which a path may turn where two edges meet."""
_PER_EDGE = 257
_CLOSE = 1e-8
_MOST_PARTS = 64


@dataclass(frozen=True, eq=False)
class FacePath:
    """A curve on a face by arc length: parameters with two derivatives at nodes, quintic Hermite between.

    s (n,) ascending from 0; x, rate (n, 2); bend_start, bend_end (n - 1, 2), for curvature may jump at nodes.
    """

    s: Floats
    x: Floats
    rate: Floats
    bend_start: Floats
    bend_end: Floats
    length: float
    closed: bool = False

    def __call__(self, s: Floats) -> tuple[Floats, Floats]:
        """Parameters and their rates (k, 2) at arc lengths (k,)."""
        i = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        h = (self.s[i + 1] - self.s[i])[:, None]
        t = (np.asarray(s) - self.s[i])[:, None] / h
        a, b, c = self.x[i], self.rate[i] * h, 0.5 * self.bend_start[i] * h * h
        d = self.x[i + 1] - a - b - c
        e = self.rate[i + 1] * h - b - 2 * c
        f = self.bend_end[i] * h * h - 2 * c
        p, q, r = 10 * d - 4 * e + 0.5 * f, -15 * d + 7 * e - f, 6 * d - 3 * e + 0.5 * f
        x = a + t * (b + t * (c + t * (p + t * (q + t * r))))
        rate = b + t * (2 * c + t * (3 * p + t * (4 * q + t * 5 * r)))
        return x, rate / h

    def cut(self, length: float) -> FacePath:
        """Its first part of that arc length."""
        whole = length >= self.length * (1 - 1e-9)
        return self if whole else replace(self, length=length, closed=False)


def acceleration(host: Host, x: Floats, rate: Floats, curvature: Any = 0.0) -> Floats:
    """(m, 2): second derivatives of the parameters along curves of that geodesic curvature (m,)."""
    _, pu, pv, puu, puv, pvv = host.jet(x[:, 0], x[:, 1])
    a, b = rate[:, :1], rate[:, 1:]
    if host.straight:
        return np.asarray(curvature)[..., None] * host.left(rate, pu, pv)
    straight = host.parameters(-(a * a * puu + 2 * a * b * puv + b * b * pvv), pu, pv)
    return (
        straight + np.asarray(curvature)[..., None] * host.left(rate, pu, pv)
        if np.any(curvature)
        else straight
    )


def follow(
    host: Host, x: Floats, rate: Floats, steps: Floats, curvature: Floats | None = None
) -> tuple[Floats, Floats]:
    """Curves from x (m, 2) with unit speed `rate` (m, 2): both (n + 1, m, 2) after steps (n, m).

    curvature (2 n + 1, m): geodesic curvature at the steps' ends and middles; by default geodesics.
    """
    xs, rates = [x], [rate]
    for j, step in enumerate(steps):
        h = step[:, None]
        k0, k1, k2 = (0.0, 0.0, 0.0) if curvature is None else curvature[2 * j : 2 * j + 3]
        a0 = acceleration(host, x, rate, k0)
        r1 = rate + 0.5 * h * a0
        a1 = acceleration(host, x + 0.5 * h * rate, r1, k1)
        r2 = rate + 0.5 * h * a1
        a2 = acceleration(host, x + 0.5 * h * r1, r2, k1)
        r3 = rate + h * a2
        a3 = acceleration(host, x + h * r2, r3, k2)
        x = x + h / 6 * (rate + 2 * r1 + 2 * r2 + r3)
        rate = rate + h / 6 * (a0 + 2 * a1 + 2 * a2 + a3)
        xs.append(x)
        rates.append(rate)
    return np.array(xs), np.array(rates)


def moved(host: Host, a: Floats, b: Floats) -> float:
    """Largest distance between the points at parameters a and b (..., 2); inf where one is not finite."""
    gap = host.points(a[..., 0], a[..., 1]) - host.points(b[..., 0], b[..., 1])
    largest = float(np.abs(gap).max())
    return largest if np.isfinite(largest) else np.inf


def settled(host: Host, x: Floats, before: Floats | None, size: float, round_: int) -> bool:
    """Whether halved steps left the points (..., 2) where they were, to 1e-8 of a size.

    Where a surface is only C2, halving gains less than it should; from the third time on 1e-6 will do:
    places along the surface are meant, points lie on it in any case.
    """
    if before is None:
        return False
    return moved(host, x, before) <= size * (15 * _CLOSE if round_ < 2 else 100 * _CLOSE)


def developed_path(host: Host, ridge: Stations, at: Floats, tangent: Floats) -> FacePath:
    """The ridge's path by its geodesic curvature, its middle at parameters `at` (2,) along `tangent` (3,).

    Raises ValueError where the integration does not settle to 1e-8 of the width, as near a pole.
    """
    half, width = 0.5 * float(ridge.arc_length[-1]), float(np.median(ridge.width))
    _, pu, pv = host.jet(at[None, 0], at[None, 1], 1)[:3]
    rate = host.parameters(tangent / np.linalg.norm(tangent), pu, pv)
    start, rates = np.repeat(at[None], 2, axis=0), np.concatenate([rate, -rate])
    # curvature has kinks at the stations: steps end there, or the method would lose its order
    stations = len(ridge.arc_length) - 1
    n = stations // 2 if stations % 2 == 0 else stations
    n, before = n * max(1, int(np.ceil(half / (0.25 * width * n)))), None
    for _ in range(8):
        places = np.linspace(0.0, half, 2 * n + 1)
        turns = geodesic_curvature(ridge, np.concatenate([half - places[::-1], half + places[1:]]))
        # backwards, what lay to the left lies to the right
        curvature = np.stack([turns[2 * n :], -turns[2 * n :: -1]], axis=1)
        with np.errstate(all="ignore"):
            found = follow(host, start, rates, np.full((n, 2), half / n), curvature)
            if before is not None and moved(host, found[0][::2], before[0]) <= 100 * _CLOSE * width:
                break
        n, before = 2 * n, found
    else:
        raise ValueError(
            "expected a face on which the path can be followed, it does not settle; "
            "keep it away from poles and from creases of the surface"
        )
    # Richardson's extrapolation: halving the steps left a sixteenth of the error
    x, speed = (a[::2] + (a[::2] - b) / 15 for a, b in zip(found, before, strict=True))
    n, curvature = n // 2, curvature[::2]
    bend = np.stack([acceleration(host, x[:, i], speed[:, i], curvature[::2, i]) for i in (0, 1)], axis=1)
    forth = [a[:, 0] for a in (x, speed, bend)]
    back = [sign * a[:0:-1, 1] for a, sign in ((x, 1), (speed, -1), (bend, 1))]
    joined = [np.concatenate(pair) for pair in zip(back, forth, strict=True)]
    s = np.linspace(0.0, 2 * half, 2 * n + 1)
    return FacePath(s, joined[0], joined[1], joined[2][:-1], joined[2][1:], 2 * half)


def projected_path(host: Host, shape: Any, near: float, reverse: bool = False) -> FacePath:
    """An edge or a wire, projected to the face's surface, by arc length there.

    Raises ValueError for another shape, edges that are not connected or meet in a corner, a path farther than
    `near` from the surface, or one without length.
    """
    edges = _edges(topods(shape))
    pieces = [_piece(host, edge, near) for edge in edges]
    if reverse:
        pieces = [_turned(piece) for piece in reversed(pieces)]
    for before, after in pairwise(pieces):
        _shift(host, before, after)
        _check_corner(host, before, after)
    lengths = np.cumsum([0.0, *(piece["s"][-1] for piece in pieces)])
    if not lengths[-1] > 10 * DEGENERATE:
        raise ValueError(f"path: expected one with a length, got {lengths[-1]:g}; draw a longer one")
    s = np.concatenate([[0.0], *(p["s"][1:] + a for p, a in zip(pieces, lengths, strict=False))])
    x, rate = (np.concatenate([pieces[0][k][:1], *(p[k][1:] for p in pieces)]) for k in ("x", "rate"))
    starts, ends = (np.concatenate([p["bend"][a:b] for p in pieces]) for a, b in ((0, -1), (1, None)))
    first, last = (host.points(a[:1, 0], a[:1, 1]) for a in (x, x[-1:]))
    closed = bool(np.abs(first - last).max() <= max(1e-6, 1e-7 * lengths[-1]))
    if closed:
        _check_corner(host, pieces[-1], pieces[0])
    return FacePath(s, x, rate, starts, ends, float(lengths[-1]), closed)


def nearest(face: TopoDS_Face, host: Host, points: Floats) -> Floats:
    """Parameters (n, 2) of the points of the surface nearest to points (n, 3) along a line, unwrapped."""
    surface = ShapeAnalysis_Surface(BRep_Tool.Surface_s(face))
    found = [surface.ValueOfUV(gp_Pnt(*p), DEGENERATE) for p in points.tolist()]
    x = np.array([(f.X(), f.Y()) for f in found])
    for i, period in enumerate(host.periods):
        if period:
            x[:, i] = np.unwrap(x[:, i], period=period)
    with np.errstate(all="ignore"):
        better = host.foot(points, x)
    return np.where(np.isfinite(better).all(axis=1, keepdims=True), better, x)


def _edges(shape: TopoDS_Shape) -> list[TopoDS_Edge]:
    if shape.ShapeType() == TopAbs_EDGE:
        return [TopoDS.Edge_s(shape)]
    if shape.ShapeType() != TopAbs_WIRE:
        raise ValueError(f"path: expected an edge or a wire, got a {shape.ShapeType().name}; select one")
    wire, edges, count = BRepTools_WireExplorer(TopoDS.Wire_s(shape)), [], 0
    while wire.More():
        edges.append(wire.Current())
        wire.Next()
    every = TopExp_Explorer(shape, TopAbs_EDGE)
    while every.More():
        count += 1
        every.Next()
    if len(edges) != count or not edges:
        raise ValueError(
            f"path: expected a wire whose edges are connected in one line, got {count} edges of which "
            f"{len(edges)} are; join them by cq.Wire.assembleEdges or cq.Wire.combine"
        )
    return edges


def _piece(host: Host, edge: TopoDS_Edge, near: float) -> dict[str, Floats]:
    """Nodes of one edge: s from 0, parameters x, and their first two derivatives by arc length."""
    curve = BRepAdaptor_Curve(edge)
    t = np.linspace(curve.FirstParameter(), curve.LastParameter(), _PER_EDGE)
    p, d = gp_Pnt(), gp_Vec()
    jets = np.empty((t.size, 2, 3))
    for i, a in enumerate(t.tolist()):
        curve.D1(a, p, d)
        jets[i] = (p.X(), p.Y(), p.Z()), (d.X(), d.Y(), d.Z())
    points, speeds = jets[:, 0], jets[:, 1]
    if not np.isfinite(jets).all() or not np.abs(np.diff(points, axis=0)).max() > 1e-9:
        raise ValueError("path: expected edges with a length, got one without; draw a longer one")
    x = nearest(host.face, host, points)
    gap = np.linalg.norm(host.points(x[:, 0], x[:, 1]) - points, axis=1)
    if not gap.max() <= near:
        raise ValueError(
            f"path: expected one within {near:g} of the face, a quarter of the ridge's width, got "
            f"{gap.max():g}; draw it on the face or choose another face"
        )
    ends = host.jet(x[[0, -1], 0], x[[0, -1], 1])
    rates = host.parameters(speeds[[0, -1]], ends[1], ends[2])
    spline = CubicSpline(t, x, bc_type=((1, rates[0]), (1, rates[1])))
    piece = _by_arc_length(host, t, spline)
    return _turned(piece) if edge.Orientation() == TopAbs_REVERSED else piece


def _by_arc_length(host: Host, t: Floats, spline: CubicSpline) -> dict[str, Floats]:
    nodes, weights = np.polynomial.legendre.leggauss(5)
    inner = t[:-1, None] + 0.5 * np.diff(t)[:, None] * (1 + nodes)
    at, rate = spline(inner), spline(inner, 1)
    _, pu, pv = host.jet(at[..., 0], at[..., 1], 1)[:3]
    speed = np.linalg.norm(rate[..., :1] * pu + rate[..., 1:] * pv, axis=-1)
    s = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * (speed @ weights))])
    x, rate, bend = (spline(t, i) for i in range(3))
    _, pu, pv, puu, puv, pvv = host.jet(x[:, 0], x[:, 1])
    a, b = rate[:, :1], rate[:, 1:]
    first = a * pu + b * pv
    second = a * a * puu + 2 * a * b * puv + b * b * pvv + bend[:, :1] * pu + bend[:, 1:] * pv
    square = (first * first).sum(axis=1, keepdims=True)
    if not square.min() > 0:
        raise ValueError("path: expected a smooth edge, got one that stands still; draw it anew")
    bend = (bend - rate * (first * second).sum(axis=1, keepdims=True) / square) / square
    return {"s": s, "x": x, "rate": rate / np.sqrt(square), "bend": bend}


def _turned(piece: dict[str, Floats]) -> dict[str, Floats]:
    s, x, rate, bend = (piece[k][::-1] for k in ("s", "x", "rate", "bend"))
    return {"s": s[0] - s, "x": x, "rate": -rate, "bend": bend}


def _shift(host: Host, before: dict[str, Floats], after: dict[str, Floats]) -> None:
    """Move a piece by whole periods so that it goes on where the one before ends."""
    for i, period in enumerate(host.periods):
        if period:
            turns = np.round((before["x"][-1, i] - after["x"][0, i]) / period)
            after["x"] = after["x"] + turns * period * np.eye(2)[i]


def _check_corner(host: Host, before: dict[str, Floats], after: dict[str, Floats]) -> None:
    directions = []
    for piece, i in ((before, -1), (after, 0)):
        p, pu, pv = (a[0] for a in host.jet(piece["x"][[i], 0], piece["x"][[i], 1], 1)[:3])
        directions.append(piece["rate"][i, 0] * pu + piece["rate"][i, 1] * pv)
    turn = float(np.linalg.norm(directions[1] - directions[0]))
    if turn > CORNER:
        angle = np.degrees(2 * np.arcsin(min(1.0, turn / 2)))
        raise ValueError(
            f"path: expected a smooth one, it has a corner of {angle:.3g} degrees at "
            f"{np.round(p, 6).tolist()}; round it with a radius above half the strip's breadth"
        )
