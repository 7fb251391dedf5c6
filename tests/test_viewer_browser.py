"""The page end to end: served, and used in a real Chromium. Skipped where there is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("playwright.sync_api")

from browser_page import CHROMIUM, SLOW, opened, place_on, ready, served, set_slider, write_scan
from page_ridges import PICK, scan

import cad_export as cx
from ridgefeature.synthetic import Spiral

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs chromium")


def test_the_spiral_is_clicked_made_higher_and_taken_away(tmp_path: Path) -> None:
    spiral = Spiral()
    points = spiral.points(40_000, noise=0.1)
    np.save(tmp_path / "spiral.npy", points)
    pick = (*map(float, spiral.spine(np.array(8.0))[:2]), float(spiral.height(np.array(8.0))))
    with served(tmp_path, "spiral.npy") as address, opened(address) as page:
        ready(page, "spiral.npy")
        assert "token" not in page.url
        page.mouse.click(*place_on(page, points, (0.0, 0.0, 0.0)))
        page.wait_for_selector("#hint.bad")
        assert page.locator("#hint").inner_text().startswith("There is no ridge here")
        page.mouse.click(*place_on(page, points, pick))
        page.wait_for_selector("#height")
        ready(page, "spiral.npy")
        before = float(page.locator("#height").input_value())
        width = float(page.locator("#width").input_value())
        page.fill("#height", "1000")
        page.keyboard.press("Tab")
        page.wait_for_selector("#hint.bad")
        assert page.locator("#hint").inner_text().startswith("height: expected")
        page.wait_for_timeout(300)
        assert page.locator("#hint.bad").count() == 1, "until something goes right"
        set_slider(page, "h", 1.5)
        page.wait_for_function(f"() => document.querySelector('#height').value > {1.49 * before}")
        assert float(page.locator("#width").input_value()) == width
        with page.expect_download() as download:
            page.click("#take-step")
        download.value.save_as(tmp_path / "spiral.step")
        ridge = cx.load(tmp_path / "spiral.step")
        assert float(ridge.height.max()) == pytest.approx(1.5 * before, rel=1e-4)
        page.keyboard.press("Control+z")
        page.wait_for_function("() => Number(document.querySelector('#h').value) === 1")
        page.click("text=Redo")
        page.wait_for_function("() => Number(document.querySelector('#h').value) === 1.5")
        page.reload()
        ready(page, "spiral.npy")
        assert float(page.locator("#height").input_value()) == pytest.approx(1.5 * before, rel=1e-4)
        assert page.locator(".ridge").count() == 1, "the state is kept"


def test_two_ridges_by_mouse_and_keys(tmp_path: Path) -> None:
    one = np.asarray(scan().points)
    points = np.concatenate([one, one + np.array([0.0, 50.0, 0.0])])
    np.save(tmp_path / "two.npy", points)
    with served(tmp_path, "two.npy") as address, opened(address) as page:
        ready(page, "two.npy")
        page.mouse.click(*place_on(page, points, (30.0, 0.0, 3.0)))
        page.wait_for_selector(".ridge >> nth=0")
        ready(page, "two.npy")
        page.focus("#view")
        for key in ("+", "+", "Shift+ArrowUp", "Shift+ArrowLeft", "f", "d"):
            page.keyboard.press(key)
        page.wait_for_selector("#shell.dark")  # by then all keys before it are done
        page.mouse.click(*place_on(page, points, (30.0, 50.0, 3.0)))
        page.wait_for_selector(".ridge >> nth=1")
        ready(page, "two.npy")
        assert page.locator(".ridge.chosen").inner_text().startswith("ridge 2")
        page.click("[aria-label='Show ridge 1']")
        page.click("[aria-label='Rename ridge 2']")
        field = "[aria-label='New name of ridge 2']"
        for text, key in (("foo", "Escape"), ("", "Enter"), ("seam", "Enter")):
            page.wait_for_selector(f"{field}:focus")
            page.keyboard.type(text)
            page.keyboard.press(key)
            page.wait_for_selector(field, state="detached")
            assert page.locator("#hint.bad").count() == 0
            if text != "seam":
                page.wait_for_selector(".ridge.chosen .name:focus")
                page.click("[aria-label='Rename ridge 2']")
        page.wait_for_selector("[aria-label='Rename seam']")
        page.click("[aria-label='Remove ridge 1']")
        page.wait_for_function("() => document.querySelectorAll('.ridge').length === 1")
        for count in (2, 2, 2, 1):
            page.click("text=Undo")
            page.wait_for_function(f"() => document.querySelectorAll('.ridge').length === {count}")


def test_a_march_is_stopped_in_the_middle(tmp_path: Path) -> None:
    write_scan(tmp_path, 200_000, 3000.0)
    with served(tmp_path, "clay.npy", program=SLOW) as address, opened(address) as page:
        ready(page, "clay.npy")
        page.focus("#view")
        for _ in range(20):
            page.keyboard.press("+")  # the ridge runs through the middle
        page.keyboard.press("Enter")
        page.wait_for_function(
            "() => /[1-9] templates/.test(document.querySelector('#busy')?.innerText ?? '')"
        )
        page.keyboard.press("Escape")
        page.wait_for_selector("#height")
        assert "It was stopped" in page.locator("#hint").inner_text()
        ready(page, "clay.npy")
        assert "interrupted" in page.locator("#summary").inner_text()


def test_files_that_are_sent_and_parts_that_are_shown(tmp_path: Path) -> None:
    write_scan(tmp_path)
    (tmp_path / "damaged.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 99\nend_header\n1 2")
    with served(tmp_path) as address, opened(address) as page:
        page.wait_for_selector("#empty")
        page.wait_for_function("() => !document.querySelector('#busy')")
        page.set_input_files("#file", tmp_path / "damaged.ply")
        page.wait_for_selector("#hint.bad")
        assert page.locator("#hint").inner_text().startswith("damaged.ply: ")
        page.select_option("[aria-label='Open a file of the working folder']", "clay.npy")
        ready(page, "clay.npy")
        page.mouse.click(*place_on(page, np.load(tmp_path / "clay.npy"), PICK))
        page.wait_for_selector("#height")
        ready(page, "clay.npy")
        with page.expect_download() as download:
            page.click("text=Save page")
        page.click("summary:has-text('Paste on a part')")
        page.click("#paste")
        page.wait_for_function("() => document.querySelector('#part-note').innerText.includes('checked')")
        set_slider(page, "h", 1.4)
        page.wait_for_function("() => document.querySelector('#height').value > 4")  # sent a little later
        page.click("text=Back to the scan")
        page.wait_for_selector(".plot")
        download.value.save_as(tmp_path / "kept.ridgepage")
        asked: list[str] = []
        page.on("dialog", lambda dialog: asked.append(dialog.message))
        page.select_option("#folder", "clay.npy")
        page.wait_for_function("() => !document.querySelector('.ridge')")
        assert len(asked) == 1 and "are lost unless you save the page" in asked[0]
        page.set_input_files("#file", tmp_path / "kept.ridgepage")
        ready(page, "kept.ridgepage")
        page.wait_for_function("() => Number(document.querySelector('#h').value) === 1")
        status = page.evaluate(
            "() => fetch('/open?name=a.ply', {method: 'POST', body: new Uint8Array(5e6)}).then(r => r.status)"
        )
        assert status == 400, "five megabytes of nothing are no scan"
