"""How long a paste takes that a slider asks for, against OCCT's boolean fuse of the same ridge.

    python benchmarks/bench_paste.py

Both on the hosts of the campaign, one thread, medians of several in one run: another height or width on a
warm place, with the fast certificate, by paste and by regenerate, on one part and each on the last result;
and the fuse of a block under the ridge, sunk by a little, unchecked.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cadquery as cq
import paste_campaign
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
from report import Report, at_most

import cad_export as cx
import ridgefeature as rf
from cad_export.face_base import face_base
from cad_export.slab import make_slab
from ridgefeature.bspline import greville

RATES = (1.02, 1.05, 1.1, 1.15, 1.2, 1.25, 1.3)


def seconds(work: Callable[[float], Any], values: tuple[float, ...] = RATES) -> float:
    """Median seconds of work over the values."""
    taken = []
    for value in values:
        start = time.perf_counter()
        work(value)
        taken.append(time.perf_counter() - start)
    return statistics.median(taken)


def sunk_block(ridge: rf.Ridge, host: paste_campaign.Host, h: float) -> cq.Solid:
    """A block under the ridge on the host, its ridge sunk by 5e-5 of its height."""
    base, fitted = face_base(host.face, ridge, at=host.at, direction=host.direction)
    top, low = (fitted.resized(h=rate).surface(base) for rate in (h, 0))
    middle = 0.5 * sum(low.domain[1])
    up = low.normal(greville(low.knots_u, low.degree_u), middle)[:, None]
    deep = 5e-5 * h * float(fitted.height.max())
    top, low = (replace(s, poles=s.poles - deep * up) for s in (top, low))
    return cq.Solid(make_slab(top, low, 0.5 * h * float(fitted.height.max()), check=False))


def measure(report: Report, name: str, ridge: rf.Ridge, host: paste_campaign.Host, limit: float) -> None:
    """Add the rows of one host."""
    where = {"face": host.face, "at": host.at, "direction": host.direction, "check": False}
    last = part = cx.paste(ridge, host.solid, **where)

    def chained(h: float) -> None:
        nonlocal last
        last = cx.regenerate(last, h=h, check=False)

    ways: dict[str, Callable[[float], Any]] = {
        "paste at another height": lambda h: cx.paste(ridge, host.solid, h=h, **where),
        "paste at another width": lambda w: cx.paste(ridge, host.solid, w=w, **where),
        "regenerate at another height": lambda h: cx.regenerate(part, h=h, check=False),
        "regenerate at another width": lambda w: cx.regenerate(part, w=w, check=False),
        "regenerate the last result": chained,
    }
    blocks = {h: sunk_block(ridge, host, h).wrapped for h in RATES[:5]}
    fuse = seconds(lambda h: BRepAlgoAPI_Fuse(host.solid.wrapped, blocks[h]).Shape(), RATES[:5])
    for way, work in ways.items():
        work(0.98)  # from here on the place is warm
        taken = seconds(work)
        told = f"({1e3 * taken:.0f} of {1e3 * fuse:.0f} ms)"
        report.add(f"{name}: {way} / fuse", at_most(limit), taken / fuse, told)


def main() -> None:
    """Print the table."""
    report, hosts = Report(), paste_campaign.hosts()
    ridge = paste_campaign.ridges()["spiral"]
    for name, limit in (("plane", 0.2), ("cylinder", 0.05), ("sphere", 0.05)):
        measure(report, name, ridge, hosts[name], limit)
    report.show()


if __name__ == "__main__":
    main()
