"""One click and nothing else on real scans: the click that was read off each known track.

    python benchmarks/real_seeds.py SCANS [--only NAME]

SCANS is a folder as benchmarks/real_clicks.py has it. Prints a table: what part of the track is covered, the
distance of crest and track in half-height widths (rms), length, height and half-height width in those read;
and for tracks on a flat base the deviation of the points up to half a width from the spine from the
registered surface, without and with strays, by that of the base: of the points beside the ridge from their
plane, without strays (rms). Deterministic.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from real_clicks import Track, found_at, tracks

import ridgefeature as rf

Array = NDArray[np.float64]

FLAT = "lmd_bead_kink"
_BESIDE = 0.6, 1.3
"""Distances from the spine in widths between which points are of the base beside it."""
_STRAY, _ROUNDS, _TRIED = 3.0, 8, 200


def flat_rms(points: Array) -> float:
    """Of points (m, 3) from the plane of those that are no strays: begun with the one of three points that is
    nearest to half of them (least median of squares)."""
    random = np.random.default_rng(0)
    tried = [plane(points[random.choice(len(points), 3, replace=False)], points) for _ in range(_TRIED)]
    off = min(tried, key=lambda off: float(np.median(np.abs(off))))
    for _ in range(_ROUNDS):
        keep = np.abs(off) < _STRAY * 1.4826 * np.median(np.abs(off))
        off = plane(points[keep], points)
    return float(np.sqrt((off[keep] ** 2).mean()))


def plane(some: Array, points: Array) -> Array:
    """Distances (m,) of points from the plane of some."""
    centre = some.mean(axis=0)
    return np.asarray((points - centre) @ np.linalg.svd(some - centre, full_matrices=False)[2][2])


def deviation_rates(track: Track, ridge: rf.Ridge) -> tuple[float, float]:
    """Deviation of the ridge's points by that of its flat base, rms: without strays, with them."""
    told, width = rf.diagnose(ridge, track.points), float(np.median(ridge.width))
    on = np.abs(told.across) < 0.5 * np.interp(told.arc_length, ridge.arc_length, ridge.width)
    apart = np.linalg.norm(track.points[:, None] - ridge.spine[None, ::3], axis=2).min(axis=1)
    beside = (apart > _BESIDE[0] * width) & (apart < _BESIDE[1] * width)
    base = flat_rms(track.points[beside])
    good, every = (told.deviation[which] for which in (on & ~told.stray, on))
    return float(np.sqrt((good**2).mean())) / base, float(np.sqrt((every**2).mean())) / base


def row(track: Track) -> str:
    try:
        found = found_at(track, track.seed)
    except rf.NoRidgeError as error:
        return f"| {track.name} | no ridge: {error} | | | | | |"
    if not found.covered:
        return f"| {track.name} | 0.00, another ridge | | | | | |"
    height, width = (np.nanmedian(x) for x in (found.height / track.height, found.width / track.width))
    rates = ""
    if FLAT in track.name:
        rates = "{:.2f}, with strays {:.2f}".format(*deviation_rates(track, found.ridge))
    length = found.ridge.length / track.length
    return (
        f"| {track.name} | {found.covered:.2f} | {found.rms:.2f} | {length:.2f} | {height:.2f} | {width:.2f} "
        f"| {rates} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scans", type=Path)
    parser.add_argument("--only", default="", help="tracks whose name holds this")
    asked = parser.parse_args()
    if not asked.scans.is_dir():
        parser.error(f"expected a folder of scans, got {asked.scans}; give one that is there")
    print("| track | covered | rms | length | height | half-height width | points / base |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for track in tracks(asked.scans):
        if asked.only in track.name:
            print(row(track), flush=True)


if __name__ == "__main__":
    main()
