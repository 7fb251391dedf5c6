"""Lines of a scanner that have an error each, found in what points along a ridge are off by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels.pair_products import pair_products
from ridgefeature.path_frame import NODES_A_WIDTH, PathFrame

Array = NDArray[np.float64]

_ENOUGH, _FEWEST = 4500, 200
"""Points that tell lines; fewest that do."""
_ANGLES, _AROUND, _NEAR = 36, 9, 0.1
"""Directions that are tried; and then so many around the best, up to so far from it."""
_SHORT, _LONG = 0.5, 1.0
"""Parts of lines that are looked at, in widths: with many directions, with those around the best."""
_SURE = 5.0
"""Standard deviations from which on errors in lines are no chance: of many directions one is large."""
_LOST = 3.0
"""Share of the variance that a line has in common, by that which is seen: lines are not where they are
thought, and the fit follows them."""
_ALONG, _ACROSS = 5.0, 0.25
"""Length in widths over which a line along the ridge, or one square to it times the tangent, tells the same:
the terms are smooth, and a line that crosses all of a ridge does not change its height."""


@dataclass(frozen=True, eq=False)
class ScanLines:
    """Lines that have a share of their points' variance in common."""

    share: float
    heading: float
    """Direction in radians, by that of the path where it begins, as the base is laid flat along the path."""
    inflation: Array
    """(n - 1,) variance of sums over the points of each stretch, by that of independent noise."""


def scan_lines(points: Array, path: PathFrame, errors: Array) -> ScanLines | None:
    """The scanner's lines as points (m, 3) in path coordinates tell them by their errors (m,), 0 of strays.

    None where there are none. They are straight as the base is laid flat along the path.
    """
    if len(points) < _FEWEST:
        return None
    width, mean = path.sizes[1], float((errors * errors).mean())
    area = float((path.at[-1] - path.at[0]) * np.ptp(points[:, 1]))
    if not (mean > 0 and area > 0):
        return None
    apart = float(np.sqrt(area / len(points)))
    seam = np.interp(path.at[-1] - 2.0 * path.overlap, path.at, np.arange(len(path.at)))
    windows = (points[:, 0] / NODES_A_WIDTH).astype(np.int64)
    some = (windows % (1 + len(points) // _ENOUGH) == 0) & (points[:, 0] < seam)
    flat = _laid_flat(path)
    places, errors = _flat_places(points[some], *flat), np.ascontiguousarray(errors[some])

    def best(angles: Array, part: float) -> tuple[float, float, float]:
        """The surest of directions, the share that is seen in common, its standard deviation."""
        products, pairs = pair_products(places, errors, angles, apart, part * width)
        shares, stds = products / (mean * np.maximum(pairs, 1.0)), np.sqrt(2.0 / np.maximum(pairs, 1.0))
        k = int(np.argmax(shares / stds))
        return float(angles[k]), float(shares[k]), float(stds[k])

    heading = best(np.arange(_ANGLES) * np.pi / _ANGLES, _SHORT)[0]
    heading, share, std = best(heading + np.linspace(-_NEAR, _NEAR, _AROUND), _LONG)
    if not share > _SURE * std:
        return None
    turned = heading - flat[0]
    slope = np.abs(np.tan(0.5 * (turned[1:] + turned[:-1])))
    widths = 0.5 * (path.width[1:] + path.width[:-1])
    length = widths * _ALONG / np.hypot(1.0, slope * _ALONG / _ACROSS)
    share = min(_LOST * share, 1.0)
    return ScanLines(share, heading, np.asarray(1.0 + share * length / apart))


def _laid_flat(path: PathFrame) -> tuple[Array, Array]:
    """Headings (n,) of the nodes of a path, and their places (n, 2), as the base is laid flat along it."""
    ahead = path.tangent[1:]
    turns = np.arctan2((ahead * path.left[:-1]).sum(axis=1), (ahead * path.tangent[:-1]).sum(axis=1))
    headings = np.concatenate([[0.0], np.cumsum(turns)])
    middle = 0.5 * (headings[1:] + headings[:-1])
    steps = np.diff(path.at)[:, None] * np.column_stack([np.cos(middle), np.sin(middle)])
    return headings, np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def _flat_places(points: Array, headings: Array, places: Array) -> Array:
    """(m, 2) where points (m, 3) in path coordinates lie then."""
    nodes = np.arange(len(headings))
    heading, x, y = (np.interp(points[:, 0], nodes, of) for of in (headings, *places.T))
    aside = points[:, 1]
    return np.column_stack([x - aside * np.sin(heading), y + aside * np.cos(heading)])
