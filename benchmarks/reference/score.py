"""Scores of an answer against the truth, for this package's ridges and for those of any other method.

    python benchmarks/reference/score.py DIR [--cases 20] [--first 0]

DIR holds one answer a case, case_0000.npz or case_0000.json and so on. Names of its arrays: spine (k, 3) on
the base under the apex, in order; height (k,), and half_height_width (k,) or width (k,) between the feet.
Where the method has them: height_std, width_std, half_height_width_std, spine_std (k,), closed, end_interval
(2, 2) (95 %, in arc length along the answer's own spine from its first point, for its first and last end),
seconds. No file, or an empty spine: nothing was found.
"""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from dataclasses import dataclass, fields
from itertools import pairwise
from pathlib import Path as File
from typing import Any

import numpy as np

if __name__ == "__main__":
    sys.path.insert(0, str(File(__file__).resolve().parents[1]))

import ridgefeature as rf
from reference.hosts import Array
from reference.make import draw
from reference.sections import TOP, level_crossings
from reference.truth import Truth

LENGTH_SHARE, SPINE_RMS, RELATIVE, SIGMAS, OVERSHOOT = 0.95, 0.1, 0.03, 3.0, 1.0
STATION_SHARE = 0.95
"""Share of the stations that must lie within the limits: at 3 sigma one in 370 lies outside by chance."""
DOUBLED = 1.25
"""A spine this many times longer than what it covers turned back or went round twice."""
_NORMAL_95 = 1.959964
_BIN = 0.05


@dataclass(frozen=True, eq=False)
class Found:
    """An answer, in the scan's unit and frame; stations (k,) in order along the ridge."""

    spine: Array
    height: Array
    width: Array | None = None
    half_height_width: Array | None = None
    height_std: Array | None = None
    width_std: Array | None = None
    half_height_width_std: Array | None = None
    spine_std: Array | None = None
    closed: bool = False
    end_interval: Array | None = None
    seconds: float = float("nan")


@dataclass(frozen=True)
class Score:
    """What an answer is worth. Lengths in local widths between the feet; shares from 0 to 1.

    spine_rms: distance from the true spine, along it left out. height_good, half_width_good: share of the
    stations within 3 standard deviations or 3 %. overshoot: the furthest that the spine is from the true one.
    doubled: its length by what it covers. ends: signed distance along the path from both true ends, positive
    beyond; NaN if closed. bands: stations, and how many of them have the truth in the 95 % band of height,
    width, half-height width and spine; 0 of 0 where the answer has no band. end_holds: whether each end's
    interval holds a place from the visible to the true end; end_exact: whether it holds the true end.
    failed: why it is no success, by words.
    """

    found: bool = False
    length: float = 0.0
    spine_rms: float = float("nan")
    height_good: float = 0.0
    half_width_good: float = 0.0
    height_error: float = float("nan")
    half_width_error: float = float("nan")
    overshoot: float = float("nan")
    doubled: float = float("nan")
    closed: bool = False
    ends: tuple[float, float] = (float("nan"), float("nan"))
    bands: tuple[tuple[int, int], ...] = ((0, 0),) * 4
    end_holds: tuple[bool | None, bool | None] = (None, None)
    end_exact: tuple[bool | None, bool | None] = (None, None)
    seconds: float = float("nan")
    failed: tuple[str, ...] = ("nothing found",)

    @property
    def passed(self) -> bool:
        return not self.failed


def from_ridge(ridge: rf.Ridge, seconds: float = float("nan")) -> Found:
    """A registered ridge as an answer: its spine is moved under the apex of its section."""
    section = ridge.section
    half = section.half_height_width
    apex = sum(level_crossings(section, TOP)) / 2
    spine_std = getattr(ridge, "spine_std", None)
    if spine_std is None:
        places = np.array([t.position for t in ridge.templates])
        std = np.array([np.inf if t.std is None else t.std[1] for t in ridge.templates])
        spine_std = std[np.linalg.norm(ridge.spine[:, None] - places, axis=2).argmin(axis=1)]
    spine_std = np.asarray(spine_std)
    return Found(
        spine=ridge.spine + (apex * ridge.width)[:, None] * ridge.across,
        height=ridge.height,
        width=ridge.width,
        half_height_width=ridge.half_height_width,
        height_std=ridge.height_std,
        width_std=ridge.width_std,
        half_height_width_std=getattr(ridge, "half_height_width_std", half * ridge.width_std),
        spine_std=spine_std[:, 0] if spine_std.ndim == 2 else spine_std,
        closed=ridge.closed,
        end_interval=getattr(ridge, "end_interval", None),
        seconds=seconds,
    )


