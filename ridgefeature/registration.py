"""Registration from one picked point to a finished ridge: GUESS, march, ends, settling, CONSTRUCT."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ridgefeature.alternatives import distinct
from ridgefeature.asked import hints_of, positive, settings_of, text_of, vector_of, warned
from ridgefeature.attempts import NoRidgeError, RefusedError, ridge_meant
from ridgefeature.distance import sampling_floor
from ridgefeature.ends import place_ends
from ridgefeature.follows import told_ends
from ridgefeature.grid import Grid, build_grid, nearest, nearest_distance, nearest_distances, typical_spacing
from ridgefeature.guess import guess
from ridgefeature.improve import sample
from ridgefeature.learn import choose_section, first_section, in_doubt, march_section, resettled
from ridgefeature.march import Progress, Track, march, reverse
from ridgefeature.medians import median
from ridgefeature.onward import followed, open_ends
from ridgefeature.ridge import Ridge
from ridgefeature.rings import CLOSED, ring_or_not
from ridgefeature.scan import Scan, as_scan
from ridgefeature.settings import Settings
from ridgefeature.settle import finish_ends, settle, settle_base
from ridgefeature.starts import Hints
from ridgefeature.stations import lay_out
from ridgefeature.template import STEEP, Template
from ridgefeature.valley import fitted_over_ground
from ridgefeature.verdict import no_ridge, no_whole_ridge, too_large
from ridgefeature.window import Window

Array = NDArray[np.float64]
_STANDS_OUT = 0.5
"""What must be left, on a curved base, of how much better steep flanks explain points than other surfaces."""
_ADVICE = "pick a point on the ridge, or give direction=, width= and height= as a start"
_ROUGH_POINTS = 400
_NEAR = 100
_CLUSTERED = 1.6
"""What a spacing by density is, in the median distance to the nearest point, where points lie in clusters or
lines; on an even surface it is 0.5 (grids) to 1.25."""


def register(
    scan: Scan | ArrayLike,
    at: ArrayLike,
    *,
    direction: ArrayLike | None = None,
    width: float | None = None,
    height: float | None = None,
    kind: str = "ridge",
    roi: float | None = None,
    max_templates: int | None = None,
    settings: Settings | None = None,
    progress: Progress | None = None,
) -> Ridge:
    """Register the ridge under one picked point.

    scan: a Scan or an (n, 3) array of unordered points. at (3,): the pick, on or near the ridge, in the
    scan's frame. Starting guesses, all optional: direction (3,) along the ridge, in which arc length then
    ascends; width between the feet; height of the apex. kind: "ridge", "groove" (negative height) or "auto".
    roi: radius about the pick beyond which points are not looked at. progress: called with every template the
    march adds. The same points in any order give the same ridge, bit for bit. Raises NoRidgeError where the
    data agree with a flat base, ValueError for bad input. An interrupt (Ctrl-C) ends the march and keeps what
    is there.
    """
    scan = as_scan(scan)
    pick = vector_of(at, "at")
    hints = hints_of(direction, width, height, kind)
    settings = settings_of(settings, max_templates)
    if roi is not None:
        scan = scan.crop(pick, positive(roi, "roi"))
    grid = build_grid(scan.points, scan.bounds)
    spacing = _spacing(grid, pick)
    extent = spacing / 0.47 * np.sqrt(len(scan.points))
    _check_pick(grid, pick, spacing, extent)
    full = Window(grid, spacing)
    rough = full.thinned(_ROUGH_POINTS)

    def attempt(hints: Hints, reach: float, aimed: bool = True, high: bool = False) -> Ridge:
        track = _track(rough, full, pick, extent, hints, settings, progress, reach, aimed, high)
        return _constructed(rough, full, _directed(track, pick, hints), settings, scan, pick, extent)

    return warned(ridge_meant(attempt, extent, hints), pick, direction)


def _constructed(
    rough: Window, full: Window, track: Track, settings: Settings, scan: Scan, pick: Array, extent: float
) -> Ridge:
    """The ridge of a settled march: fitted as a whole, where templates are fitted by residuals."""
    section, intervals, grid = track.templates[0].section, None, full.grid
    stations = lay_out(track.templates, settings, track.closed)
    closed, stop = track.closed, track.stop
    if settings.measure == "residual":
        found = fitted_over_ground(grid, stations, section, closed, open_ends(stop), settings, pick)
        found, track = followed(rough, full, found, track, settings, pick)
        stations, intervals, stop = found.stations, found.end_interval, track.stop
        section = section if found.joint is None else found.joint.section
        if found.closed:
            closed, stop = True, (CLOSED, CLOSED)
        why = no_whole_ridge(found.sound, stations, stop, extent, settings)
        if why:
            raise RefusedError(f"no ridge at {text_of(pick)}: {why}; {_ADVICE}", track.templates[0].width)
    return Ridge(
        **vars(stations),
        section=section,
        templates=_with_distances(track.templates, grid),
        stop=told_ends(full.grid, stations, stop),
        closed=closed,
        end_interval=intervals,
        unit=scan.unit,
        pick=pick,
        settings=settings,
        source=scan.source,
    )


def _track(
    rough: Window,
    full: Window,
    pick: Array,
    extent: float,
    hints: Hints,
    settings: Settings,
    progress: Progress | None,
    reach: float,
    aimed: bool = True,
    high: bool = False,
) -> Track:
    """The whole fit: march, ends placed, templates settled; settled again where another section is better.

    reach: as far as ridges are looked for about the pick, `settings.widest` parts of which are their widths;
    aimed, high: as for `guess`.
    """
    first = guess(rough, pick, reach, hints, first_section(settings), settings, aimed, high)
    if first is None or first.evidence < settings.evidence:
        found = "none" if first is None else f"{max(first.evidence, 0.0):.1f}"
        raise NoRidgeError(
            f"no ridge at {text_of(pick)}: the points around it agree with a flat base (evidence {found}, "
            f"needed {settings.evidence:g}); pick a point on the ridge, or give direction=, width= and "
            "height= as a start"
        )
    first = _canonical(full, march_section(rough, first, settings), pick, hints)
    track = ring_or_not(full, march(rough, full, first, settings, progress), settings)
    track = place_ends(full, track, settings)
    track = _on_base(rough, full, settle(full, track, settings), settings)
    track = finish_ends(full, track, settings)
    height, width = (np.array([getattr(t, name) for t in track.templates]) for name in ("height", "width"))
    why = too_large(height, width, extent, settings)
    if why:
        raise RefusedError(f"no ridge at {text_of(pick)}: {why}; {_ADVICE}", first.width, True)
    why = no_ridge(rough, track, pick, settings)
    if why:
        raise RefusedError(f"no ridge at {text_of(pick)}: {why}; {_ADVICE}", first.width)
    settled = settings.measure == "M" or (
        track.misfit is not None and not in_doubt(track.misfit, track.templates)
    )
    if settings.section == "auto" and settled:
        return track
    section = choose_section(full, track.templates, settings)
    if section is track.templates[0].section:
        return track
    return resettled(full, track, section, settings)


def _on_base(rough: Window, full: Window, track: Track, settings: Settings) -> Track:
    """The settled track on its curved base, if it has one and steep flanks are not explained away by it."""
    bent = settle_base(full, track, settings)
    usual = median([abs(t.height) / t.width for t in track.templates])
    if usual < STEEP or not any(t.curved for t in bent.templates):
        return bent
    before, now = (sum(distinct(rough, t, settings) for t in x.templates) for x in (track, bent))
    return bent if now > _STANDS_OUT * before else track


def _canonical(window: Window, first: Template, pick: Array, hints: Hints) -> Template:
    """The first template the way up that its kind asks for, and facing where the ridge rises.

    Neither depends on how the scan is turned: a ridge and a groove differ by the side that is called up, and
    a march both ways would else start either way.
    """
    if hints.kind != "auto" and (first.height < 0) != (hints.kind == "groove"):
        first = first.changed(
            rotation=first.rotation * np.array([1.0, -1.0, -1.0]),
            height=-first.height,
            base=first.base * np.array([-1.0, 1.0, -1.0]),
        )
    x, _, z = window(first).T
    return reverse(first) if x @ z * first.height < 0 else first


def _directed(track: Track, pick: Array, hints: Hints) -> Track:
    """The track in the hinted direction, else starting at the end nearer to the pick."""
    first, last = track.templates[0], track.templates[-1]
    nearest = min(track.templates, key=lambda t: float(np.linalg.norm(t.position - pick)))
    if hints.direction is not None:
        backwards = bool(nearest.rotation[:, 0] @ hints.direction < 0)
    elif track.closed:
        backwards = False
    else:
        backwards = bool(np.linalg.norm(last.end - pick) < np.linalg.norm(first.start - pick))
    if not backwards:
        return track
    turned = tuple(reverse(t) for t in reversed(track.templates))
    return replace(track, templates=turned, stop=(track.stop[1], track.stop[0]))


def _with_distances(templates: tuple[Template, ...], grid: Grid) -> tuple[Template, ...]:
    """The templates with M, their mean distance to the scan, and what it would be for a perfect patch."""
    distances = nearest_distances(grid, np.concatenate([sample(t, 6, 12) for t in templates]))
    means = distances.reshape(len(templates), -1).mean(axis=1)
    floors = [sampling_floor(max(t.points, 1) / (2 * t.half_breadth * t.length)) for t in templates]
    return tuple(
        t.changed(M=float(m), M_floor=float(floor))
        for t, m, floor in zip(templates, means, floors, strict=True)
    )


def _spacing(grid: Grid, pick: Array) -> float:
    """Median distance between neighbours near the pick: the same however the scan is turned.

    Where points lie in pairs, clusters or lines, that tells nothing of how far they are from such of others:
    then it is what points strewn as densely over a surface have. Raises ValueError where points are repeated
    so often that no spacing can be told.
    """
    near = nearest(grid, pick[None], min(_NEAR, len(grid.points)))[1][0]
    apart = nearest_distances(grid, near, 2)[:, 1]
    spacing = median(apart[apart > 0]) if (apart > 0).any() else typical_spacing(grid)
    if not spacing > 0:
        raise ValueError(
            "scan: expected points that lie apart, got most of them repeated; drop the repeated ones"
        )
    if len(near) < _NEAR:
        return spacing
    strewn = 0.5 * float(np.linalg.norm(near - near[0], axis=1).max()) * np.sqrt(np.pi / _NEAR)
    return strewn if strewn > _CLUSTERED * spacing else spacing


def _check_pick(grid: Grid, pick: Array, spacing: float, extent: float) -> None:
    gap = nearest_distance(grid, pick)
    if gap > max(10 * spacing, 0.05 * extent):
        raise ValueError(
            f"at: expected a point on or near the scan, got {text_of(pick)}, "
            f"{gap:.4g} from the nearest point; pick a point of the scan"
        )
