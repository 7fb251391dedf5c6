"""The page in a real Chromium, without a graphics card: how long one waits.

    python benchmarks/bench_page.py [--large]

--large adds a scan of 5 million points. Needs chromium, and playwright (`pip install ".[test]"`).
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from browser_page import opened, place_on, ready, served
from report import Report, at_most

import ridgefeature as rf
from ridgefeature.synthetic import Spiral
from ridgefeature.viewer.page import TOLD, Page
from ridgefeature.viewer.scene import Scene
from ridgefeature.viewer.session import Session

SPIRAL = Spiral()
PICK = (*map(float, SPIRAL.spine(np.array(8.0))[:2]), float(SPIRAL.height(np.array(8.0))))
_WATCH = """() => {
  window.seen = {}; window.longest = 0; let last = performance.now();
  const note = (name) => { if (!(name in window.seen)) window.seen[name] = performance.now(); };
  window.watched = setInterval(() => {
    const now = performance.now(); window.longest = Math.max(window.longest, now - last); last = now;
    if (/[1-9] templates/.test(document.querySelector('#busy')?.innerText ?? '')) note('template');
    if (document.querySelector('#height')) note('ridge');
  }, 4);
  document.addEventListener('pointerup', () => note('click'), true);
}"""


class _Told(SimpleNamespace):
    """What a page would know."""

    def __enter__(self) -> _Told:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def clicks(report: Report, folder: Path, times: int) -> None:
    """From the click to the first template, and to the finished ridge, as the page sees both."""
    points = SPIRAL.points(100_000, noise=0.1)
    np.save(folder / "spiral.npy", points)
    first: list[float] = []
    finished: list[float] = []
    with served(folder, "spiral.npy") as address, opened(address) as page:
        ready(page, "spiral.npy")
        where = place_on(page, points, PICK)
        for _ in range(times):
            page.evaluate(_WATCH)
            page.mouse.click(*where)
            page.wait_for_selector("#height")
            page.wait_for_timeout(1500)
            seen = page.evaluate("() => { clearInterval(window.watched); return window.seen; }")
            first.append((seen["template"] - seen["click"]) / 1000)
            finished.append((seen["ridge"] - seen["click"]) / 1000)
            page.keyboard.press("Control+z")
            page.wait_for_selector("#height", state="detached")
            page.wait_for_timeout(300)
    worst = f"(worst of {times}: {max(first):.2f} s, {max(finished):.2f} s)"
    report.add(
        "click to first template drawn, 100,000 points [s]", at_most(0.3), statistics.median(first), worst
    )
    report.add("click to finished ridge, 100,000 points [s]", at_most(1.5), statistics.median(finished))


def slides(report: Report) -> None:
    """Server time of one step of a slider: surface, curves, section, picture."""
    from vtkmodules.vtkWebCore import vtkWebApplication

    scan = rf.Scan(SPIRAL.points(100_000, noise=0.1))
    scene, pictures = Scene(), vtkWebApplication()
    pictures.SetImageEncoding(pictures.ENCODING_NONE)
    told: Any = _Told(**TOLD)

    def draw() -> None:
        pictures.InvalidateCache(scene.window)
        pictures.StillRender(scene.window, 92)

    page = Page(told, scene, draw)
    scene.window.SetSize(860, 520)
    page.show_scan(scan, "spiral")
    page.do(Session().added(rf.register(scan, at=PICK), PICK))
    taken = []
    for h in np.linspace(1.0, 2.0, 50):
        start = time.perf_counter()
        page.sizes.slide("h", float(h))
        taken.append(time.perf_counter() - start)
    note = f"(worst of 50: {1000 * max(taken):.0f} ms)"
    report.add("one step of a slider, server time [s]", at_most(0.06), statistics.median(taken), note)


def large(report: Report, folder: Path) -> None:
    """5 million points: load to first picture, and the longest that the page itself did not answer."""
    np.save(folder / "large.npy", SPIRAL.points(5_000_000, noise=0.1))
    with served(folder) as address, opened(address) as page:
        page.wait_for_selector("#empty")
        page.wait_for_function("() => !document.querySelector('#busy')")
        start = time.perf_counter()
        page.evaluate("() => window.trame.trigger('open', ['large.npy'])")
        ready(page, "large.npy")
        loaded = time.perf_counter() - start
        page.evaluate(_WATCH)
        box = page.locator("#view").bounding_box()
        x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
        page.mouse.move(x, y)
        page.mouse.down()
        for k in range(60):
            page.mouse.move(x + 3 * k, y + k)
            page.wait_for_timeout(16)
        page.mouse.up()
        page.wait_for_timeout(1000)
        longest = page.evaluate("() => window.longest") / 1000
    report.add("5,000,000 points: load to first picture [s]", at_most(15), loaded)
    report.add("orbit: longest that the page did not answer [s]", at_most(0.5), longest)


def main() -> None:
    report = Report()
    with tempfile.TemporaryDirectory() as name:
        clicks(report, Path(name), 9)
        slides(report)
        if "--large" in sys.argv:
            large(report, Path(name))
    report.show()


if __name__ == "__main__":
    main()
