"""How sure the learned section of a ridge is, and what that adds to the ridge's height and widths."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ridgefeature.basis import basis_matrix
from ridgefeature.free_section import FREE, LEARNED, Told, smoothest_section, top_knots
from ridgefeature.medians import median
from ridgefeature.section import box
from ridgefeature.smearing import Smeared

Array = NDArray[np.float64]

_FOOT_STD = 0.0205
"""Of the width between feet, in widths: whether they are parabolas or cubics is not seen."""
_FOOT_BLUR = 1.0, 0.3
"""The same in deviations of the noise that smears it; by likelihood less. By how far learned feet are off."""
_HALF_BLUR = 0.05, 0.095
"""What that adds to the width at half height: how points lie there is hardly known; by likelihood better."""
_TOP_OFF = 2.0
"""Error of a section's height learned by likelihood, in standard deviations of its fit."""
_TOP = 0.95
"""The apex is midway between the places of this height."""


@dataclass(frozen=True)
class SectionStd:
    """Standard deviations that a learned section adds along the whole ridge alike."""

    height: float = 0.0
    """In heights; the others in widths."""
    half_height_width: float = 0.0
    width: float = 0.0
    apex: float = 0.0
    """Of its place."""


def section_std(
    told: Told,
    seen: Smeared,
    gap: float,
    inflation: float,
    exact: bool,
    common: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> SectionStd:
    """How sure a learned section is; arguments as for `free_section`, `unseen_std` of its flanks, and whether
    it is told by the likelihood, noise and all. One that has a name is as sure as its flanks.

    common: variances of height, width and place, in heights and widths, that deviations of the ridge's terms
    hold already: the section, stretched, is as free as they are.
    """
    section = seen.section
    if section.name not in (LEARNED, FREE, box().name):
        return SectionStd(half_height_width=gap, width=gap)
    spans = section.spans
    matrix, right = told(spans, 1.0)
    smooth = smoothest_section(matrix, right, spans, top_knots(section, spans, 1.0) if exact else None)
    covariance = inflation * smooth[2][:-3, :-3]
    eta = np.linspace(-0.5, 0.5, 2001)
    f = section(eta)
    knots, slope = np.arange(-3.0, spans + 4.0), section(eta, 1)
    top = basis_matrix(knots, 3, (eta[[np.argmax(f)]] + 0.5) * spans)[0]

    def moved(level: float) -> tuple[Array, Array]:
        """How the lowest and the highest place at a level move with the coefficients."""
        at = np.flatnonzero(f >= level)[[0, -1]]
        sides = basis_matrix(knots, 3, (eta[at] + 0.5) * spans)
        low, high = (level * top - sides) / slope[at, None]
        return low, high

    def std(of: Array, known: float) -> float:
        return math.sqrt(max(float(of @ covariance @ of) - known, 0.0))

    (low, high), (left, right) = moved(0.5), moved(_TOP)
    blur = median(seen.blur)
    half = math.hypot(
        std(high - low, section.half_height_width**2 * common[1]), _HALF_BLUR[exact] * blur, gap
    )
    foot = math.hypot(_FOOT_STD, _FOOT_BLUR[exact] * blur)
    height = (_TOP_OFF if exact else 1.0) * std(top, common[0])
    return SectionStd(height, half, math.hypot(half, foot), std(0.5 * (left + right), common[2]))
