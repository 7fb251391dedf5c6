"""The served page in a real Chromium: start both, click where places of a scan are seen."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from page_ridges import scan

from ridgefeature.viewer.scene import Scene

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
_FLAGS = ["--no-sandbox", "--enable-unsafe-swiftshader"]
SLOW = (str(Path(__file__).with_name("slow_view.py")),)
"""The program with a march that can be stopped in time."""
_WAIT = 60_000
"""Milliseconds."""


@contextmanager
def served(folder: Path, *words: str, program: tuple[str, ...] = ("-m", "ridgefeature")) -> Iterator[str]:
    """The page's address; `words` are what the command is asked besides."""
    log = folder / "view.log"
    command = [sys.executable, "-u", *program, "view", "--no-browser", *words]
    with log.open("w") as file:
        process = subprocess.Popen(command, cwd=folder, stdout=file, stderr=subprocess.STDOUT)
    try:
        for _ in range(600):
            found = re.search(r"http://\S+", log.read_text())
            if found or process.poll() is not None:
                break
            try:
                process.wait(0.1)
            except subprocess.TimeoutExpired:
                continue
        assert found, f"no address: {log.read_text()}"
        yield found.group(0)
        assert process.poll() is None, f"the server ended: {log.read_text()}"
    finally:
        process.terminate()
        try:
            process.wait(10)
        finally:
            process.kill()


@contextmanager
def opened(address: str) -> Iterator[Any]:
    """A page of Playwright's at an address, 1280 x 720."""
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=CHROMIUM, args=_FLAGS)
        page = browser.new_page(viewport={"width": 1280, "height": 720}, accept_downloads=True)
        page.set_default_timeout(_WAIT)
        page.on("dialog", lambda dialog: dialog.accept())
        elsewhere: list[str] = []
        own = address.split("/?")[0]
        page.on("request", lambda r: r.url.startswith((own, "blob:", "data:")) or elsewhere.append(r.url))
        page.goto(address)
        yield page
        assert elsewhere == [], "nothing is fetched from elsewhere"
        browser.close()


def ready(page: Any, name: str) -> None:
    """Wait until a scan is open and the page has nothing to do."""
    page.wait_for_function(f"() => document.querySelector('#scan-note')?.innerText.includes('{name}')")
    page.wait_for_function("() => !document.querySelector('#busy')")
    page.wait_for_selector("#view img, #view canvas")


def place_on(page: Any, points: np.ndarray, place: tuple[float, float, float]) -> tuple[float, float]:
    """Pixels of the window at which a place of a scan is seen that was just opened."""
    scene = Scene()
    scene.show_points(points)
    box = page.locator("#view").bounding_box()
    scene.window.SetSize(round(box["width"]), round(box["height"]))
    scene.window.Render()
    across, down = scene.on_screen(np.array(place))
    return box["x"] + across * box["width"], box["y"] + down * box["height"]


def set_slider(page: Any, name: str, value: float) -> None:
    """As someone who drags it there in some steps."""
    for part in (0.4, 0.8, 1.0):
        page.locator(f"#{name}").evaluate(
            "(e, v) => { e.value = v; e.dispatchEvent(new Event('input')); }", str(1 + part * (value - 1))
        )
    page.locator(f"#{name}").evaluate("e => e.dispatchEvent(new Event('change'))")


def write_scan(folder: Path, n: int = 12_000, length: float = 60.0) -> np.ndarray:
    points = np.asarray(scan(n, length).points)
    np.save(folder / "clay.npy", points)
    return points
