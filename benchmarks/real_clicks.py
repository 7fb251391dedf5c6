"""Other clicks on the same ridge of real scans: one click, at many places along known tracks.

    python benchmarks/real_clicks.py SCANS [--only NAME] [--clicks 10] [--verbose]

SCANS is a folder of archives, one a scan, each with `points` (n, 3), `up` (3,), and for every track in it
`seed` (3,) and `ref_path` (m, 3), a line along its crest, those of further tracks with the suffixes _2, _3;
and maybe `points_sampled`, of the scanned mesh's triangles. What a human read off the clouds stands below.
Three mountain ridges more come from the elevation model that matplotlib ships. Deterministic.

A click is the scan point nearest to the track, at even places from 5 to 95 % of it. One finds the ridge if
the crest of what was registered passes within a half-height width of 80 % of the track. For each track: how
many do, medians over them of what part of the track is covered, of the distance of crest and track in
half-height widths (rms), of length, height and half-height width in those read, and the spread of heights and
half-height widths between clicks in their own standard deviations (root mean square along the track).
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import ridgefeature as rf

Array = NDArray[np.float64]

READ = {
    "lmd_bead_kink": {"left": (0.0693, 0.0067, 0.0065), "right": (0.0667, 0.0066, 0.0060)},
    "nefertiti_uraeus": {"tail": (67.0, 4.0, 7.3), "lobe 1": (75.0, 3.7, 6.7), "lobe 2": (66.0, 4.0, 7.3)},
    "boot_sole_groove": {"a": (0.100, 0.0040, 0.0064), "b": (0.092, 0.0040, 0.0064)},
    "waam_weld_wall": {"wall": (82.0, 13.9, 5.0)},
}
"""Length, height and width at half height of each track, in the scan's unit."""
MOUNTAINS = {
    "Pine Mountain": ((17429, 19603), (0.80, 0.61), 14700.0, 205.0, 700.0),
    "small, south": ((20558, 740), (0.56, 0.83), 4900.0, 180.0, 545.0),
    "small, north": ((22122, 6935), (-0.61, 0.80), 5000.0, 159.0, 545.0),
}
"""Start, direction, length, height and width at half height, in m."""
FOUND, ON_TOP, PLACES = 0.8, 0.9, 200


@dataclass(frozen=True, eq=False)
class Track:
    """A ridge in a scan: its crest (m, 3), what was read off, which way is up, and where to click (3,)."""

    name: str
    points: Array
    up: Array
    seed: Array
    crest: Array
    length: float
    height: float
    width: float
    kind: str = "ridge"

    def clicks(self, count: int) -> Array:
        """(count, 3) scan points nearest to the crest at even places."""
        at = even(self.crest, 1001)[np.linspace(50, 950, count).astype(int)]
        return np.array([self.points[np.argmin(((self.points - p) ** 2).sum(axis=1))] for p in at])


@dataclass(frozen=True, eq=False)
class Found:
    """What one click found, at places along the track: NaN where it is not covered."""

    ridge: rf.Ridge
    covered: float
    rms: float
    height: Array
    height_std: Array
    width: Array
    width_std: Array


