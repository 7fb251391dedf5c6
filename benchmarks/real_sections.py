"""What the points of real scans show across known tracks, beside what was read off and what is registered.

    python benchmarks/real_sections.py SCANS [--out DIR] [--only NAME] [--page FILE]

SCANS is a folder as benchmarks/real_clicks.py has it. The points' own estimate uses no fit and no section: at
places along the track a slab of points is cut across it, half the read width to either side; heights over the
ground are medians in bins of a tenth of the read width. A foot is on either side the bin furthest below the
chord from the top to the bin at the reach; the base is the straight line between both feet, which is then
turned level. Height is that of the top over it, width that between the places at half of that height; where
bins are empty there it is known only between two values, and both are told. Medians over 25 places. DIR gets
a picture a track: points, their medians, feet and width; the registered section; and the read height and
width, on the same base. FILE gets one page of the tracks whose registered height or width is out of the
limits (10 %, 15 %) about what was read. Deterministic.
Of a curved body the ground between the feet bulges above that line: there a registered height is lower.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from real_clicks import Track, even, tracks

import ridgefeature as rf

Array = NDArray[np.float64]
BIN, REACH, ENOUGH, PLACES, PICTURES, A_ROW = 0.1, 1.6, 3, 25, 6, 4
LIMITS = 0.10, 0.15
_AHEAD = 0.05
"""Part of the track ahead and behind that tells its direction."""
_TALL = 2.5
"""Heights above and below the crest up to which points belong to the slab."""
_GROUND = 2.0
"""Radius in read widths of the points that tell which way is up, to begin with."""


@dataclass(frozen=True, eq=False)
class Across:
    """Points about one place in a frame level with their feet: y, z (m, 2), lengths of the scan."""

    origin: Array
    axes: Array
    """(3, 3) columns along, left, up."""
    points: Array
    middles: Array
    """(n,) middles of the bins, and in `medians` the height there, NaN where there are few points."""
    medians: Array
    feet: tuple[int, int]
    top: int
    sides: tuple[float, float, float, float]
    """Where the height is half: left outer and inner, right inner and outer bound."""

    @property
    def base(self) -> float:
        return float(np.mean(self.medians[list(self.feet)]))

    @property
    def height(self) -> float:
        return float(self.medians[self.top]) - self.base

    @property
    def widths(self) -> tuple[float, float]:
        """Least and largest."""
        return self.sides[2] - self.sides[1], self.sides[3] - self.sides[0]


@dataclass(frozen=True, eq=False)
class Found:
    """A track, what its points show at places along it, the registered ridge, and its line in the table."""

    track: Track
    seen: list[Across]
    ridge: rf.Ridge
    line: str
    rates: tuple[float, float]
    """Registered height and width, by those read."""

    @property
    def beyond(self) -> bool:
        return any(abs(rate - 1.0) > limit for rate, limit in zip(self.rates, LIMITS, strict=True))


def frame_at(track: Track, place: float) -> tuple[Array, Array]:
    """Crest point and axes (3, 3) at a part of the track, upright on the points about it."""
    crest = even(track.crest, 1001)
    i, step = round(1000 * place), round(1000 * _AHEAD)
    at, along = crest[i], crest[min(i + step, 1000)] - crest[max(i - step, 0)]
    near = track.points[((track.points - at) ** 2).sum(axis=1) < (_GROUND * track.width) ** 2]
    up = np.linalg.svd(near - np.median(near, axis=0), full_matrices=False)[2][2]
    up = up * np.sign(up @ track.up) * (-1.0 if track.kind == "auto" else 1.0)
    return at, axes_of(along, up)


def axes_of(along: Array, up: Array) -> Array:
    along = along / np.linalg.norm(along)
    left = np.cross(up, along)
    left /= np.linalg.norm(left)
    return np.column_stack([along, left, np.cross(along, left)])


def across(track: Track, place: float) -> Across | None:
    """What the points show at a part of the track; None where a foot or the top is not seen."""
    at, axes = frame_at(track, place)
    w = track.width
    edges = np.arange(-round(REACH / BIN), round(REACH / BIN) + 1.5) * BIN * w - 0.5 * BIN * w
    feet = 0, 0
    for turn in range(3):
        local = (track.points - at) @ axes
        inside = (np.abs(local[:, 0]) < 0.5 * w) & (np.abs(local[:, 2]) < _TALL * track.height)
        points = local[inside & (np.abs(local[:, 1]) < edges[-1])][:, 1:]
        which = np.digitize(points[:, 0], edges) - 1
        bins = [points[which == k, 1] for k in range(len(edges) - 1)]
        medians = np.array([np.median(z) if len(z) >= ENOUGH else np.nan for z in bins])
        middles = 0.5 * (edges[1:] + edges[:-1])
        top = int(np.nanargmax(np.where(np.abs(middles) < 0.5 * w, medians, -np.inf)))
        low, high = foot(middles, medians, top, -1), foot(middles, medians, top, 1)
        if low is None or high is None:
            return None
        feet = low, high
        slope = (medians[high] - medians[low]) / (middles[high] - middles[low])
        if turn < 2:
            axes = axes_of(axes[:, 0], axes[:, 2] - slope * axes[:, 1])
    half = 0.5 * (medians[top] + 0.5 * (medians[feet[0]] + medians[feet[1]]))
    sides = (*crossing(middles, medians, top, -1, half)[::-1], *crossing(middles, medians, top, 1, half))
    return Across(at, axes, points, middles, medians, feet, top, sides)


def foot(middles: Array, medians: Array, top: int, way: int) -> int | None:
    """The bin furthest below the chord from the top to the outermost bin that way; None if there are few."""
    known = [k for k in range(top + way, len(medians) if way > 0 else -1, way) if np.isfinite(medians[k])]
    if len(known) < 3:
        return None
    last = known[-1]
    slope = (medians[last] - medians[top]) / (middles[last] - middles[top])
    below = [medians[top] + slope * (middles[k] - middles[top]) - medians[k] for k in known]
    return known[int(np.argmax(below))]


def crossing(middles: Array, medians: Array, top: int, way: int, level: float) -> tuple[float, float]:
    """Inner and outer bound of the first place that way where the medians fall below a level."""
    inner = top
    for k in range(top + way, len(medians) if way > 0 else -1, way):
        if not np.isfinite(medians[k]):
            continue
        if medians[k] < level:
            if abs(k - inner) > 1:
                return float(middles[inner]), float(middles[k])
            share = (medians[inner] - level) / (medians[inner] - medians[k])
            at = float(middles[inner] + share * (middles[k] - middles[inner]))
            return at, at
        inner = k
    return float(middles[inner]), float(middles[inner])


def section_in(seen: Across, ridge: rf.Ridge) -> tuple[int, Array, Array]:
    """The station nearest to a place; the registered section and its base there (m, 2), in its frame."""
    apex = ridge.spine + ridge.height[:, None] * ridge.normal
    apart = apex - seen.origin
    k = int(np.argmin(np.abs(apart @ seen.axes[:, 0]) + np.linalg.norm(apart, axis=1)))
    y = np.linspace(-0.7, 0.7, 201) * ridge.width[k]
    base = 0.5 * ridge.curvature[k] * y * y
    found = []
    for z in (base + ridge.height[k] * ridge.section(y / ridge.width[k]), base):
        places = ridge.spine[k] + y[:, None] * ridge.across[k] + z[:, None] * ridge.normal[k]
        found.append(((places - seen.origin) @ seen.axes)[:, 1:])
    return k, found[0], found[1]


def drawn(ax: Axes, track: Track, one: Across, ridge: rf.Ridge) -> None:
    """What points, reading and registered section say at one place."""
    w, h, base = track.width, track.height, one.base
    k, section, ground = section_in(one, ridge)
    y, top = one.middles[one.top], one.medians[one.top]
    middle = 0.25 * sum(one.sides)
    ax.plot(one.points[:, 0] / w, (one.points[:, 1] - base) / h, ".", color="0.7", ms=3)
    ax.plot(one.middles / w, (one.medians - base) / h, "k.-", lw=1, label="points, medians")
    ax.plot(section[:, 0] / w, (section[:, 1] - base) / h, "r", label="registered")
    ax.plot(ground[:, 0] / w, (ground[:, 1] - base) / h, "r:", lw=1)
    feet = list(one.feet)
    ax.plot(one.middles[feet] / w, (one.medians[feet] - base) / h, "k^", ms=8, label="feet")
    half = 0.5 * (top - base) / h
    ax.plot([one.sides[0] / w, one.sides[3] / w], [half, half], "k--", lw=2, label="width, points")
    ax.plot([middle / w - 0.5, middle / w + 0.5], [0.5, 0.5], "b", lw=2, label="read: width, height")
    ax.plot([y / w, y / w], [0, 1], "b", lw=1)
    least, most = one.widths
    width = f"{least / w:.2f}" if most - least < BIN * w else f"{least / w:.2f} to {most / w:.2f}"
    own = abs(ridge.height[k]) / h, ridge.half_height_width[k] / w
    ax.set_title(
        f"points: h {one.height / h:.2f}, w {width}\nregistered: h {own[0]:.2f}, w {own[1]:.2f}", fontsize=10
    )
    ax.grid(alpha=0.3)


def spread(seen: list[Across], count: int) -> list[Across]:
    return [seen[i] for i in np.linspace(0, len(seen) - 1, min(count, len(seen))).round().astype(int)]


def picture(found: Found, file: Path) -> None:
    """One track at several places."""
    chosen = spread(found.seen, PICTURES)
    figure, axes = plt.subplots(2, (len(chosen) + 1) // 2, figsize=(15, 8), squeeze=False)
    for ax, one in zip(axes.flat, chosen, strict=False):
        drawn(ax, found.track, one, found.ridge)
    axes.flat[0].legend(fontsize=8)
    figure.suptitle(
        f"{' '.join(found.line.split())}\nin the read height and width at half height", fontsize=11
    )
    figure.tight_layout()
    figure.savefig(file, dpi=70)
    plt.close(figure)


def page(found: list[Found], file: Path) -> None:
    """A row for each track."""
    figure, axes = plt.subplots(len(found), A_ROW, figsize=(14, 2.6 * len(found)), squeeze=False)
    for row, one in zip(axes, found, strict=True):
        for ax, place in zip(row, spread(one.seen[2:-2], A_ROW), strict=False):
            drawn(ax, one.track, place, one.ridge)
        row[0].set_ylabel(one.track.name)
    axes[0, 0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(file, dpi=55)
    plt.close(figure)


def told(track: Track, out: Path | None) -> tuple[str, Found | None]:
    """One line for the table, and what was found; draws the picture."""
    places = np.linspace(0.04, 0.96, PLACES)
    seen = [one for one in (across(track, float(place)) for place in places) if one is not None]
    if not seen:
        return f"{track.name:34s} no place where both feet and the top are seen", None
    height = np.median([one.height for one in seen]) / track.height
    low, high = np.median([one.widths for one in seen], axis=0) / track.width
    # Flanks that were not seen leave the width open: where both were, it is known.
    sure = [np.mean(one.widths) for one in seen if np.ptp(one.widths) <= 2 * BIN * track.width]
    width = f"{low:.2f} to {high:.2f}"
    if sure:
        width += f", {np.median(sure) / track.width:.2f} where both flanks are seen, at {len(sure)}"
    line = f"{track.name:34s} points at {len(seen)} places: h {height:.2f} w {width}"
    try:
        ridge = rf.register(track.points, at=track.seed, kind=track.kind)
    except rf.NoRidgeError as error:
        return f"{line}; {error}", None
    near = [section_in(one, ridge)[0] for one in seen]
    h, w = (float(np.median(np.abs(x[near]))) for x in (ridge.height, ridge.half_height_width))
    rates = h / track.height, w / track.width
    found = Found(track, seen, ridge, f"{line}; registered: h {rates[0]:.2f} w {rates[1]:.2f}", rates)
    if out is not None:
        picture(found, out / f"{track.name.replace(', ', '_').replace(' ', '_')}.png")
    return found.line, found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scans", type=Path)
    parser.add_argument("--out", type=Path, help="folder for the pictures")
    parser.add_argument("--page", type=Path, help="picture of the tracks out of the limits")
    parser.add_argument("--only", default="", help="tracks whose name holds this")
    asked = parser.parse_args()
    if not asked.scans.is_dir():
        parser.error(f"expected a folder of scans, got {asked.scans}; give one that is there")
    if asked.out is not None:
        asked.out.mkdir(parents=True, exist_ok=True)
    print("heights and widths at half height in those read")
    beyond = []
    for track in tracks(asked.scans):
        if asked.only in track.name:
            line, found = told(track, asked.out)
            print(line, flush=True)
            beyond += [found] if found is not None and found.beyond else []
    if asked.page is not None and beyond:
        page(beyond, asked.page)


if __name__ == "__main__":
    main()
