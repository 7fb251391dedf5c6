"""Ridge or no ridge: whether what was found beats a smooth surface, a step and a crease."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.alternatives import distinct
from ridgefeature.march import GOES_ON, Track
from ridgefeature.medians import median
from ridgefeature.settings import Settings
from ridgefeature.stations import Stations
from ridgefeature.window import Window

Array = NDArray[np.float64]

_ERRATIC, _FEWEST = 0.3, 4
"""Change of the width, as a logarithm, from template to template from which on they follow no ridge; and the
fewest templates that tell it: those of ridges differ by up to 0.2."""
_UNKNOWN = 0.5
"""Standard deviation of the height, in heights, beyond which most of a ridge is not told from its base."""


def too_large(height: Array, width: Array, extent: float, settings: Settings) -> str:
    """Why heights and widths (n,) are those of the scan itself, or of a mere fin; empty if of neither."""
    usual = median(width)
    if usual > settings.widest * extent:
        return f"what rises there is {usual:.4g} wide, on a scan of about {extent:.4g}"
    return _fin(height, usual, settings)


def too_short(length: float, width: Array, stop: tuple[str, str], settings: Settings) -> str:
    """Why what ends at both ends is too short for a ridge of widths (n,); empty if it is not."""
    usual = median(width)
    if any(why.startswith(GOES_ON) for why in stop) or length >= settings.shortest * usual:
        return ""
    return f"what rises there is {length:.4g} long and {usual:.4g} wide"


def erratic(width: Array) -> str:
    """Why templates of widths (n,), in their order, follow several things and no ridge; empty if one does."""
    change = median(np.abs(np.diff(np.log(width)))) if len(width) >= _FEWEST else 0.0
    if change <= _ERRATIC:
        return ""
    return f"what rises there changes its width by {np.expm1(change):.0%} from template to template"


def _fin(height: Array, width: float, settings: Settings) -> str:
    """Why heights on so wide a foot are a mere fin's, as of an edge that is taken for a ridge; else empty."""
    usual = median(np.abs(height))
    return (
        f"what rises there is {usual:.4g} high and {width:.4g} wide"
        if usual > settings.steepest * width
        else ""
    )


def no_ridge(window: Window, track: Track, pick: np.ndarray, settings: Settings) -> str:
    """Why what was found is no ridge; empty if it is one.

    Templates are asked from the pick on until they outweigh chance. A ridge that is found whole must be
    longer than wide.
    """
    templates = track.templates
    width = np.array([t.width for t in templates])
    why = too_short(sum(t.length for t in templates), width, track.stop, settings) or erratic(width)
    if why:
        return why
    order = sorted(templates, key=lambda t: float(np.linalg.norm(t.position - pick)))
    evidence = 0.0
    for template in order:
        evidence += distinct(window, template, settings)
        if evidence >= settings.distinct:
            return ""
    return f"a smooth surface or an edge explains it as well (evidence {evidence:.1f})"


def no_whole_ridge(
    sound: bool, stations: Stations, stop: tuple[str, str], extent: float, settings: Settings
) -> str:
    """Why what was fitted as a whole is no ridge, though its templates looked like one; empty if it is one.

    sound: whether a fit of the whole holds the templates together. Each may explain its window, as about a
    body that bends away on all sides.
    """
    if not sound:
        return "no ridge goes through all of what was found there"
    return (
        unknown_height(stations)
        or too_large(stations.height, stations.width, extent, settings)
        or too_short(float(stations.arc_length[-1]), stations.width, stop, settings)
    )


def unknown_height(stations: Stations) -> str:
    """Why a fitted ridge is none after all: its height is hardly known, or its width none; else empty.

    Where a fit went through something else its standard deviations are about as large as the height.
    """
    if not (stations.width > 0).all():
        return f"the width of what was fitted there falls to {stations.width.min():.4g}"
    height, std = np.abs(stations.height), stations.height_std
    told = np.isfinite(std)
    if not told.any() or median(std[told] / np.maximum(height[told], 1e-300)) <= _UNKNOWN:
        return ""
    found, known = median(height), median(std[told])
    return f"the height of what was fitted there, {found:.4g}, is known to {known:.4g} only"
