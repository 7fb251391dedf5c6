"""What is left of a march that went astray: the longest stretch that is alike."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from ridgefeature.stations import Stations

SHORTEST = 1.5
"""Length in widths of the shortest ridge that is left of one whose data end, or that went astray."""
_ALIKE, _ASTRAY = 1.33, 1.6
"""Factor between height or width and those that are usual up to which it is the same ridge; from which on a
march may have gone astray."""


def core_of(stations: Stations) -> Stations | None:
    """The longest stretch whose height and width are near the usual: what is left of a march astray.

    Without a width at either end, which what follows may have bent. None where that is too short, or the
    march did not go astray.
    """
    sizes = np.abs([np.log(np.maximum(v / np.median(v), 1e-9)) for v in (stations.height, stations.width)])
    alike = (sizes < np.log(_ALIKE)).all(axis=0)
    if (sizes < np.log(_ASTRAY)).all() or not alike.any():
        return None
    edges = np.flatnonzero(np.diff(np.concatenate([[0], alike.astype(int), [0]]))).reshape(-1, 2)
    first, last = edges[np.argmax(edges[:, 1] - edges[:, 0])]
    s, usual = stations.arc_length, float(np.median(stations.width))
    low, high = s[first] + usual * (first > 0), s[last - 1] - usual * (last < len(s))
    if high - low < SHORTEST * usual:
        return None
    kept = (s >= low) & (s <= high)
    parts = {f.name: getattr(stations, f.name)[kept] for f in fields(Stations)}
    return Stations(**{**parts, "arc_length": s[kept] - s[kept][0]})
