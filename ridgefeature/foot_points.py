"""Points of a ridge against the places of its section that are nearest to them: how a steep ridge is begun.

A distance from the nearest place tells flanks that stand off where the height over a place tells nothing, so
these fits find their way from far; as noise is seen from one side only where a section bends they end beside
the truth (Boggs, Byrd and Schnabel 1987), and only begin what kernels.strip goes on with.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels.strip import TERMS, A, B, C, E, H, W
from ridgefeature.medians import median
from ridgefeature.section import Section

Array = NDArray[np.float64]

_PLACES = 96
_REACH = 1.0
"""Distance from the middle that the places of a section have at most, in widths: base too."""


def distances(points: Array, terms: Array, section: Section) -> tuple[Array, Array]:
    """Signed distances (m,) of points, positive above, and how the surface moves there with the terms (m, 6).

    points (m, 3) in path coordinates and terms (n, 6) as in kernels.strip.
    """
    nodes = np.arange(len(terms))
    there = np.column_stack([np.interp(points[:, 0], nodes, terms[:, k]) for k in range(TERMS)])
    e, h, w = there[:, E], there[:, H], there[:, W]
    y = points[:, 1]
    aside, over = y - e, points[:, 2] - there[:, A] - y * (there[:, B] + there[:, C] * y)
    eta = _places(section, float(median(np.abs(h)) / median(w)))
    f = section(eta)
    far = (aside[:, None] - w[:, None] * eta) ** 2 + (over[:, None] - h[:, None] * f) ** 2
    foot = eta[np.argmin(far, axis=1)]
    f, rise = section(foot), h * section(foot, 1)
    along = np.hypot(w, rise)
    side, up = -rise / along, w / along
    distance = side * (aside - w * foot) + up * (over - h * f)
    rows = np.column_stack([up, up * y, up * y * y, side, up * f, side * foot])
    return distance, rows


def _places(section: Section, steepness: float) -> Array:
    """Places of a section that lie evenly along its curve."""
    eta = np.linspace(-_REACH, _REACH, 4001)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(eta), steepness * np.diff(section(eta))))])
    return np.interp(np.linspace(0.0, way[-1], _PLACES), way, eta)


def information(
    points: Array, stretches: int, distance: Array, rows: Array, scale: float, stray: float
) -> tuple[Array, Array, Array]:
    """Weighted normal equations as kernels.strip.information has them, of distances and their rows."""
    r = distance / scale
    weight = 1.0 / (1.0 + stray * np.exp(np.minimum(0.5 * r * r, 50.0)))
    rows = rows / scale
    place = np.minimum(points[:, 0].astype(np.int64), stretches - 1)
    matrix, right = np.zeros((stretches, TERMS, TERMS)), np.zeros((stretches, TERMS))
    np.add.at(matrix, place, weight[:, None, None] * rows[:, :, None] * rows[:, None, :])
    np.add.at(right, place, (weight * r)[:, None] * rows)
    psi = weight - weight * (1.0 - weight) * r * r
    return matrix, right, np.array([len(r), weight.sum(), (weight * weight * r * r).sum(), psi.sum()])
