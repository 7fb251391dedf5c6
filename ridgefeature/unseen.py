"""Flanks that no point was seen on: how far from where it was taken for the half height may be."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels.strip import offsets, places_across
from ridgefeature.smearing import Smeared

Array = NDArray[np.float64]

_ENDS = 3
"""Points on either side of a gap that may be strays."""
_NEAR = 3.0
"""Distance from the surface, in noise scales, of points that were seen on it."""
_ALIKE = 1e-9
_USUAL = 4.0
"""Breadth of a gap, in mean distances of such points, that there may be by chance."""


def unseen_std(points: Array, terms: Array, seen: Smeared, scale: float) -> float:
    """Standard deviation of the width at half height, in widths, that gaps in the flanks leave.

    points (m, 3) in path coordinates and terms (n, 6) as in kernels.strip; seen: the section, smeared; scale:
    of the noise. A flank that falls from the last point above to the first below may do so anywhere between,
    evenly likely. What was seen of one flank of a symmetric section was seen of both.
    """
    section = seen.section
    on = offsets(points, terms, seen.told, scale)[1] < _NEAR * scale
    eta = places_across(points[on], terms)
    low, high = section.half_height_places
    if np.abs(section.coefficients - section.coefficients[::-1]).max() < _ALIKE * section.coefficients.max():
        return 2.0 * _one_flank(np.abs(eta), high)
    return math.hypot(_one_flank(-eta[eta < 0], -low), _one_flank(eta[eta > 0], high))


def _one_flank(places: Array, at: float) -> float:
    """Root mean square distance from `at` of where a flank may fall in the gap between points about it.

    Gaps are counted without what such points usually lie apart.
    """
    inner, outer, n = places[places < at], places[places >= at], len(places)
    before = float(np.partition(inner, -_ENDS)[-_ENDS]) if len(inner) >= _ENDS else 0.0
    after = float(np.partition(outer, _ENDS - 1)[_ENDS - 1]) if len(outer) >= _ENDS else max(0.5, at)
    usual = _USUAL * _ENDS * float(places.max()) / n if n else 0.0
    if after - before <= usual:
        return 0.0
    share = 1.0 - usual / (after - before)
    below, above = share * (before - at), share * (after - at)
    return math.sqrt((below * below + below * above + above * above) / 3.0)
