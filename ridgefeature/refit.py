"""A ridge fitted as a whole: begun, looked for beyond its ends, cut where its points do not hold it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.astray import SHORTEST, as_wide_as_usual, core_of, longest_part
from ridgefeature.grid import Grid
from ridgefeature.held_ends import held
from ridgefeature.joint import FOUND, MOST_POINTS, SOME_POINTS, Joint, fit_whole, with_common_errors
from ridgefeature.joint_rounds import is_steep
from ridgefeature.joint_stations import stations_of, with_section_std
from ridgefeature.kernels.strip import A, C, E, H, W
from ridgefeature.medians import median
from ridgefeature.own_beginning import as_ring
from ridgefeature.path_frame import PathFrame, path_frame
from ridgefeature.section import Section
from ridgefeature.settings import Settings
from ridgefeature.stations import Stations
from ridgefeature.whole_ends import BEYOND, end_interval, ends_of

Array = NDArray[np.float64]

_FAR, _GROWN, _MOSTLY = 0.5, 3.0, 0.9
_FIRST_ROUNDS, _LAST_ROUNDS = 4, 3
_GROWTHS, _MUCH = 20, 0.3
"""How often the ends are looked for further out; by how many widths one must have moved for that."""
CORRELATED = 2.5
"""Variance of sums over neighbouring points, by that of independent noise, beyond which a ridge or its ground
is not of the shape that the model has."""
_MANY_STRAYS = 0.1
"""Share of strays from which on a steep ridge may not be of the shape that its fit began with."""
_CUTS = 2
"""How often an end that its points do not hold is cut."""


@dataclass(frozen=True, eq=False)
class Refit:
    """Stations of a ridge fitted as a whole, and the fit; None where there are too few points for one."""

    stations: Stations
    joint: Joint | None = None
    end_interval: Array | None = None
    """(2, 2) as in Ridge."""
    closed: bool = False
    flat: bool = False
    """Whether the base was taken for flat across."""
    sound: bool = True
    """Whether one fit goes along all stations."""


def refitted(
    grid: Grid,
    stations: Stations,
    section: Section,
    closed: bool,
    open_ends: tuple[bool, bool],
    settings: Settings,
    pick: Array | None = None,
) -> Refit:
    """The stations fitted again as a whole; as they were where there are too few points.

    open_ends: which ends may move, further out or back; pick (3,): where the ridge is known to be. Where no
    sound fit goes along all stations, the march went astray: then along those that are alike, the pick among
    them or not.
    """
    found, sound = _refitted(grid, stations, section, closed, open_ends, settings, pick)
    core = None if sound or closed else core_of(stations) or _sound_part(grid, stations, section, settings)
    if core is not None:
        again, sound = _refitted(grid, core, section, closed, (True, True), settings, None)
        found = again if sound else found
    return _as_known(found, settings) if sound else replace(found, sound=False)


def _as_known(found: Refit, settings: Settings) -> Refit:
    """The same ridge as smooth, and as sure, as errors that its points have in common leave it.

    Only now: an end that runs into something else is told by terms that follow its points. Where most of the
    points have much in common it is the ridge that is not of the model's shape: then its terms stay.
    """
    joint = found.joint
    if joint is None:
        return found
    again = with_common_errors(joint, settings, found.flat)
    if again is None or not _sound(again):
        again = joint
    elif again.inflation > CORRELATED:
        again = joint.less_sure(again.inflation)
    return replace(found, joint=again, stations=stations_of(again, len(found.stations.arc_length), settings))


def _refitted(
    grid: Grid,
    stations: Stations,
    section: Section,
    closed: bool,
    open_ends: tuple[bool, bool],
    settings: Settings,
    pick: Array | None,
) -> tuple[Refit, bool]:
    """The same of all these stations, and whether it is sound to the end.

    If so, the stations are those that the last fit went along: where it leads is laid out once, at the end.
    """
    flat = settings.flat
    if not closed:
        stations = as_wide_as_usual(stations, open_ends)
    stations, first = _first(grid, stations, section, closed, settings, flat)
    if first is None:
        return Refit(stations, closed=closed), False
    if not stations.curvature.any() and not first.bent:
        flat = True
        first = first.without(C)
    laid, intervals = stations_of(first, len(stations.arc_length), settings, known=True), None
    if not closed and any(open_ends):
        laid, intervals, first = _grown(grid, laid, first, open_ends, settings, flat, pick)
        ring = as_ring(laid)
        if ring is not None:
            laid, intervals, closed = ring, None, True
    joint = _fit(grid, path_frame(laid, closed), first.section, settings, first, flat, True)
    if joint is None:
        return Refit(with_section_std(laid, first), first, intervals, closed), False
    found = Refit(laid, joint, intervals, closed, flat)
    return found if closed else _held(grid, found, open_ends, settings, flat, pick), True


def _held(
    grid: Grid,
    found: Refit,
    open_ends: tuple[bool, bool],
    settings: Settings,
    flat: bool,
    pick: Array | None,
) -> Refit:
    """The open ridge cut at ends that its points do not hold, and fitted again without what lies beyond."""
    for _ in range(_CUTS):
        joint, known = found.joint, found.stations.arc_length
        if joint is None:
            break
        start, end = held(joint, open_ends, _place(joint.path, pick))
        length = end - start
        if length >= known[-1] or length < SHORTEST * median(joint.terms[:, W]):
            break
        count = max(round(length / known[1]) + 1, 13)
        laid = stations_of(joint, count, settings, (start, end), known=True)
        again = _fit(grid, path_frame(laid, False), joint.section, settings, joint, flat)
        if again is None:
            break
        intervals = found.end_interval
        if intervals is not None:
            intervals = intervals - start
            intervals[:, 0] = np.minimum(intervals[:, 0], (0.0, length))
            intervals[:, 1] = np.maximum(intervals[:, 1], (0.0, length))
            intervals.setflags(write=False)
        found = Refit(laid, again, intervals, False, flat)
    return found


def _grown(
    grid: Grid,
    laid: Stations,
    joint: Joint,
    open_ends: tuple[bool, bool],
    settings: Settings,
    flat: bool,
    pick: Array | None,
) -> tuple[Stations, Array | None, Joint]:
    """Stations between the ends, these ends' intervals, and the fit that told them.

    A ridge that is seen further out than the march went may go on beyond what was looked at.
    """
    for _ in range(_GROWTHS):
        laid, intervals, moved = _between_ends(grid, laid, joint, open_ends, settings, flat, pick)
        if max(moved) < _MUCH * median(laid.width) or as_ring(laid):
            break
        again = _fit(grid, path_frame(laid, False), joint.section, settings, joint, flat)
        if again is None:
            break
        joint, laid = again, stations_of(again, len(laid.arc_length), settings, known=True)
    return laid, intervals, joint


def _place(path: PathFrame, pick: Array | None) -> float | None:
    """The arc length at which a path is nearest to the pick."""
    return None if pick is None else float(path.at[np.argmin(((path.origin - pick) ** 2).sum(axis=1))])


def _first(
    grid: Grid, stations: Stations, section: Section, closed: bool, settings: Settings, flat: bool
) -> tuple[Stations, Joint | None]:
    """The first fit, and stations of the path that it went along.

    What a steep ridge is taken for to begin with, a box, may be far from what it is: if many points are
    strays then, it is fitted as one that is not steep, too.
    """
    path = path_frame(stations, closed)
    if not is_steep(path) or settings.section not in FOUND:
        return stations, _fit(grid, path, section, settings, None, flat)
    upright, own = _upright(grid, stations, path, section, settings, flat)
    first = _fit(grid, path_frame(upright, closed), own, settings, None, flat)
    if first is not None and first.noise.strays < _MANY_STRAYS:
        return upright, first
    gentle = fit_whole(grid, path, section, settings, None, _FIRST_ROUNDS, flat, SOME_POINTS, gentle=True)
    if gentle is None or not _sound(gentle) or (first is not None and first.chance > gentle.chance):
        return upright, first
    return stations, gentle


def _upright(
    grid: Grid, stations: Stations, path: PathFrame, section: Section, settings: Settings, flat: bool
) -> tuple[Stations, Section]:
    """Stations and section as the fit of a steep ridge begins: high flanks lean where its base is wrong."""
    begun = fit_whole(grid, path, section, settings, None, 0, flat, SOME_POINTS)
    if begun is None or not _sound(begun):
        return stations, section
    if not stations.curvature.any() and not begun.bent:
        begun = begun.without(C)
    return stations_of(begun, len(stations.arc_length), settings, known=True), begun.section


def _fit(
    grid: Grid,
    path: PathFrame,
    section: Section,
    settings: Settings,
    before: Joint | None,
    flat: bool,
    brief: bool = False,
) -> Joint | None:
    """The whole fit along a path, if it is sound; brief: as for `fit_whole`."""
    rounds, most = (_FIRST_ROUNDS, SOME_POINTS) if before is None else (_LAST_ROUNDS, MOST_POINTS)
    joint = fit_whole(grid, path, section, settings, before, rounds, flat, most, brief=brief)
    return joint if joint is not None and _sound(joint) else None


def _between_ends(
    grid: Grid,
    stations: Stations,
    joint: Joint,
    open_ends: tuple[bool, bool],
    settings: Settings,
    flat: bool,
    pick: Array | None,
) -> tuple[Stations, Array | None, tuple[float, float]]:
    """The stations between the ends that all points along the path tell, and these ends' intervals; by how
    much both ends moved out."""
    length = float(stations.arc_length[-1])
    far = [BEYOND * float(stations.width[k]) if open_ends[-k] else 0.0 for k in (0, -1)]
    path = path_frame(stations, False, (far[0], far[1]))
    fixed = replace(settings, section="bell")  # kept as it is
    wide = fit_whole(grid, path, joint.section, fixed, joint, 2, flat, SOME_POINTS)
    if wide is None or not np.isfinite(wide.terms).all():
        return stations, None, (0.0, 0.0)
    start, end = ends_of(wide, joint, 0.0, length, open_ends, settings.look_ahead, _place(path, pick))
    if end - start < SHORTEST * median(stations.width):
        return stations, None, (0.0, 0.0)
    intervals = np.array([end_interval(wide, start, -1), end_interval(wide, end, 1)]) - start
    intervals[~np.array(open_ends)] = np.nan
    intervals.setflags(write=False)
    if (start, end) == (0.0, length):
        return stations, intervals, (0.0, 0.0)
    count = int(np.clip(round((end - start) / length * (len(stations.arc_length) - 1)) + 1, 13, 401))
    return stations_of(wide, count, settings, (start, end), known=True), intervals, (-start, end - length)


def _sound_part(grid: Grid, stations: Stations, section: Section, settings: Settings) -> Stations | None:
    """The stations where a fit along all of them is still about the ridge that it began with, if enough."""
    path = path_frame(stations, False)
    joint = fit_whole(grid, path, section, settings, None, _FIRST_ROUNDS, settings.flat, SOME_POINTS)
    if joint is None:
        return None
    good = np.interp(stations.arc_length, path.at, _sound_at(joint)) > 0.5
    return longest_part(stations, good)


def _sound(joint: Joint) -> bool:
    """Whether a fit is still about the ridge that it began with."""
    finite = np.isfinite(joint.terms).all() and np.isfinite(joint.smooth.covariance).all()
    return bool(finite) and float(_sound_at(joint).mean()) > _MOSTLY


def _sound_at(joint: Joint) -> NDArray[np.bool_]:
    """At which nodes (n,) of its path it is."""
    path, terms = joint.path, joint.terms
    aside = np.abs(terms[:, E]) < _FAR * path.width
    level = np.abs(terms[:, A]) < _FAR * path.width + np.abs(path.height)
    grown = terms[:, H] / np.where(path.height == 0, 1.0, path.height)
    return np.asarray(aside & level & (grown > 1 / _GROWN) & (grown < _GROWN))
