"""Speed, memory and accuracy of the registration, beside what else could be used.

    python benchmarks/bench_register.py [--large]

--large adds 10 million points: some minutes and 3 GB. What is compared alternates within one run, and
medians are taken, so read the ratios: they depend little on the machine and on its other work.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from report import Report, at_least, at_most
from scipy.spatial import cKDTree

import ridgefeature as rf
from ridgefeature.grid import build_grid, typical_spacing
from ridgefeature.improve import improve
from ridgefeature.synthetic import Spiral
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]
SPIRAL = Spiral()
PICK = (*SPIRAL.spine(np.array(8.0))[:2], float(SPIRAL.height(np.array(8.0))))
PAPER_SECONDS = 50.0
PAPERS_OWN = rf.Settings(measure="M", k=2, optimiser="LN_BOBYQA")


def alternate(times: int, *runs: Callable[[], object]) -> list[float]:
    """Median seconds of each, run in turn."""
    taken: list[list[float]] = [[] for _ in runs]
    for _ in range(times):
        for run, seconds in zip(runs, taken, strict=True):
            start = time.perf_counter()
            run()
            seconds.append(time.perf_counter() - start)
    return [statistics.median(seconds) for seconds in taken]


def register_spiral(points: Array, settings: rf.Settings | None = None) -> rf.Ridge:
    return rf.register(points, at=PICK, settings=settings)


def speed(report: Report, n: int, limit: float, times: int) -> None:
    """Register, index included, against building scipy's tree of the same points."""
    points = SPIRAL.points(n, noise=0.1)
    ridge = register_spiral(points)
    if len(ridge.templates) < 20:
        raise SystemExit(f"expected at least 20 templates, found {len(ridge.templates)}")
    ours, tree = alternate(times, lambda: register_spiral(points), lambda: cKDTree(points))
    note = f"({1000 * ours:.0f} ms / {1000 * tree:.0f} ms, {len(ridge.templates)} templates)"
    report.add(f"register / cKDTree build, {n:,} points", at_most(limit), ours / tree, note)
    each = ours / len(ridge.templates)
    report.tell(
        f"seconds a template, {n:,} points; the paper has {PAPER_SECONDS:g}",
        f"{each:.2g}, {PAPER_SECONDS / each:.0f} times less",
    )


MEMORY = """
import resource, sys
import numpy as np
import ridgefeature as rf
from ridgefeature.synthetic import Spiral

def kilobytes(name):
    # A new process inherits ru_maxrss from the one that started it; Linux says better here.
    try:
        with open("/proc/self/status") as file:
            return next(int(line.split()[1]) for line in file if line.startswith(name))
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // (1024 if sys.platform == "darwin" else 1)

at = tuple(map(float, sys.argv[2:]))
rf.register(Spiral().points(20_000), at=at)
points = np.load(sys.argv[1])
before = kilobytes("VmRSS")
rf.register(points, at=at)
print((kilobytes("VmHWM") - before) * 1024 / points.nbytes)
"""


