"""The README's pictures of the page, taken of the real page in a real Chromium.

    python docs/page_pictures.py

Needs chromium, and playwright (`pip install ".[test]"`).
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

FOLDER = Path(__file__).parent
sys.path.insert(0, str(FOLDER.parent / "tests"))

from browser_page import opened, place_on, ready, served, set_slider  # noqa: E402
from make_pictures import shrink  # noqa: E402

from ridgefeature.section import bell  # noqa: E402
from ridgefeature.synthetic import Spiral  # noqa: E402


def winding(n: int) -> np.ndarray:
    """A long thin ridge that winds over a plain: its march takes long enough to be seen."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform([-10.0, -50.0], [210.0, 50.0], (n, 2)).T
    aside = (y - 30.0 * np.sin(x / 10.0)) / np.sqrt(1.0 + (3.0 * np.cos(x / 10.0)) ** 2)
    inside = (x > 0.0) & (x < 200.0)
    return np.column_stack([x, y, np.where(inside, 1.5 * bell()(aside / 5.0), 0.0) + rng.normal(0, 0.02, n)])


def take(page: Any, folder: Path, name: str) -> None:
    page.wait_for_timeout(900)
    shot(page, folder, name)


def shot(page: Any, folder: Path, name: str) -> None:
    page.screenshot(path=folder / f"{name}.png")
    shrink(folder / f"{name}.png", FOLDER / f"page-{name}.png", 1000, 128)


def marching(folder: Path) -> None:
    points = winding(400_000)
    np.save(folder / "winding.npy", points)
    with served(folder, "winding.npy") as address, opened(address) as page:
        ready(page, "winding.npy")
        x = 10.0 * 2.5 * np.pi
        page.mouse.click(*place_on(page, points, (x, 30.0 * float(np.sin(x / 10.0)), 1.5)))
        page.wait_for_function("() => / \\d\\d+ templates/.test(document.querySelector('#busy')?.innerText)")
        page.wait_for_timeout(130)
        shot(page, folder, "marching")


def others(folder: Path) -> None:
    spiral = Spiral()
    points = spiral.points(100_000, noise=0.1)
    np.save(folder / "spiral.npy", points)
    pick = (*map(float, spiral.spine(np.array(8.0))[:2]), float(spiral.height(np.array(8.0))))
    with served(folder) as address, opened(address) as page:
        page.wait_for_selector("#empty")
        page.wait_for_function("() => !document.querySelector('#busy')")
        take(page, folder, "empty")
        page.set_input_files("#file", folder / "spiral.npy")
        ready(page, "spiral.npy")
        page.mouse.click(*place_on(page, points, (0.0, -45.0, 0.0)))
        page.wait_for_selector("#hint.bad")
        take(page, folder, "error")
        page.mouse.click(*place_on(page, points, pick))
        page.wait_for_selector("#height")
        ready(page, "spiral.npy")
        take(page, folder, "finished")
        plot = page.locator(".plot").bounding_box()
        y = plot["y"] + 60
        page.mouse.move(plot["x"] + 0.35 * plot["width"], y)
        page.mouse.down()
        page.mouse.move(plot["x"] + 0.6 * plot["width"], y, steps=5)
        page.mouse.up()
        page.wait_for_selector(".stretch")
        set_slider(page, "h", 1.6)
        page.mouse.move(plot["x"] + 0.48 * plot["width"], y)
        take(page, folder, "sliding")
        page.click("summary:has-text('Paste on a part')")
        page.select_option("[aria-label=Host]", "cylinder")
        page.click("#paste")
        page.wait_for_function("() => document.querySelector('#part-note').innerText.includes('checked')")
        take(page, folder, "paste")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        marching(Path(name))
        others(Path(name))
