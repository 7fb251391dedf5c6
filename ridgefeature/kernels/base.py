"""Kernels of a curved base: points seen as if it were flat, and put back on it.

Near a template the base is z = (xx x^2 + 2 xy x y + yy y^2) / 2 in its frame. Points are flattened: x becomes
arc length along the base, y the distance across within it, z the height along its normal (Fermi coordinates,
to third order: do Carmo, Differential Geometry, 4-2). So every other kernel sees a ridge on a plane.
`terms` (3,) are xx, xy, yy: normal curvature along the ridge, twist, and curvature across.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import facing, orthonormal

Floats = NDArray[np.float64]


@njit(cache=True)
def _height(x: float, y: float, terms: Floats) -> tuple[float, float, float]:
    """Height of the base over (x, y), and its slopes. Curvature stays along: a circle's, to fourth order."""
    a, b = terms[0] * x + terms[1] * y, terms[1] * x + terms[2] * y
    steep = 0.25 * (a * a + b * b)
    return 0.5 * (x * a + y * b) * (1.0 + steep), a * (1.0 + 2.0 * steep), b * (1.0 + 2.0 * steep)


@njit(cache=True)
def _bowed(x: float, y: float, terms: Floats) -> tuple[float, float]:
    """How much arc length and distance on the base exceed x and y, to third order."""
    xx, xy, yy = terms[0], terms[1], terms[2]
    cubes = xx * x * x * x, x * x * y, x * y * y, yy * y * y * y
    along = (xx * cubes[0] + xy * cubes[3]) / 6.0 + 0.5 * xx * (xy * cubes[1] + yy * cubes[2])
    across = (xy * cubes[0] + yy * cubes[3]) / 6.0 + 0.5 * xy * (xy * cubes[1] + yy * cubes[2])
    return along, across


@njit(cache=True)
def flattened(points: Floats, terms: Floats) -> Floats:
    """Points (n, 3) of a template's frame as they would lie if its base were flat."""
    out = np.empty_like(points)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        foot_x, foot_y = x, y
        up = 0.0
        for _ in range(6):
            base, a, b = _height(foot_x, foot_y, terms)
            square = 1.0 + a * a + b * b
            up = (z - base - a * (x - foot_x) - b * (y - foot_y)) / square
            foot_x, foot_y = x + up * a, y + up * b
        along, across = _bowed(foot_x, foot_y, terms)
        _, a, b = _height(foot_x, foot_y, terms)
        out[i, 0], out[i, 1], out[i, 2] = foot_x + along, foot_y + across, up * math.sqrt(1.0 + a * a + b * b)
    return out


@njit(cache=True)
def on_base(points: Floats, terms: Floats) -> Floats:
    """Points (n, 3) given as if the base were flat, as they lie in the template's frame."""
    out = np.empty_like(points)
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        for _ in range(4):
            along, across = _bowed(x, y, terms)
            x, y = points[i, 0] - along, points[i, 1] - across
        base, a, b = _height(x, y, terms)
        up = points[i, 2] / math.sqrt(1.0 + a * a + b * b)
        out[i, 0], out[i, 1], out[i, 2] = x - up * a, y - up * b, base + up
    return out


@njit(cache=True)
def turning(yaw: float) -> Floats:
    """(3, 3) what the terms of a base become in a frame turned about its normal by this angle."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array(
        [[c * c, 2.0 * c * s, s * s], [-c * s, c * c - s * s, c * s], [s * s, -2.0 * c * s, c * c]]
    )


@njit(cache=True)
def seen_from(terms: Floats, axes: Floats) -> Floats:
    """The terms (3,) in a frame whose axes (3, 3), columns, are given in the base's own.

    The ground does not turn with the ridge: where a path bends its base is another.
    """
    if terms[0] == 0.0 and terms[1] == 0.0 and terms[2] == 0.0:
        return terms
    turn, out = turning(math.atan2(axes[1, 0], axes[0, 0])), np.zeros(3)
    for i in range(3):
        for j in range(3):
            out[i] += turn[i, j] * terms[j]
    return out


@njit(cache=True)
def standing(place: Floats, turn: Floats, terms: Floats) -> tuple[Floats, Floats]:
    """Position (3,) and axes (3, 3) in the template's frame of what is placed, turned as if it was flat."""
    position = on_base(place.copy().reshape(1, 3), terms)[0]
    foot = on_base(np.array([[place[0], place[1], 0.0]]), terms)[0]
    _, a, b = _height(foot[0], foot[1], terms)
    frame = facing(np.array([-a, -b, 1.0]) / math.sqrt(1.0 + a * a + b * b), np.array([1.0, 0.0, 0.0]))
    axes = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                axes[i, j] += frame[i, k] * turn[k, j]
    return position, orthonormal(axes)
