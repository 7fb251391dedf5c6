"""Ridge surfaces on analytic hosts, for the tests of pasting."""

from __future__ import annotations

from collections.abc import Callable

import cadquery as cq
import numpy as np
from OCP.TopoDS import TopoDS_Shape

from ridgefeature.bspline import Surface, clamped_knots, greville, interpolate
from ridgefeature.merge import merged_surface
from ridgefeature.section import bell

Map = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def flat_ridge(h: float, z: float = 0.0, at=(0.0, 0.0), length=40.0, w=6.0, bend=3.0, rows=17) -> Surface:
    """An S-shaped ridge along x on the plane at z, w wide between its feet, with flanks to 0.9 w."""
    s = np.linspace(0.0, length, rows)
    x, turn = s - length / 2, 2 * np.pi / length
    spine = np.stack([x + at[0], bend * np.sin(turn * x) + at[1], np.full(rows, z)], axis=1)
    tangent = np.stack([np.ones(rows), bend * turn * np.cos(turn * x), np.zeros(rows)], axis=1)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    up = np.tile([0.0, 0.0, 1.0], (rows, 1))
    one = np.ones(rows)
    return merged_surface(s, spine, np.cross(up, tangent), up, h * one, w * one, 0.9 * w * one, bell())


def ring_ridge(h: float, z: float = 0.0, radius: float = 12.0, w: float = 4.0) -> Surface:
    """A ring about the z axis."""
    knots_u, knots_v = (
        clamped_knots(np.linspace(0, 2 * np.pi, 33), 3),
        clamped_knots(np.linspace(-1, 1, 9), 3),
    )
    a, eta = greville(knots_u, 3)[:, None], greville(knots_v, 3)[None]
    r = radius - 0.9 * w * eta
    height = h * np.clip(1 - (eta / 0.8) ** 2, 0, None) ** 3
    values = _stack(r * np.cos(a), r * np.sin(a), z + height)
    poles = _fitted(values, knots_u, knots_v)
    poles[-1] = poles[0]
    poles[:, [0, -1], 2] = z
    return Surface(poles, knots_u, knots_v, 3, 3)


def on_map(surface: Surface, place: Map) -> Surface:
    """A ridge of the plane z = 0 carried to (x, y) -> point, normal; the columns are made finer."""
    breaks = np.unique(surface.knots_v)
    at = np.interp(np.arange(6 * (len(breaks) - 1) + 1) / 6, np.arange(len(breaks)), breaks)
    knots_v = clamped_knots(at, 3)
    breaks = np.unique(surface.knots_u)
    knots_u = clamped_knots(np.interp(np.arange(2 * len(breaks) - 1) / 2, np.arange(len(breaks)), breaks), 3)
    flat = surface.on_grid(greville(knots_u, 3), greville(knots_v, 3))
    point, normal = place(flat[..., 0], flat[..., 1])
    return Surface(_fitted(point + flat[..., 2:] * normal, knots_u, knots_v), knots_u, knots_v, 3, 3)


def _fitted(values: np.ndarray, knots_u: np.ndarray, knots_v: np.ndarray) -> np.ndarray:
    across = interpolate(knots_u, 3, values).swapaxes(0, 1)
    return interpolate(knots_v, 3, across).swapaxes(0, 1).copy()


def _stack(*a: np.ndarray) -> np.ndarray:
    return np.stack(np.broadcast_arrays(*a), axis=-1)


def cylinder_map(radius: float) -> Map:
    """Along the cylinder's axis, x; y is arc length round it from the top."""

    def place(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        normal = _stack(0.0 * x, np.sin(y / radius), np.cos(y / radius))
        return _stack(x, 0.0 * x, 0.0 * x) + radius * normal, normal

    return place


def bore_map(radius: float) -> Map:
    """Along the bottom of a bore about the x axis."""

    def place(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        normal = _stack(0.0 * x, -np.sin(y / radius), np.cos(y / radius))
        return _stack(x, 0.0 * x, 0.0 * x) - radius * normal, normal

    return place


def sphere_map(radius: float) -> Map:
    def place(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a, b = x / radius, y / radius
        normal = _stack(np.cos(b) * np.sin(a), np.sin(b), np.cos(b) * np.cos(a))
        return radius * normal, normal

    return place


def cylinder(radius: float = 20.0) -> cq.Solid:
    """About the x axis, its seam below."""
    whole = cq.Solid.makeCylinder(radius, 120, cq.Vector(-60, 0, 0), cq.Vector(1, 0, 0))
    return whole.rotate(cq.Vector(0, 0, 0), cq.Vector(1, 0, 0), 180 if _seam_z(whole) > 0 else 0)


def _seam_z(solid: cq.Solid) -> float:
    return min(e.Center().z for e in solid.Edges() if e.geomType() == "LINE")


def sphere(radius: float = 30.0) -> cq.Solid:
    """Its poles on the y axis, its seam far from the top."""
    whole = cq.Solid.makeSphere(radius, angleDegrees1=-90, angleDegrees2=90, angleDegrees3=360)
    turned = whole.rotate(cq.Vector(0, 0, 0), cq.Vector(0, 0, 1), 180)
    return turned.rotate(cq.Vector(0, 0, 0), cq.Vector(1, 0, 0), 90)


def curved_face(solid: cq.Shape) -> TopoDS_Shape:
    """The face that is not a plane."""
    return next(f for f in solid.Faces() if f.geomType() != "PLANE").wrapped


def top(solid: cq.Shape) -> TopoDS_Shape:
    return cq.Workplane(obj=solid).faces(">Z").val().wrapped


def box(*size: float) -> cq.Solid:
    return cq.Workplane().box(*(size or (80, 50, 10))).val()
