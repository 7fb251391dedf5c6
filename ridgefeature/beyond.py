"""How a whole fit begins beyond the known ends of a steep ridge: with none there, or as high as it was.

Points on top of a ridge that is taken for none are strays as far as the noise tells, and would stay so. Where
flanks are not steep, points near their feet draw the height up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels.strip import H, offsets
from ridgefeature.noise import Noise
from ridgefeature.path_frame import NODES_A_WIDTH, PathFrame
from ridgefeature.section import Section
from ridgefeature.smearing import smear

Array = NDArray[np.float64]

_FAR = NODES_A_WIDTH
"""Stretches that are looked at: further on the path may bend."""
_SURE = 3.0
"""Log likelihood ratio from which on a ridge begins as high as it was."""


def continued(points: Array, path: PathFrame, terms: Array, section: Section, noise: Noise) -> Array:
    """The terms (n, 6) with heights beyond both ends as they were, as far as points are likelier so.

    points (m, 3) and terms as in kernels.strip; the path has no height beyond the ends.
    """
    known = np.flatnonzero(path.height)
    low, high = int(known[0]), int(known[-1])
    if low == 0 and high == len(terms) - 1:
        return terms
    on = terms.copy()
    on[high:, H] = _onward(terms[low : high + 1, H], len(terms) - high)
    on[: low + 1, H] = _onward(terms[low : high + 1, H][::-1], low + 1)[::-1]
    place = points[:, 0].astype(np.int64)
    near = ((place >= high) & (place < high + _FAR)) | ((place < low) & (place >= low - _FAR))
    points, place = points[near], place[near]
    seen = smear(section, on, noise.blur, noise.even).told
    ridge, none = offsets(points, on, seen, noise.scale)[1], points[:, 2]
    told = [np.log(np.exp(-0.5 * (off / noise.scale) ** 2) + noise.density) for off in (ridge, none)]
    gain = told[0] - told[1]
    gains = np.bincount(place, gain, len(terms) - 1).astype(np.float64)
    out = terms.copy()
    last, first = high + _best(gains[high:]), low - _best(gains[:low][::-1])
    out[high : last + 1, H], out[first:low, H] = on[high : last + 1, H], on[first:low, H]
    return out


def _onward(heights: Array, count: int) -> Array:
    """Heights (count,) from the last known one (n,) on, along a straight line, none higher than that."""
    before = heights[-NODES_A_WIDTH:]
    slope = (before[-1] - before[0]) / max(len(before) - 1, 1)
    line = (before[-1] + slope * np.arange(count)) / before[-1]
    return np.asarray(before[-1] * np.clip(line, 0.0, 1.0))


def _best(gains: Array) -> int:
    """How many stretches from an end on together are likelier to be ridge."""
    total = np.concatenate([[0.0], np.cumsum(gains[:_FAR])])
    return int(np.argmax(total)) if total.max() > _SURE else 0
