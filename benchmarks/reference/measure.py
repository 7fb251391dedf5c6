"""What is measured of one case: a click on a ridge, on a surface without one, many clicks on one ridge."""

from __future__ import annotations

import time
from pathlib import Path as File
from typing import Any

import numpy as np

import ridgefeature as rf
from reference.flat import ridge_free
from reference.hosts import Array
from reference.make import Case, clicks, draw
from reference.score import from_ridge, score
from ridgefeature.synthetic import Spiral

Row = dict[str, Any]


def warm_up() -> None:
    """Compiles what a registration needs, so that no case's seconds hold that."""
    spiral = Spiral()
    at = (*spiral.spine(np.array(30.0))[:2], float(spiral.height(np.array(30.0))))
    rf.register(spiral.points(10_000, noise=0.1), at=at)


def registered(case: Case, click: Array | None = None) -> tuple[rf.Ridge | None, float, str]:
    """What one click finds, in how many seconds, and the error where it ends in one that it should not."""
    start = time.perf_counter()
    ridge, error = None, ""
    try:
        ridge = rf.register(case.points, at=case.click if click is None else click, kind=case.kind)
    except rf.NoRidgeError:
        pass
    except Exception as raised:
        error = f"{type(raised).__name__}: {raised}"
    return ridge, time.perf_counter() - start, error


def one_case(seed: int, failures: File | None = None, fixed: dict[str, str] | None = None) -> Row:
    """One case of the campaign, registered and scored, as a row of the table."""
    case = draw(seed, **(fixed or {}))
    ridge, seconds, error = registered(case)
    result = score(case.truth, None if ridge is None else from_ridge(ridge, seconds))
    failed = ("error",) if error else result.failed
    if failed and failures is not None:
        from reference.picture import picture

        picture(case, ridge, f"{case.name}: {', '.join(failed)}", failures / f"{case.name}.png")
    steps = float("nan") if ridge is None or not ridge.closed else seam(ridge)
    row: Row = {"seed": seed, **case.kinds, "points": len(case.points), "failed": failed}
    row |= {"score": result, "seam": steps, "seconds": seconds, "error": error}
    return row | {"stop": ("", "") if ridge is None else ridge.stop}


def seam(ridge: rf.Ridge) -> float:
    """The largest jump where a closed ridge closes, of position and its two derivatives, in widths."""
    surface = ridge.surface()
    (low, high), v = surface.domain[0], np.linspace(*surface.domain[1], 41)
    w = float(np.median(ridge.width))
    ends = [(surface(u, v), *surface.derivatives(u, v, 2)) for u in (low, high)]
    # du and duu are by arc length, dv by distance over width: all become lengths over the width.
    sizes = (1 / w, 1.0, 1 / w, w, 1.0, 1 / w)
    pairs = zip(*ends, sizes, strict=True)
    return max(float(np.abs(first - last).max()) * size for first, last, size in pairs)


def one_flat(task: tuple[str, int]) -> tuple[str, int, str]:
    """What a click on a surface without a ridge finds; nothing, as it should be: an empty string."""
    points, click = ridge_free(*task)
    try:
        ridge = rf.register(points, at=click, kind="auto")
    except rf.NoRidgeError:
        return (*task, "")
    except Exception as raised:
        return (*task, f"{type(raised).__name__}: {raised}")
    h, w = float(np.median(ridge.height)), float(np.median(ridge.width))
    return (*task, f"{len(ridge.templates)} templates, h {h:.3g}, w {w:.3g}, length {ridge.length:.3g}")


def one_of_clicks(task: tuple[int, int]) -> Row:
    """Many clicks on one ridge: spread of height and width in their standard deviations, at common places."""
    seed, count = task
    case = draw(seed, kind="ridge", gap="none")
    truth = case.truth
    low, high = truth.visible
    places = np.linspace(low + 0.05 * (high - low), high - 0.05 * (high - low), 60)
    tables: list[Array] = []
    for click in clicks(case, count, seed):
        ridge, _, _ = registered(case, click)
        if ridge is None:
            continue
        s, offset = truth.nearest(ridge.spine)
        on = np.linalg.norm(offset, axis=1) <= 0.5 * truth.width(s)
        if on.sum() < 2:
            continue
        order = np.argsort(s[on], kind="stable")
        values = (ridge.height, ridge.width, ridge.height_std, ridge.width_std)
        tables.append(
            np.array([np.interp(places, s[on][order], x[on][order], np.nan, np.nan) for x in values])
        )
    return {
        "seed": seed,
        "kinds": case.kinds,
        "clicks": count,
        "spread": _spread(tables),
        "found": len(tables),
    }


def _spread(tables: list[Array]) -> tuple[float, float]:
    """Rms over places of standard deviation between clicks by stated one, of height and width."""
    if len(tables) < 2:
        return float("nan"), float("nan")
    stack = np.array(tables)
    often = (~np.isnan(stack[:, 0])).sum(axis=0) >= 2
    if not often.any():
        return float("nan"), float("nan")
    stack = stack[:, :, often]
    stated = np.nanmedian(stack[:, 2:], axis=0)
    height, width = np.sqrt(np.mean((np.nanstd(stack[:, :2], axis=0, ddof=1) / stated) ** 2, axis=1))
    return float(height), float(width)
