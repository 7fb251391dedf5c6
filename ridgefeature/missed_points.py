"""Where a whole fit would begin with a base or height that hardly any point of its ridge agrees with.

As far as the noise tells, such points are strays, and would stay so however many they are: beyond an end that
the march put too early, at one that it put too low.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels.agreement import agreed_heights
from ridgefeature.kernels.strip import A, B, H, W, places_across
from ridgefeature.medians import median
from ridgefeature.noise import Noise
from ridgefeature.path_frame import NODES_A_WIDTH
from ridgefeature.section import Section

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_BESIDE = (0.55, 0.85)
"""Distances from the middle, in widths, between which points are of the base."""
_OFF, _LEAST = 4.0, 0.1
"""Distance from the surface, in noise scales, beyond which a point is a stray; and in heights, about one
that is found."""
_FEWEST, _MOST = 6, 0.5
"""Points of half a width that tell a height; share of them that agree from which on it stays."""
_LOWEST, _HIGHEST = 0.1, 1.3
"""Heights that may be found, in the usual and in the largest."""


def with_missed_points(points: Array, terms: Array, section: Section, noise: Noise) -> Array:
    """The terms (n, 6) with base and height that most points agree with, where few do with the known ones.

    points (m, 3) and terms as in kernels.strip, the base as the path has it; where heights are 0 nothing is
    known of the ridge, and it may begin.
    """
    known = terms[:, H] != 0
    if not known.any():
        return terms
    sizes, sign = np.abs(terms[known, H]), np.sign(median(terms[known, H]))
    usual, largest = median(sizes), float(sizes.max())
    eta = places_across(points, terms)
    off, near = _OFF * noise.scale, max(_OFF * noise.scale, _LEAST * usual)
    out = terms.copy()
    flats = [
        _found(points[on, 0], points[on, 2], np.zeros(len(terms)), off, near)
        for on in ((side * eta > _BESIDE[0]) & (side * eta < _BESIDE[1]) for side in (1.0, -1.0))
    ]
    left, right = (np.where(np.isfinite(z), z, 0.0) for z in flats)
    ground = 0.5 * (left + right)
    low, high = section.top
    top = (eta > low) & (eta < high)
    s, y, z = points[top].T
    f = section(eta[top])
    heights, nodes = _found(s, z / f, terms[:, H], off, near), np.arange(len(terms))
    # Beyond the ends the path leads anywhere; where only the ground beside is higher others cross the ridge.
    moved = known & ((np.isfinite(heights) & (ground != 0)) | (sign * ground < 0))
    if moved.any():
        out[moved, A] = ground[moved]
        out[moved, B] = ((left - right) / (sum(_BESIDE) * terms[:, W]))[moved]
        base = np.interp(s, nodes, out[:, A]) + y * np.interp(s, nodes, out[:, B])
        heights = _found(s, (z - base) / f, terms[:, H], off, near)
    with np.errstate(invalid="ignore"):
        # An edge stands over the ground on one side only.
        over = sign * heights - np.where(known, 0.0, np.maximum(sign * left, sign * right))
        found = (over > max(_LOWEST * usual, off)) & (over < _HIGHEST * largest)
        # What is lower than a march has it may be no ridge at all: the fit is to miss it there, and be cut.
        found &= np.abs(heights) > np.abs(terms[:, H])
    found &= _connected(known | found, known)
    out[found, H] = heights[found]
    return out


def _connected(any_height: Flags, known: Flags) -> Flags:
    """Which nodes (n,) have a height in a row with those that are known."""
    low, high = np.flatnonzero(known)[[0, -1]]
    gaps = np.flatnonzero(~any_height)
    first = gaps[gaps < low].max(initial=-1)
    last = gaps[gaps > high].min(initial=len(known))
    at = np.arange(len(known))
    return (at > first) & (at < last)


def _found(place: Array, own: Array, known: Array, off: float, near: float) -> Array:
    """As kernels.agreement has it, of points half a width about each node."""
    place, own = np.ascontiguousarray(place), np.ascontiguousarray(own)
    return agreed_heights(place, own, known, off, near, NODES_A_WIDTH // 4, _FEWEST, _MOST)
