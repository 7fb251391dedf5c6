"""Coordinates of scan points along a ridge: nodes of its path with frames, and the points between them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ridgefeature.grid import Grid
from ridgefeature.kernels.algebra import rotation_of
from ridgefeature.kernels.path_points import boxes_around, count_along, rectified_along
from ridgefeature.kernels.strip import TERMS, A, B, C, E
from ridgefeature.medians import median
from ridgefeature.merge import along
from ridgefeature.smoothing import basis_at
from ridgefeature.stations import Stations, unit

Array = NDArray[np.float64]

NODES_A_WIDTH = 10
_KNOTS_A_WIDTH = 2.0
_FEWEST_SPANS = 4
_TOGETHER = 12
"""Nodes between which points are looked up together."""
_OVERLAP = 1.5
"""How far a ring's path runs on beyond its seam at both ends, in widths."""


@dataclass(frozen=True, eq=False)
class PathFrame:
    """A path at n nodes that are evenly spaced in local widths; of a ring it runs on beyond the seam.

    at (n,): arc length; knots (n,): place among the knots of splines along the path, from 0; origin, tangent,
    left, normal (n, 3); curvature (n,) of the base across; height, width (n,) as far as they are known; tall
    (n,) how far above and below the base points are looked at.
    """

    at: Array
    knots: Array
    origin: Array
    tangent: Array
    left: Array
    normal: Array
    curvature: Array
    height: Array
    width: Array
    tall: Array
    overlap: float = 0.0
    """Arc length by which a ring runs on; 0: an open path."""

    @property
    def coefficients(self) -> int:
        """How many a spline along the path has."""
        return round(float(self.knots[-1])) + 3

    @cached_property
    def sizes(self) -> tuple[float, float]:
        """The usual height, as far as any is known, and width."""
        known, width = np.abs(self.height[self.height != 0]), median(self.width)
        return median(known) if len(known) else width, width

    @cached_property
    def at_nodes(self) -> tuple[NDArray[np.intp], Array]:
        """First function and values of the splines along the path at its nodes."""
        return basis_at(self.coefficients, self.knots)

    @cached_property
    def at_middles(self) -> tuple[NDArray[np.intp], Array]:
        """The same at the middle between each node and the next."""
        return basis_at(self.coefficients, 0.5 * (self.knots[1:] + self.knots[:-1]))

    @cached_property
    def wanted(self) -> Array:
        """(6, n) what the differences of the coefficients should be for path and base to be smooth as a
        whole."""
        return _wanted_differences(self)

    def between(self, s: Array) -> tuple[Array, Array, Array, Array]:
        """Origin, left, normal (k, 3) and curvature (k,) at arc lengths, as kernels.strip has them."""
        i = np.clip(np.searchsorted(self.at, s, side="right") - 1, 0, len(self.at) - 2)
        u = ((s - self.at[i]) / (self.at[i + 1] - self.at[i]))[:, None]
        v = 1.0 - u
        chord = self.origin[i + 1] - self.origin[i]
        step = np.linalg.norm(chord, axis=1, keepdims=True)
        origin = (
            self.origin[i]
            + u * u * (3.0 - 2.0 * u) * chord
            + step * (u * v * v * self.tangent[i] - u * u * v * self.tangent[i + 1])
        )
        left, normal = (unit(v * x[i] + u * x[i + 1]) for x in (self.left, self.normal))
        return origin, left, normal, (v * self.curvature[i, None] + u * self.curvature[i + 1, None])[:, 0]


def path_frame(stations: Stations, closed: bool, beyond: tuple[float, float] = (0.0, 0.0)) -> PathFrame:
    """The path of stations with its frames; beyond: how far it runs on at both ends of an open one."""
    s, length = stations.arc_length, float(stations.arc_length[-1])
    overlap = min(_OVERLAP * float(stations.width.max()), 0.5 * length) if closed else 0.0
    fine = np.linspace(-max(overlap, beyond[0]), length + max(overlap, beyond[1]), 20 * len(s))
    local = np.interp(fine % length if closed else fine, s, stations.width)
    steps = 0.5 * np.diff(fine) * (1 / local[1:] + 1 / local[:-1])
    widths = np.concatenate([[0.0], np.cumsum(steps)])
    spans = max(int(np.ceil(_KNOTS_A_WIDTH * widths[-1])), _FEWEST_SPANS)
    nodes = max(int(np.ceil(NODES_A_WIDTH * widths[-1])), NODES_A_WIDTH) + 1
    even = np.linspace(0.0, widths[-1], nodes)
    at = np.interp(even, widths, fine)
    where = at % length if closed else np.clip(at, 0.0, length)
    known = (stations.spine, stations.normal, stations.curvature, stations.height, stations.width)
    found = along(s, np.column_stack(known), where, closed=closed)
    spine, normal, (curvature, height, width) = found[:, :3], found[:, 3:6], found[:, 6:].T.copy()
    tangent = unit(along(s, stations.spine, where, derivative=1, closed=closed))
    normal = unit(normal - tangent * (normal * tangent).sum(axis=1, keepdims=True))
    width = np.maximum(width, 0.3 * stations.width.min())
    path = PathFrame(
        at,
        even / widths[-1] * spans,
        spine.copy(),
        tangent,
        np.cross(normal, tangent),
        normal,
        curvature,
        height,
        width,
        2.0 * np.abs(height) + 0.25 * width,
        overlap,
    )
    return path if closed else _run_on(path, length)


