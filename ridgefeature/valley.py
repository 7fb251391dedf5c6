"""Ridges in valleys: what rises beyond the valleys beside a ridge is other ground than it stands on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.grid import Grid
from ridgefeature.medians import median
from ridgefeature.refit import CORRELATED, Refit, refitted
from ridgefeature.section import Section
from ridgefeature.settings import Settings
from ridgefeature.stations import Stations

Array = NDArray[np.float64]

_DEEP = 0.1
"""Depth of a hollow base under the spine, below its feet and in heights, from which on it is in doubt."""
_WORSE = 2.0
"""Noise on the level base, in that on the hollow one, beyond which this one stays."""
_FLANK = 0.1
"""Breadth of the flanks, in widths, that are looked at beside a ridge in a valley."""


def fitted_over_ground(
    grid: Grid,
    stations: Stations,
    section: Section,
    closed: bool,
    open_ends: tuple[bool, bool],
    settings: Settings,
    pick: Array | None = None,
) -> Refit:
    """The stations fitted again as a whole, as `refitted` does it, over the ground that the feet stand on.

    Slopes beyond the valleys on both sides of a ridge make a parabola of the base, which passes below these
    valleys. On a pipe's inside it is one: there the points say so within their noise. Where their misfit is
    correlated, and a level base close to the feet fits as well, that is taken.
    """
    told = closed, open_ends
    found = refitted(grid, stations, section, *told, settings, pick)
    if settings.flat or found.joint is None or found.joint.inflation < CORRELATED or not _hollow(found):
        return found
    near = replace(settings, base_chance=0.5, flank=min(_FLANK, settings.flank))
    level = refitted(grid, replace(stations, curvature=np.zeros(0)), section, *told, near, pick)
    if level.joint is None or level.joint.noise.scale > _WORSE * found.joint.noise.scale:
        return found
    return level


def _hollow(found: Refit) -> bool:
    """Whether the base curves up from the spine to both feet, by a part of the height."""
    at = found.stations
    return median(at.curvature * at.width**2 / (8.0 * at.height)) > _DEEP
