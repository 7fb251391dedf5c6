"""What is left of a march that went astray: what is alike, or all but ends of quite another width."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from ridgefeature.medians import median
from ridgefeature.stations import Stations

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

OTHER_WIDTH = 2.5
"""Factor between a width and that usual of a ridge from which on it is another one's."""
SHORTEST = 1.5
"""Length in widths of the shortest ridge that is left of one whose data end, or that went astray."""
_FEWEST = 4
"""Stations that a cubic spline goes through."""
_ALIKE, _ASTRAY = 1.33, 1.6
"""Factor between height or width and those that are usual up to which it is the same ridge; from which on a
march may have gone astray."""


def core_of(stations: Stations) -> Stations | None:
    """The longest stretch whose height and width are near the usual: what is left of a march astray.

    Without a width at either end, which what follows may have bent. None where that is too short, or the
    march did not go astray.
    """
    sizes = np.abs([np.log(np.maximum(v / median(v), 1e-9)) for v in (stations.height, stations.width)])
    alike = (sizes < np.log(_ALIKE)).all(axis=0)
    return None if (sizes < np.log(_ASTRAY)).all() else longest_part(stations, alike)


def longest_part(stations: Stations, good: Flags) -> Stations | None:
    """The longest stretch of good stations (k,), without a width where others follow; None if it is short."""
    if not good.any():
        return None
    s, usual = stations.arc_length, median(stations.width)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(int), [0]]))).reshape(-1, 2)
    first, last = edges[np.argmax(edges[:, 1] - edges[:, 0])]
    low, high = s[first] + usual * (first > 0), s[last - 1] - usual * (last < len(s))
    kept = (s >= low) & (s <= high)
    return None if high - low < SHORTEST * usual or kept.sum() < _FEWEST else _part(stations, kept)


def as_wide_as_usual(stations: Stations, open_ends: tuple[bool, bool]) -> Stations:
    """The stations without open ends that are far wider than the ridge usually is, or far narrower.

    Another rise under it has so many points that the section would be its own.
    """
    s, usual = stations.arc_length, median(stations.width)
    first, last = usual_ends(s, stations.width, open_ends)
    if last - first == len(s) - 1 or s[last] - s[first] < SHORTEST * usual or last - first + 1 < _FEWEST:
        return stations
    return _part(stations, (s >= s[first]) & (s <= s[last]))


def usual_ends(at: Array, width: Array, open_ends: tuple[bool, bool]) -> tuple[int, int]:
    """The first and the last place of a ridge that is about as wide as it usually is; of an end that is not
    open the very end. at (n,): arc lengths of the places, of which there may be more where it is narrow."""
    usual = median(np.interp(np.linspace(at[0], at[-1], len(at)), at, width))
    alike = np.flatnonzero((width <= OTHER_WIDTH * usual) & (OTHER_WIDTH * width >= usual))
    if not len(alike):
        return 0, len(width) - 1
    return (int(alike[0]) if open_ends[0] else 0), (int(alike[-1]) if open_ends[1] else len(width) - 1)


def _part(stations: Stations, kept: Flags) -> Stations:
    parts = {f.name: getattr(stations, f.name)[kept] for f in fields(Stations)}
    return Stations(**{**parts, "arc_length": parts["arc_length"] - parts["arc_length"][0]})