def even(line: Array, count: int) -> Array:
    """(count, 3) even places on a line (m, 3)."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0.0, s[-1], count)
    return np.column_stack([np.interp(at, s, x) for x in line.T])


def tracks(folder: Path) -> Iterator[Track]:
    for file, read in READ.items():
        if not (folder / f"{file}.npz").exists():
            continue
        data = np.load(folder / f"{file}.npz")
        kind = "auto" if "groove" in file else "ridge"
        for k, (name, sizes) in enumerate(read.items()):
            crest, seed = (data[what + (f"_{k + 1}" if k else "")] for what in ("ref_path", "seed"))
            for cloud in ("points", "points_sampled"):
                if cloud in data:
                    label = f"{file} {name}{', sampled' if cloud != 'points' else ''}"
                    yield Track(label, data[cloud], data["up"], seed, crest, *sizes, kind)
    yield from mountains()


def mountains() -> Iterator[Track]:
    from matplotlib.cbook import get_sample_data

    with get_sample_data("jacksboro_fault_dem.npz") as file:
        z = file["elevation"].astype(float)
    row, column = np.indices(z.shape)
    points = np.column_stack([74.5 * column.ravel(), 92.5 * (len(z) - 1 - row).ravel(), z.ravel()])
    for name, (start, way, length, height, width) in MOUNTAINS.items():
        crest = highest(points, np.array(start, float), np.array(way), length, width)
        seed = points[np.argmin(((points[:, :2] - start) ** 2).sum(axis=1))]
        yield Track(name, points, np.array([0.0, 0.0, 1.0]), seed, crest, length, height, width)


def highest(points: Array, at: Array, way: Array, length: float, width: float) -> Array:
    """The crest (m, 3) of a mountain ridge: the highest points beside a path that goes on along them."""
    found: list[Array] = []
    step = 0.25 * width
    for _ in range(round(length / step)):
        way = way / np.linalg.norm(way)
        local = (points[:, :2] - at) @ np.column_stack([way, [-way[1], way[0]]])
        near = points[(np.abs(local[:, 0]) < 0.5 * step) & (np.abs(local[:, 1]) < step)]
        found.append(near[np.argmax(near[:, 2])])
        if len(found) > 6:
            way = way + 0.5 * (found[-1] - found[-6])[:2] / (5 * step)
        at = found[-1][:2] + step * way / np.linalg.norm(way)
    return np.array(found)


def crest_of(ridge: rf.Ridge) -> Array:
    """(k, 3) the middle of the top over every station."""
    eta = np.linspace(-0.5, 0.5, 4001)
    on = eta[ridge.section(eta) >= ON_TOP]
    aside = 0.5 * (on[0] + on[-1]) * ridge.width
    return ridge.spine + aside[:, None] * ridge.across + ridge.height[:, None] * ridge.normal


def found_at(track: Track, click: Array) -> Found:
    """Raises NoRidgeError."""
    ridge = rf.register(track.points, at=click, kind=track.kind)
    up = track.up / np.linalg.norm(track.up)
    level = [x - np.outer(x @ up, up) for x in (even(track.crest, PLACES), even(crest_of(ridge), 4 * PLACES))]
    apart = np.linalg.norm(level[0][:, None] - level[1], axis=2)
    nearest, far = apart.argmin(axis=1), apart.min(axis=1)
    # Not beyond its ends, however near these are.
    near = (far < track.width) & (nearest > 0) & (nearest < 4 * PLACES - 1)
    # Places on the crest are even along it, nearly as arc length is.
    at = nearest / (4 * PLACES - 1) * ridge.length
    named = (ridge.height, ridge.height_std, ridge.half_height_width, ridge.half_height_width_std)
    values = [np.where(near, np.interp(at, ridge.arc_length, np.abs(x)), np.nan) for x in named]
    rms = float(np.sqrt((far[near] ** 2).mean())) / track.width if near.any() else np.nan
    return Found(ridge, float(near.mean()), rms, *values)


def spread(values: list[Array], stds: list[Array]) -> float:
    """Differences of values from their median over clicks, by their standard deviations: root mean square."""
    x, std = np.array(values), np.array(stds)
    known = np.isfinite(x).sum(axis=0) > 1
    if not known.any():
        return np.nan
    x, std = x[:, known], std[:, known]
    return float(np.sqrt(np.nanmean(((x - np.nanmedian(x, axis=0)) / std) ** 2)))


def line_of(track: Track, found: Found) -> str:
    with np.errstate(invalid="ignore"):
        height, width = (
            np.median(x[np.isfinite(x)]) if np.isfinite(x).any() else np.nan
            for x in (found.height / track.height, found.width / track.width)
        )
    ridge = found.ridge
    heights = np.abs(ridge.height) / track.height
    return (
        f"covered {found.covered:.2f} rms {found.rms:.2f} length {ridge.length / track.length:.2f} "
        f"h {height:.2f} half-height width {width:.2f}, h from {heights.min():.2f} to "
        f"{heights.max():.2f} | {'; '.join(ridge.stop)}"
    )


def campaign(track: Track, count: int, verbose: bool) -> str:
    """One line for the table."""
    good: list[Found] = []
    for i, click in enumerate(track.clicks(count)):
        try:
            found = found_at(track, click)
        except rf.NoRidgeError as error:
            line = str(error)
        else:
            line = line_of(track, found)
            good += [found] if found.covered >= FOUND else []
        if verbose:
            print(f"  {i}: {line}", flush=True)
    if not good:
        return f"{track.name:34s} 0 of {count}"
    lengths = [f.ridge.length / track.length for f in good]
    sizes = [(np.nanmedian(f.height) / track.height, np.nanmedian(f.width) / track.width) for f in good]
    told = [(f.covered, f.rms, length, *size) for f, length, size in zip(good, lengths, sizes, strict=True)]
    covered, rms, length, height, width = np.median(told, axis=0)
    h = spread([f.height for f in good], [f.height_std for f in good])
    w = spread([f.width for f in good], [f.width_std for f in good])
    return (
        f"{track.name:34s} {len(good)} of {count}  covered {covered:.2f}  rms {rms:.2f}  "
        f"length {length:.2f} ({min(lengths):.2f} to {max(lengths):.2f})  h {height:.2f}  width {width:.2f}  "
        f"spread h {h:.2f} width {w:.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scans", type=Path)
    parser.add_argument("--only", default="", help="tracks whose name holds this")
    parser.add_argument("--clicks", type=int, default=10)
    parser.add_argument("--verbose", action="store_true", help="tell of every click")
    asked = parser.parse_args()
    if not asked.scans.is_dir():
        parser.error(f"expected a folder of scans, got {asked.scans}; give one that is there")
    for track in tracks(asked.scans):
        if asked.only in track.name:
            print(campaign(track, asked.clicks, asked.verbose), flush=True)


if __name__ == "__main__":
    main()
