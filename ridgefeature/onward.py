"""A ridge that was fitted as a whole marched on from its ends: its section and width are known by then.

A march begins with a bell, which is too wide on most other sections: its templates are too long for sharp
bends, and on steep flanks they see ends that are none.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from ridgefeature.continuation import USUAL
from ridgefeature.ends import place_ends
from ridgefeature.improve import improve, judge
from ridgefeature.joint import Joint, least_noise
from ridgefeature.kernels.algebra import facing
from ridgefeature.march import CAME_HOME, GOES_ON, INTERRUPTED, Track, march_one_way, reverse
from ridgefeature.medians import median
from ridgefeature.refit import Refit
from ridgefeature.section import Section
from ridgefeature.settings import Settings
from ridgefeature.stations import Stations, lay_out
from ridgefeature.template import Template
from ridgefeature.valley import fitted_over_ground
from ridgefeature.window import Window

Array = NDArray[np.float64]

_NEAR, _FAR = 0.3, 1.0
"""Distances from an end, in widths, of points that tell whether anything as high as the ridge is there."""
_HIGH = (0.5, 1.5)
"""Their heights, in that at the end."""
_SHARE = 0.5
"""Number of those beyond the end, in that of those on the ridge, from which on it may go on."""
_FADED = 0.3
"""Height before an end, in that of the ridge, below which it has faded there."""
_FEWEST = 3
_BESIDE = 0.5
"""Distance from the spine, in widths, up to which such points lie on the ridge."""
_TIMES = 3
"""How often a ridge is marched on."""
_UNLIKE = 1.6
"""Factor between sizes of a template and those known of the ridge from which on it is none of it."""
_LONGER, _ADDED, _NOISIER = 0.3, 0.4, 1.5
"""Least growth of a ridge that was marched on, and distance from what was known that tells what was added, in
widths; most squared distance of points there, in that before."""


def open_ends(stop: tuple[str, str]) -> tuple[bool, bool]:
    """Which ends a march left open for the whole fit, by the reasons why it stopped.

    One that came home grows until it meets its beginning.
    """
    first, last = (why == CAME_HOME or not why.startswith(GOES_ON) for why in stop)
    return first, last


def followed(
    rough: Window, full: Window, found: Refit, track: Track, settings: Settings, pick: Array | None = None
) -> tuple[Refit, Track]:
    """The ridge fitted as a whole, marched on from its ends and fitted again while it goes on there.

    pick: as for `refitted`. The track with the templates that were added, and why it stopped then.
    """
    for _ in range(_TIMES):
        if found.joint is None or found.closed:
            break
        section = found.joint.section
        on = _marched_on(rough, full, found.stations, section, track, settings)
        if on is None:
            break
        chain, new = on
        ends = open_ends(new.stop)
        again = fitted_over_ground(full.grid, lay_out(chain, settings), section, False, ends, settings, pick)
        if not _better(again, found):
            break
        found, track = again, new
    return found, track


def _better(again: Refit, before: Refit) -> bool:
    """Whether a ridge that was marched on is a longer one whose points fit there as well as before.

    What it ran into does not: the edge of a plate, a blob, another ridge.
    """
    if again.joint is None or before.joint is None:
        return False
    known, width = before.stations, median(before.stations.width)
    growth = again.stations.arc_length[-1] - known.arc_length[-1]
    apart = np.linalg.norm(again.joint.path.origin[:, None] - known.spine, axis=2).min(axis=1)
    added = np.minimum(apart[1:], apart[:-1]) > _ADDED * width
    if growth < _LONGER * width or not added.any():
        return False
    return _square(again.joint, added) < _NOISIER * _square(before.joint, np.s_[:])


def _square(joint: Joint, stretches: NDArray[np.bool_] | slice) -> float:
    """Mean squared distance of the points of stretches from the surface, in most of them: an end may lie a
    little too far out."""
    count, squares = joint.misfit[stretches, :2].T
    seen = count > 0
    usual = median(squares[seen] / count[seen]) if seen.any() else 0.0
    return usual * max(joint.noise.scale, least_noise(joint.terms)) ** 2


def _marched_on(
    rough: Window, full: Window, stations: Stations, section: Section, track: Track, settings: Settings
) -> tuple[tuple[Template, ...], Track] | None:
    """Templates along stations and beyond, and the track with what was added; None where nothing was."""
    is_open = open_ends(track.stop)
    ends = [is_open[k] and _goes_on(full, stations, -k, section, settings) for k in (0, 1)]
    if not any(ends):
        return None
    chain, templates, stop = _along(stations, section, settings), list(track.templates), list(track.stop)
    before = len(chain)
    for k in (1, 0):
        if ends[k]:
            found, stop[k] = _march(rough, full, chain, settings)
            chain = [*chain, *found]
            templates = [*templates, *(judge(full(t), t, settings) for t in found)]
        chain, templates = [[reverse(t) for t in reversed(ts)] for ts in (chain, templates)]
    if len(chain) == before:
        return None
    return tuple(chain), replace(track, templates=tuple(templates), stop=(stop[0], stop[1]))


def _march(
    rough: Window, full: Window, chain: list[Template], settings: Settings
) -> tuple[list[Template], str]:
    """The templates that follow a chain, and why there are no more."""
    settings = settings.marching()
    near = [improve(rough, t, settings) for t in chain[-USUAL:]]
    # Their places are known better than from one window alone.
    judged = [
        t.changed(scale=fit.scale, evidence=fit.evidence, points=fit.points)
        for t, fit in zip(chain[-USUAL:], near, strict=True)
    ]
    known, found, why = [*chain[:-USUAL], *judged], list[Template](), INTERRUPTED
    with suppress(KeyboardInterrupt):
        why = march_one_way(rough, full, known, found, settings)
    found = list(takewhile(lambda t: _alike(t, chain), found))
    whole = Track((*known, *found), (INTERRUPTED, why))
    return list(place_ends(full, whole, settings).templates[len(known) :]) if found else found, why


def _alike(template: Template, chain: list[Template]) -> bool:
    """Whether a template is not much higher, nor much wider or narrower, than all of the ridge so far."""
    tallest = max(abs(t.height) for t in chain)
    widths = [t.width for t in chain]
    return abs(template.height) < _UNLIKE * tallest and (
        min(widths) / _UNLIKE < template.width < _UNLIKE * max(widths)
    )


def _along(stations: Stations, section: Section, settings: Settings) -> list[Template]:
    """Templates one behind the other along stations, the last one up to their end."""
    end = float(stations.arc_length[-1])
    chain: list[Template] = []
    while not chain or end > 0.5 * chain[-1].length:
        width = float(np.interp(end, stations.arc_length, stations.width))
        length = min(settings.length * width, end)
        chain.append(_template(stations, end - 0.5 * length, section, settings).changed(length=length))
        end -= length
    return chain[::-1]


def _template(stations: Stations, place: float, section: Section, settings: Settings) -> Template:
    """The template over stations about an arc length."""

    def there(values: Array) -> Array:
        return np.array([np.interp(place, stations.arc_length, v) for v in values.T])

    normal = there(stations.normal)
    width = float(np.interp(place, stations.arc_length, stations.width))
    return Template(
        position=there(stations.spine),
        rotation=facing(normal / np.linalg.norm(normal), there(stations.tangent)),
        width=width,
        height=float(np.interp(place, stations.arc_length, stations.height)),
        length=settings.length * width,
        flank=settings.flank * width,
        section=section,
        status="known",
    )


def _goes_on(window: Window, stations: Stations, last: int, section: Section, settings: Settings) -> bool:
    """Whether points beyond an end lie as high as the ridge there, about as many as on it.

    last: the station at the end. Beyond: ahead, or, at a sharp bend, beside the ridge. As high as it was over
    the width before; one that has faded was followed by the whole fit.
    """
    s, w = stations.arc_length, float(stations.width[last])
    near = np.abs(s - s[last]) < _FAR * w
    height = median(stations.height[near])
    if abs(height) < _FADED * abs(median(stations.height)):
        return False
    end = _template(stations, float(s[last]), section, settings)
    points = window(end.changed(height=height, length=2.0 * _FAR * w, flank=(_FAR - 0.5) * w))
    r = np.hypot(points[:, 0], points[:, 1])
    z = points[:, 2] / height
    points = points[(z > _HIGH[0]) & (z < _HIGH[1]) & (r > _NEAR * w) & (r < _FAR * w)]
    spine = (stations.spine[near] - end.position) @ end.rotation
    apart = np.linalg.norm(points[:, None, :2] - spine[:, :2], axis=2)
    nearest = apart.argmin(axis=1)
    outside = nearest == (0 if last == 0 else len(spine) - 1)
    on = (apart.min(axis=1) < _BESIDE * w) & ~outside
    return bool((~on).sum() > max(_SHARE * on.sum(), _FEWEST))