def memory(report: Report, n: int) -> None:
    """Peak memory of register beyond the points, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "points.npy"
        np.save(file, SPIRAL.points(n, noise=0.1))
        words = [sys.executable, "-c", MEMORY, str(file), *map(str, PICK)]
        done = subprocess.run(words, check=True, capture_output=True, text=True)
    name = f"peak memory of register beyond the points / the points, {n:,} points"
    report.add(name, at_most(2), float(done.stdout))


def whole_process(report: Report) -> None:
    """The command line from scan to STEP against importing cadquery."""
    with tempfile.TemporaryDirectory() as folder:
        scan = Path(folder) / "spiral.npy"
        np.save(scan, SPIRAL.points(40_000, noise=0.1))
        at = ["--at", *map(str, PICK)]
        ours = [sys.executable, "-m", "ridgefeature", "register", str(scan), *at]
        ours += ["--no-pictures", "--out", str(Path(folder) / "out")]
        theirs = [sys.executable, "-c", "import cadquery"]

        def run(words: list[str]) -> Callable[[], object]:
            return lambda: subprocess.run(words, check=True, capture_output=True)

        alternate(1, run(ours), run(theirs))
        own, cadquery = alternate(5, run(ours), run(theirs))
    note = f"({own:.2f} s / {cadquery:.2f} s)"
    report.add("process register to STEP / import cadquery", at_most(1.3), own / cadquery, note)


def errors(ridge: rf.Ridge) -> tuple[float, float, float]:
    """Rms errors in per cent: height, width at half height, spine in parts of the width."""
    s, aside = SPIRAL.path_coordinates(ridge.spine[:, :2])
    on = (s >= 0) & (s <= SPIRAL.arc_length)
    true_half = SPIRAL.section.half_height_width * SPIRAL.width(s)
    relative = (
        ridge.height / SPIRAL.height(s) - 1,
        ridge.half_height_width / true_half - 1,
        np.hypot(aside, ridge.spine[:, 2]) / SPIRAL.width(s),
    )
    height, width, spine = (100 * float(np.sqrt(np.mean(r[on] ** 2))) for r in relative)
    return height, width, spine


def accuracy(report: Report) -> None:
    """Errors without noise, and how much they gain over the paper's own measure."""
    points = SPIRAL.points(40_000)
    ridge = register_spiral(points)
    ours = errors(ridge)
    for name, value in zip(("h", "width at half height", "spine / w"), ours, strict=True):
        report.add(f"spiral, 40k points, no noise: rms error of {name} [%]", at_most(0.5), value)
    start = time.perf_counter()
    papers = register_spiral(points, PAPERS_OWN)
    seconds = time.perf_counter() - start
    theirs = errors(papers)
    for name, least, own, other in (("h", 5, ours[0], theirs[0]), ("w", 20, ours[1], theirs[1])):
        gain = f"gain over the paper's own measure (M, k = 2, BOBYQA): rms of {name}"
        report.add(gain, at_least(least), other / own, f"({other:.3g} % / {own:.3g} %)")
    covered = 100 * papers.length / SPIRAL.arc_length
    report.tell("the paper's own measure: covered, time", f"{covered:.0f} %, {seconds:.2g} s")


def patch(template: Template) -> Array:
    """Points (1800, 3) of a template, bent and tapered as its neighbours say."""
    bend, climb, spread = template.trend
    x, y = np.meshgrid(
        np.linspace(-0.5, 0.5, 30) * template.length, np.linspace(-1, 1, 60) * template.half_breadth
    )
    z = (template.height + climb * x) * template.section(y / (template.width + spread * x))
    local = np.stack([x, y + 0.5 * bend * x * x, z], -1).reshape(-1, 3)
    return np.asarray(template.position + local @ template.rotation.T)


def displaced(template: Template) -> Template:
    """The template moved aside by an eighth of its width and turned by 5 degrees."""
    aside = 0.125 * template.width * template.rotation[:, 1]
    c, s = np.cos(np.radians(5)), np.sin(np.radians(5))
    turned = template.rotation @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return template.changed(position=template.position + aside, rotation=turned)


def other_registration(report: Report) -> None:
    """One template: 8 degrees of freedom here, 6 by small_gicp, which has to know the shape beforehand."""
    try:
        import small_gicp
    except ImportError:
        report.tell("small_gicp on the same template", "skipped: not installed")
        return
    points = SPIRAL.points(100_000, noise=0.1)
    templates = register_spiral(points).templates
    start = displaced(templates[len(templates) // 2])
    misshapen = start.changed(height=1.2 * start.height, width=0.9 * start.width)
    grid = build_grid(points)
    spacing = typical_spacing(grid)
    target, tree = small_gicp.preprocess_points(points, downsampling_resolution=0.01)
    source, _ = small_gicp.preprocess_points(patch(start), downsampling_resolution=0.01)

    def ours() -> Array:
        return improve(Window(grid, spacing), misshapen, rf.Settings()).position

    def theirs() -> Array:
        motion = small_gicp.align(target, source, tree, max_correspondence_distance=1.0).T_target_source
        return np.asarray(motion[:3, :3] @ start.position + motion[:3, 3])

    seconds = alternate(21, ours, theirs)
    for name, run, taken in zip(("here, h and w too", "small_gicp"), (ours, theirs), seconds, strict=True):
        _, aside = SPIRAL.path_coordinates(run()[None, :2])
        off = 100 * abs(float(aside[0])) / start.width
        report.tell(
            f"one template, 100k points, index given: {name}", f"{1000 * taken:.1f} ms, {off:.2f} % of w off"
        )


def main() -> None:
    large = "--large" in sys.argv
    report = Report()
    register_spiral(SPIRAL.points(20_000))
    speed(report, 100_000, 3.0, 31)
    speed(report, 1_000_000, 0.25, 3)
    if large:
        speed(report, 10_000_000, 0.15, 3)
    memory(report, 10_000_000 if large else 1_000_000)
    whole_process(report)
    accuracy(report)
    other_registration(report)
    report.show()


if __name__ == "__main__":
    main()
