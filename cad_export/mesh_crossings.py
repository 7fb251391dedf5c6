"""Whether a triangle mesh runs through itself: edges against triangles, by cells. numpy only."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_AT_ONCE = 400_000
"""Pairs looked at in one go, which bounds the memory."""
_PLANE = 1e-6
"""Sine of an angle below which an edge counts as in the triangle's plane."""
_ROUND = 1e-9
"""Barycentric coordinates and parameters count as within up to this."""


def crosses_itself(vertices: Floats, triangles: Ints) -> bool:
    """Whether an edge runs through a triangle with which it shares no vertex (Moeller and Trumbore 1997).

    vertices (n, 3), triangles (m, 3) of their indices. Two triangles that cross always have such an edge;
    those that lie in one plane are not seen.
    """
    edges = np.unique(
        np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])), axis=0
    )
    corners = vertices[triangles]
    ends = vertices[edges]
    size = float(np.percentile(np.ptp(corners, axis=1).max(axis=1), 90)) or 1.0
    boxes = ends.min(axis=1), ends.max(axis=1), corners.min(axis=1), corners.max(axis=1)
    origin = vertices.min(axis=0)
    cell_e, edge = _cells(*boxes[:2], origin, size)
    cell_t, triangle = _cells(*boxes[2:], origin, size)
    order = np.argsort(cell_t, kind="stable")
    cell_t, triangle = cell_t[order], triangle[order]
    first, last = np.searchsorted(cell_t, cell_e, "left"), np.searchsorted(cell_t, cell_e, "right")
    counts = last - first
    starts = np.concatenate([[0], np.cumsum(counts)])
    done = 0
    while done < len(counts):
        upto = max(int(np.searchsorted(starts, starts[done] + _AT_ONCE, "right")) - 1, done + 1)
        some = counts[done:upto]
        e = np.repeat(edge[done:upto], some)
        offset = np.arange(some.sum()) - np.repeat(np.cumsum(some) - some, some)
        t = triangle[np.repeat(first[done:upto], some) + offset]
        if _any_cross(ends, edges, corners, triangles, boxes, e, t):
            return True
        done = upto
    return False


def welded(grids: list[Floats]) -> tuple[Floats, Ints]:
    """Vertices (n, 3) and triangles (m, 3) of grids of points (k, l, 3) that share their borders.

    Vertices at the same place are one, and triangles that this makes lines or points are left out.
    """
    points = np.concatenate([grid.reshape(-1, 3) for grid in grids])
    step = 1e-7 * float(np.ptp(points, axis=0).max())
    _, first, index = np.unique(np.round(points / step), axis=0, return_index=True, return_inverse=True)
    index = index.reshape(-1)
    triangles, start = [], 0
    for grid in grids:
        k, m = grid.shape[:2]
        at = index[start : start + k * m].reshape(k, m)
        start += k * m
        halves = (at[:-1, :-1], at[1:, :-1], at[1:, 1:]), (at[:-1, :-1], at[1:, 1:], at[:-1, 1:])
        triangles += [np.stack([c.ravel() for c in half], axis=1) for half in halves]
    whole = np.concatenate(triangles)
    distinct = (whole[:, 0] != whole[:, 1]) & (whole[:, 1] != whole[:, 2]) & (whole[:, 2] != whole[:, 0])
    return points[first], whole[distinct].astype(np.int64)


def _cells(low: Floats, high: Floats, origin: Floats, size: float) -> tuple[Ints, Ints]:
    """Cells that boxes (n, 3) meet, as one number each, and the box of each."""
    a, b = ((x - origin) // size for x in (low, high))
    span = (b - a + 1).astype(np.int64)
    total = span.prod(axis=1)
    box = np.repeat(np.arange(len(low)), total)
    k = np.arange(total.sum()) - np.repeat(np.cumsum(total) - total, total)
    nx, ny = span[box, 0], span[box, 1]
    at = a[box].astype(np.int64) + np.stack([k % nx, k // nx % ny, k // (nx * ny)], axis=1)
    return at[:, 0] + (at[:, 1] << 21) + (at[:, 2] << 42), box


def _any_cross(
    ends: Floats, edges: Ints, corners: Floats, triangles: Ints, boxes: tuple[Floats, ...], e: Ints, t: Ints
) -> bool:
    """Whether any of these edges e (k,) crosses its triangle t (k,); boxes: lowest and highest of each."""
    for axis in range(3):
        e_low, e_high, t_low, t_high = (box[:, axis] for box in boxes)
        near = (e_low[e] <= t_high[t]) & (e_high[e] >= t_low[t])
        e, t = e[near], t[near]
    one, two, three = triangles[t].T
    shared = np.zeros(len(e), bool)
    for end in edges[e].T:
        shared |= (end == one) | (end == two) | (end == three)
    e, t = e[~shared], t[~shared]
    start, way = ends[e, 0], ends[e, 1] - ends[e, 0]
    side, other = corners[t, 1] - corners[t, 0], corners[t, 2] - corners[t, 0]
    p = np.cross(way, other)
    det = np.einsum("ij,ij->i", side, p)
    lengths = [np.linalg.norm(x, axis=1) for x in (way, side, other)]
    det[np.abs(det) < _PLANE * lengths[0] * lengths[1] * lengths[2]] = np.nan
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = start - corners[t, 0]
        u = np.einsum("ij,ij->i", offset, p) / det
        q = np.cross(offset, side)
        v = np.einsum("ij,ij->i", way, q) / det
        at = np.einsum("ij,ij->i", other, q) / det
        low, high = -_ROUND, 1 + _ROUND
        inside = (u >= low) & (v >= low) & (u + v <= high)
    return bool((inside & (at >= low) & (at <= high)).any())
