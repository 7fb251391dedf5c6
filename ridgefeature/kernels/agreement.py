"""Heights that most points about a place agree with, where few do with the known ones."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ridgefeature.kernels.residual import OPTIONS

Floats = NDArray[np.float64]


@njit(**OPTIONS)
def agreed_heights(
    places: Floats,
    heights: Floats,
    known: Floats,
    off: float,
    near: float,
    reach: int,
    fewest: int,
    share: float,
) -> Floats:
    """Heights (n,) at n nodes that most points agree with, where few do with the known ones (n,); else NaN.

    places, heights (m,): of points among the nodes, and their heights, finite; off, near: how far one that
    agrees may be from what is known, and from what is found. reach: nodes to either side whose points are
    asked, at least `fewest` of them; share: of points that agree, from which on a known height stays.
    """
    nodes = known.size
    starts, agree = np.zeros(nodes + 1, np.int64), np.zeros(nodes + 1, np.int64)
    nearest = np.empty(places.size, np.int64)
    for i in range(places.size):
        k = min(int(places[i] + 0.5), nodes - 1)
        j = min(int(places[i]), nodes - 2)
        u = places[i] - j
        nearest[i] = k
        starts[k + 1] += 1
        agree[k + 1] += abs(heights[i] - ((1.0 - u) * known[j] + u * known[j + 1])) < off
    for k in range(nodes):
        starts[k + 1] += starts[k]
        agree[k + 1] += agree[k]
    sorted_heights, nexts = np.empty(places.size), starts.copy()
    for i in range(places.size):
        sorted_heights[nexts[nearest[i]]] = heights[i]
        nexts[nearest[i]] += 1
    out = np.full(nodes, np.nan)
    for k in range(nodes):
        low, high = max(k - reach, 0), min(k + reach + 1, nodes)
        count, agreeing = starts[high] - starts[low], agree[high] - agree[low]
        if count < fewest or agreeing >= share * count:
            continue
        own = sorted_heights[starts[low] : starts[high]]
        height = np.median(own)
        told = 0
        for z in own:
            told += abs(z - height) < near
        if told > max(agreeing, share * count):
            out[k] = height
    return out