def read_answer(file: File) -> Found | None:
    """An answer from .npz or .json; None for an empty one. Raises ValueError for one that is not whole."""
    if file.suffix == ".json":
        raw: dict[str, Any] = json.loads(file.read_text())
    else:
        with np.load(file) as archive:
            raw = dict(archive)
    spine = np.asarray(raw.get("spine", ()), dtype=np.float64)
    if spine.size == 0:
        return None
    if spine.ndim != 2 or spine.shape[1] != 3 or len(spine) < 2 or not np.isfinite(spine).all():
        raise ValueError(f"{file.name}: expected a finite spine (k, 3), k >= 2; got shape {spine.shape}")
    known = {f.name for f in fields(Found)}
    values: dict[str, Any] = {}
    for name, value in raw.items():
        if name not in known or value is None:
            continue
        array = np.asarray(value, dtype=np.float64)
        wanted = {"spine": spine.shape, "end_interval": (2, 2), "closed": (), "seconds": ()}.get(
            name, spine.shape[:1]
        )
        if array.shape != wanted:
            raise ValueError(f"{file.name}: expected {name} of shape {wanted}, got {array.shape}")
        values[name] = array
    if "height" not in values or not values.keys() & {"width", "half_height_width"}:
        raise ValueError(
            f"{file.name}: expected height, and width or half_height_width; got {sorted(values)}"
        )
    values["closed"] = bool(values.get("closed", False))
    values["seconds"] = float(values.get("seconds", np.nan))
    return Found(**values)


def score(truth: Truth, found: Found | None) -> Score:
    """The score of an answer; None: nothing was found."""
    if found is None:
        return Score()
    s, offset = truth.nearest(found.spine)
    local = truth.width(s)
    beside = _beside(truth, s, offset)
    low, high = truth.visible
    on = (s >= low) & (s <= high) & (np.linalg.norm(offset, axis=1) <= 0.5 * local)
    length, overshoot, doubled = _path(truth, found)
    half = found.half_height_width
    if half is None and found.width is not None:
        half = truth.section.half_height_width * found.width
    assert half is not None
    half_std = found.half_height_width_std
    if half_std is None and found.width_std is not None:
        half_std = truth.section.half_height_width * found.width_std
    true_h, true_half = truth.height(s), truth.half_height_width(s)
    height_good, height_error = _good(found.height, true_h, found.height_std, on)
    half_good, half_error = _good(half, true_half, half_std, on)
    bands = (
        _inside(found.height - true_h, found.height_std, on),
        _inside(None if found.width is None else found.width - truth.width(s), found.width_std, on),
        _inside(half - true_half, half_std, on),
        _inside(_aside(truth, s, offset), found.spine_std, on),
    )
    ends, holds, exact = _ends(truth, found, s, offset)
    rms = float(np.sqrt(np.mean((beside[on] / local[on]) ** 2))) if on.any() else float("nan")
    tests = {
        "length": length >= LENGTH_SHARE,
        "spine": rms <= SPINE_RMS,
        "height": height_good >= STATION_SHARE,
        "half-height width": half_good >= STATION_SHARE,
        "overshoot": overshoot <= OVERSHOOT,
        "doubled": doubled <= DOUBLED,
        "not closed" if truth.closed else "closed": found.closed == truth.closed,
    }
    return Score(
        True, length, rms, height_good, half_good, height_error, half_error, overshoot, doubled,
        found.closed == truth.closed, ends, bands, holds, exact, found.seconds,
        tuple(name for name, good in tests.items() if not good),
    )  # fmt: skip


def _beside(truth: Truth, s: Array, offset: Array) -> Array:
    """Distances from the true spine without their part along the path (n,)."""
    tangent = truth.frame(s)[0]
    along = (offset * tangent).sum(axis=1)
    return np.sqrt(np.maximum((offset**2).sum(axis=1) - along**2, 0.0))


def _aside(truth: Truth, s: Array, offset: Array) -> Array:
    """Distances to the left of the true spine, within the base (n,)."""
    return np.asarray((offset * truth.frame(s)[1]).sum(axis=1))


