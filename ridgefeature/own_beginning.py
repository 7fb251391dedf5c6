"""A ridge that was followed until it came back to its own beginning: a ring."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from ridgefeature.medians import median
from ridgefeature.stations import Stations, meeting

Array = NDArray[np.float64]

_NEAR = 0.3
"""Distance in widths between spines that are one."""
_ALONG = 0.8
"""Cosine between their tangents."""
_AROUND = 3.0
"""Length of the shortest ring, in widths."""
_ALIKE = 1.5
"""Ratio of heights, and of widths, of one ridge at one place."""
_BEGIN = (0.0, 1.5)
"""Places, in widths from the start, that it may come back to."""


def as_ring(stations: Stations) -> Stations | None:
    """The stations from one near the beginning to where they pass it again, closed; None where they do not.

    What lies before and beyond is left out: it is the same ridge again. Ends may be bent, so a place further
    in is tried too.
    """
    s, usual = stations.arc_length, median(stations.width)
    for inwards in _BEGIN:
        first = int(np.searchsorted(s, inwards * usual))
        last = _passed_again(stations, first, usual) if first < len(s) else None
        if last is not None:
            kept = {f.name: getattr(stations, f.name)[first : last + 1] for f in fields(Stations)}
            return meeting(Stations(**{**kept, "arc_length": kept["arc_length"] - s[first]}))
    return None


def _passed_again(stations: Stations, first: int, usual: float) -> int | None:
    """The station nearest to the first one, when the ridge comes back to it for the first time."""
    s, width = stations.arc_length, stations.width
    height = np.abs(stations.height)
    far = np.linalg.norm(stations.spine - stations.spine[first], axis=1)
    same = (far < _NEAR * usual) & (stations.tangent @ stations.tangent[first] > _ALONG)
    for value in (height, width):
        same &= (value > value[first] / _ALIKE) & (value < value[first] * _ALIKE)
    again = np.flatnonzero(same & (s > s[first] + _AROUND * usual))
    if not len(again):
        return None
    together = again[s[again] < s[again[0]] + usual]
    return int(together[np.argmin(far[together])])