def _run_on(path: PathFrame, length: float) -> PathFrame:
    """The path with the nodes beyond both ends where its last width leads: as curved, and with no height.

    Points are looked at there as far up as before: the ridge may go on.
    """
    origin, axes = path.origin.copy(), np.stack([path.tangent, path.left, path.normal], axis=1)
    outside = (path.at < 0) | (path.at > length)
    inner = np.flatnonzero(~outside)
    for last, step in ((int(inner[-1]), 1), (int(inner[0]), -1)):
        before = int(np.clip(last - step * NODES_A_WIDTH, inner[0], inner[-1]))
        way = float(path.at[last] - path.at[before])
        # How the frame turns a unit of arc length, in its own axes.
        turn = _turn(axes[before] @ axes[last].T) / way if way else np.zeros(3)
        k = last + step
        while 0 <= k < len(path.at):
            s = float(path.at[k] - path.at[k - step])
            axes[k] = _rotation(-turn * s) @ axes[k - step]
            origin[k] = origin[k - step] + 0.5 * s * (axes[k, 0] + axes[k - step, 0])
            k += step
    height = np.where(outside, 0.0, path.height)
    tangent, left, normal = (np.ascontiguousarray(axes[:, i]) for i in range(3))
    return replace(path, origin=origin, tangent=tangent, left=left, normal=normal, height=height)


def _turn(rotation: Array) -> Array:
    """Rotation vector (3,) of a small rotation."""
    return 0.5 * np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )


def _rotation(vector: Array) -> Array:
    return rotation_of(vector)[0]


def points_along(grid: Grid, path: PathFrame, reach: Array, most: int) -> Array:
    """Coordinates (m, 3) as in kernels.strip of the points up to `reach` (n,) from the path.

    Of more than about `most` only one of every two, three ... is taken, spread evenly; which of them does not
    depend on their order.
    """
    axes = path.tangent, path.left, path.normal
    boxes = boxes_around(_corners(path, reach), path.origin, *axes, _TOGETHER)
    for array in boxes:
        # As those of all other look-ups: a kernel is compiled for each kind of array.
        array.setflags(write=False)
    cells = grid.starts, grid.levels, grid.frame
    count = count_along(*cells, *boxes) if len(grid.points) > most else len(grid.points)
    every = 1 + (count // most if len(grid.points) > most else 0)
    nodes = path.origin, *axes, path.curvature, reach, path.tall
    return rectified_along(grid.points, *cells, *boxes, *nodes, _TOGETHER, every, count // every)


def _corners(path: PathFrame, reach: Array) -> Array:
    """(n, 6, 3) what the points near each node lie between: above and below sides and middle of the base."""
    sides = np.array([-1.0, -1.0, 0.0, 0.0, 1.0, 1.0]) * reach[:, None]
    up = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0]) * path.tall[:, None]
    bend = path.curvature[:, None]
    left, normal = path.left[:, None], path.normal[:, None]
    aside, over = sides * (1.0 - up * bend), up + 0.5 * bend * sides**2
    return np.asarray(path.origin[:, None] + aside[:, :, None] * left + over[:, :, None] * normal)


def _wanted_differences(path: PathFrame) -> Array:
    """As PathFrame.wanted."""
    n, s = path.coefficients, path.at
    out = np.zeros((TERMS, n))

    def rate(x: Array) -> Array:
        return np.asarray(np.gradient(x, s, axis=0))

    turns = rate(np.column_stack([path.tangent, path.normal]))
    turn, tip = turns[:, :3], turns[:, 3:]
    bends = [(turn * path.normal).sum(axis=1), (turn * path.left).sum(axis=1), -(tip * path.left).sum(axis=1)]
    bow, geodesic, twist = rate(np.column_stack(bends)).T
    step = np.gradient(s, path.knots)
    for term, order, change in ((A, 3, bow), (E, 3, geodesic), (B, 2, twist)):
        # The middle of the coefficients of a difference; the i-th is centred i - 1 knots from the start.
        places = np.clip(np.arange(n - order) + 0.5 * order - 1.0, 0.0, n - 3.0)
        out[term, : n - order] = -np.interp(places, path.knots, change * step**order)
    centres = np.clip(np.arange(n) - 1.0, 0.0, n - 3.0)
    out[C, : n - 1] = -np.diff(0.5 * np.interp(centres, path.knots, path.curvature))
    return out