def _good(values: Array, true: Array, std: Array | None, on: Array) -> tuple[float, float]:
    """Share of stations within 3 std or 3 %, and the median relative error."""
    if not on.any():
        return 0.0, float("nan")
    error = np.abs(values - true)[on]
    limit = RELATIVE * np.abs(true[on])
    if std is not None:
        limit = np.maximum(limit, SIGMAS * np.where(np.isfinite(std[on]), std[on], 0.0))
    return float(np.mean(error <= limit)), float(np.median(error / np.abs(true[on])))


def _inside(error: Array | None, std: Array | None, on: Array) -> tuple[int, int]:
    """How many stations there are, and how many have the truth inside their 95 % band."""
    if error is None or std is None:
        return 0, 0
    return int(on.sum()), int((np.abs(error) <= _NORMAL_95 * std)[on].sum())


def _path(truth: Truth, found: Found) -> tuple[float, float, float]:
    """Share of the visible length covered, furthest distance from the spine, length by what it covers."""
    line = np.concatenate([found.spine, found.spine[:1]]) if found.closed else found.spine
    line = dense(line, 0.4 * _BIN * truth.pose.scale)
    s, offset = truth.nearest(line)
    away = np.linalg.norm(offset, axis=1) / truth.width(s)
    near = away <= 0.5
    count = max(int(truth.length / (_BIN * truth.pose.scale)), 1)
    bins = np.zeros(count, dtype=bool)
    bins[np.minimum((s[near] / truth.length * count).astype(np.intp), count - 1)] = True
    middles = (np.arange(count) + 0.5) / count * truth.length
    seen = (middles >= truth.visible[0]) & (middles <= truth.visible[1])
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)[near[1:] & near[:-1]].sum()
    covered = bins.sum() / count * truth.length
    return float(bins[seen].mean()), float(away.max()), float(steps / covered) if covered else np.inf


def dense(line: Array, step: float) -> Array:
    """The polyline (k, 3) with no two points further apart than `step`."""
    out = [line[:1]]
    for a, b in pairwise(line):
        parts = int(np.linalg.norm(b - a) / step) + 1
        out.append(a + (b - a) * (np.arange(1, parts + 1) / parts)[:, None])
    return np.concatenate(out)


def _ends(
    truth: Truth, found: Found, s: Array, offset: Array
) -> tuple[tuple[float, float], tuple[bool | None, bool | None], tuple[bool | None, bool | None]]:
    """Signed distances of the ends beyond the true ones, and whether the ends' intervals hold these."""
    if truth.closed or found.closed:
        return (np.nan, np.nan), (None, None), (None, None)
    at = s + (offset * truth.frame(s)[0]).sum(axis=1)
    rows = (0, -1) if at[-1] >= at[0] else (-1, 0)
    sign = 1.0 if rows == (0, -1) else -1.0
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(found.spine, axis=0), axis=1))])
    errors: list[float] = []
    holds: list[bool | None] = []
    exact: list[bool | None] = []
    for row, true, visible, outward in zip(
        rows, (0.0, truth.length), truth.visible, (-1.0, 1.0), strict=True
    ):
        errors.append(float(outward * (at[row] - true) / truth.width(np.array([true]))[0]))
        if found.end_interval is None:
            holds.append(None)
            exact.append(None)
            continue
        own = np.sort(at[row] + sign * (found.end_interval[row] - lengths[row]))
        holds.append(bool(own[0] <= max(true, visible) and own[1] >= min(true, visible)))
        exact.append(bool(own[0] <= true <= own[1]))
    return (errors[0], errors[1]), (holds[0], holds[1]), (exact[0], exact[1])


def main() -> None:
    summary, _, details = (__doc__ or "").partition("\n")
    parser = ArgumentParser(description=summary, epilog=details, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=File)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    passed = 0
    print("| case | length | spine rms / w | h good | half-height width good | overshoot / w | fails |")
    print("|---|---|---|---|---|---|---|")
    for seed in range(options.first, options.first + options.cases):
        case = draw(seed)
        files = [options.folder / (case.name + suffix) for suffix in (".npz", ".json")]
        found = next((read_answer(file) for file in files if file.exists()), None)
        one = score(case.truth, found)
        passed += one.passed
        print(
            f"| {case.name} | {one.length:.3f} | {one.spine_rms:.3f} | {one.height_good:.2f} | "
            f"{one.half_width_good:.2f} | {one.overshoot:.2f} | {', '.join(one.failed)} |"
        )
    print(f"\n{passed} of {options.cases} passed")


if __name__ == "__main__":
    main()
