"""What is done on the page and what it tells, without a browser."""

from __future__ import annotations

import asyncio
import gc
import json
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from page_ridges import HEIGHT, LENGTH, PICK, registered, scan

pytest.importorskip("vtkmodules")

import ridgefeature as rf
from ridgefeature.viewer import curves, preview, saved
from ridgefeature.viewer.marching import March
from ridgefeature.viewer.page import TOLD, Page
from ridgefeature.viewer.part_preview import PartPreview
from ridgefeature.viewer.scene import Scene
from ridgefeature.viewer.serve import triggers
from ridgefeature.viewer.session import History, Session
from ridgefeature.viewer.sizes import FIELDS
from ridgefeature.viewer.work import Work


class Told(SimpleNamespace):
    """What the page would know; what cannot be sent there is refused."""

    def __setattr__(self, name: str, value: Any) -> None:
        json.dumps(value)
        super().__setattr__(name, value)

    def __enter__(self) -> Told:
        return self

    def __exit__(self, *_: object) -> None:
        pass


@pytest.fixture
def page() -> Page:
    scene, drawn = Scene(), []
    page = Page(Told(**TOLD), scene, lambda: drawn.append(scene.window.Render()))
    page.show_scan(scan(), "clay.ply")
    return page


@pytest.fixture
def found(page: Page) -> Page:
    page.do(Session().added(registered(), PICK))
    return page


@pytest.fixture
def work(page: Page, tmp_path: Path) -> Iterator[Work]:
    yield Work(page, tmp_path)


@pytest.fixture
def unchecked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts are shown without the thorough checks, which take seconds; one test has them."""

    async def nothing(self: PartPreview, part: preview.Part) -> None:
        self.page.tell.part_note = part.told

    monkeypatch.setattr(PartPreview, "_check", nothing)


def on(page: Page, place: tuple[float, float, float]) -> tuple[float, float]:
    """Where a place of the scan is seen."""
    page.scene.window.Render()
    return page.scene.on_screen(np.array(place))


def test_an_open_scan_is_told(page: Page) -> None:
    assert page.tell.scan_name == "clay.ply"
    assert page.tell.scan_note.startswith("12,000 points, 90 x 40 x ") and page.tell.scan_note.endswith(" cm")
    assert page.tell.bar_text.endswith(" cm") and 40 < page.tell.bar <= 110
    assert page.tell.ridges == [] and page.tell.profile == ""
    assert page.scene.names() == ["moving", "still"]


def test_a_click_on_the_ridge_registers_it_and_tells_it(work: Work) -> None:
    page = work.page
    asyncio.run(work.click(*on(page, PICK)))
    assert page.tell.chosen == "ridge 1" and page.tell.busy == "" and not page.tell.bad
    assert float(page.tell.height) == pytest.approx(HEIGHT, rel=0.03)
    rows = {row["name"]: row["value"] for row in page.tell.rows}
    assert {"coverage", "start stopped because", "end stopped because", "in doubt"} <= set(rows)
    assert "<polyline" in page.tell.profile and 'class="dots" d="M' in page.tell.section
    assert not [name for name in page.scene.names() if name.startswith("template")]


def test_a_click_beside_the_ridge_says_so_at_the_place(work: Work) -> None:
    page = work.page
    asyncio.run(work.click(*on(page, (30.0, -16.0, 0.0))))
    assert page.tell.bad and page.tell.hint.startswith("There is no ridge here: no ridge at (")
    assert "direction=" not in page.tell.hint
    assert "pick" in page.scene.names() and page.tell.ridges == []
    asyncio.run(work.click(0.001, 0.001))
    assert page.tell.bad and page.tell.hint.startswith("There is no scan point here")


def test_a_march_is_seen_and_stopped(page: Page) -> None:
    whole = March(scan(), PICK)
    assert len(whole.run().templates) == len(whole.templates) > 6
    stopped = March(scan(), PICK)
    note = stopped._noted

    def stop_at_three(template: Any) -> None:
        note(template)
        if len(stopped.templates) == 3:
            stopped.stop()

    stopped._noted = stop_at_three  # type: ignore[method-assign]
    ridge = stopped.run()
    assert 3 <= len(ridge.templates) <= 4 < len(whole.templates) and stopped.stopped
    assert "interrupted" in ridge.stop
    none = March(scan(), PICK)
    none.stop()
    assert len(none.run().templates) <= 1, "what is there is kept"


def test_sliders_change_the_surface_and_are_one_step(found: Page) -> None:
    for h in np.linspace(1.0, 1.5, 11):
        found.sizes.slide("h", float(h))
    assert found.tell.h == 1.5
    assert float(found.tell.height) == pytest.approx(1.5 * float(np.abs(registered().height).max()), rel=1e-4)
    found.sizes.absolute("height", 2 * float(found.tell.height))
    assert found.tell.h == pytest.approx(3.0, rel=1e-3)
    found.undo()
    assert found.tell.h == 1.0 and found.tell.can_redo
    found.redo()
    found.sizes.slide("w", 0.5)
    found.sizes.reset()
    assert (found.tell.h, found.tell.w) == (1.0, 1.0)
    with pytest.raises(ValueError, match="expected a rate from"):
        found.sizes.slide("h", 99.0)
    found.sizes.slide("x", 2.0)
    assert found.feature is not None and found.feature.h == 1.0


def test_fields_of_the_page_change_the_ridge_and_nonsense_is_told(found: Page) -> None:
    def fields(**changed: Any) -> dict[str, Any]:
        return {name: getattr(found.tell, name) for name in FIELDS} | changed

    assert not found.sizes.edited(fields()), "as it was told"
    assert found.sizes.edited(fields(h=1.25))
    assert found.tell.h == 1.25 and float(found.tell.height) == pytest.approx(1.25 * HEIGHT, rel=0.03)
    assert found.sizes.edited(fields(height="6"))
    assert float(found.tell.height) == pytest.approx(6.0, rel=1e-4)
    found.sizes.edited(fields(height=""))
    assert "nan" not in found.tell.hint and "got no number" in found.tell.hint
    for nonsense in ("", "abc", None, "nan", "1e9", "-1", 0):
        for name in FIELDS:
            found.say("")
            before = fields()
            assert found.sizes.edited(fields(**{name: nonsense}))
            assert found.tell.bad and found.tell.hint.startswith(f"{name}: expected "), (name, nonsense)
            assert fields() == before


def test_what_there_is_no_room_for_changes_nothing(found: Page) -> None:
    before = found.session, found.tell.width
    with pytest.raises(ValueError, match="expected at most"):
        found.sizes.slide("w", 3.0)
    assert (found.session, found.tell.width) == before and found.tell.w == 1.0
    found.sizes.slide("h", 2.0)
    assert found.tell.h == 2.0


def test_stretches_add_up(found: Page) -> None:
    length = registered().length
    found.sizes.stretch(curves.part_of(0.1 * length, length), curves.part_of(0.4 * length, length))
    found.sizes.slide("h", 2.0)
    found.sizes.absolute("height", 1.5 * HEIGHT)
    assert float(found.tell.height) == pytest.approx(1.5 * HEIGHT, rel=0.01), "that of the stretch"
    found.sizes.stretch(curves.part_of(0.6 * length, length), curves.part_of(0.9 * length, length))
    assert found.tell.h == 1.0 and float(found.tell.height) == pytest.approx(HEIGHT, rel=0.05)
    found.sizes.slide("h", 0.5)
    assert found.feature is not None
    ridge, quarter = found.feature.ridge, len(registered().height) // 4
    assert ridge.height[quarter] == pytest.approx(1.5 * HEIGHT, rel=0.05)
    assert ridge.height[3 * quarter] == pytest.approx(0.5 * HEIGHT, rel=0.05)
    found.sizes.whole()
    assert found.tell.h == 1.0 and np.array_equal(found.feature.ridge.height, ridge.height)
    assert found.tell.earlier and found.tell.stretch == ""
    found.sizes.reset()
    assert not found.tell.earlier
    assert np.array_equal(found.feature.ridge.height, registered().height)


def test_a_stretch_is_chosen_by_keys(found: Page) -> None:
    length = registered().length
    for part, which in ((0.3, 0), (0.7, 1)):
        found.point(curves.part_of(part * length, length))
        found.sizes.bound(which)
    assert found.feature is not None
    assert found.feature.between == pytest.approx((0.3 * length, 0.7 * length))
    found.point(curves.part_of(0.8 * length, length))
    found.sizes.bound(0)
    assert found.feature.between == pytest.approx((0.8 * length, length)), "one beyond the other"


def test_a_ridge_that_is_found_a_second_time_is_chosen(work: Work, found: Page) -> None:
    found.choose("ridge 1")
    assert work.march is None
    asyncio.run(work._add(registered(), March(scan(), (30.0, 0.0, HEIGHT))))
    assert len(found.session.features) == 1 and found.tell.hint.startswith("This is ridge 1 again")


def test_a_pick_that_is_not_on_what_was_found_is_told(work: Work) -> None:
    far = replace(registered(), pick=np.array([30.0, 18.0, 0.0]))
    asyncio.run(work._add(far, March(scan(), (30.0, 18.0, 0.0))))
    assert "The pick lies 18" in work.page.tell.hint and "cm from it" in work.page.tell.hint


def test_a_click_on_a_ridge_that_is_known_chooses_it(work: Work, found: Page) -> None:
    found.do(found.session.added(registered().resized(h=-1.0), PICK))
    found.toggle("groove 1")
    asyncio.run(work.click(*on(found, PICK)))
    assert found.tell.chosen == "ridge 1" and len(found.tell.ridges) == 2


def test_the_unit_is_chosen_before_there_are_ridges(page: Page) -> None:
    page.set_unit("m")
    assert page.scan is not None and page.scan.unit == "m"
    assert page.tell.scan_note.endswith(" m") and page.tell.bar_text.endswith(" m")
    with pytest.raises(ValueError, match="expected a length unit"):
        page.set_unit("parsec")
    page.do(Session().added(registered(), PICK))
    page.set_unit("mm")
    assert page.tell.bad and page.tell.unit == page.scan.unit == "m"


def test_a_stretch_is_chosen_on_the_curves(found: Page) -> None:
    length = registered().length
    ends = curves.part_of(0.6 * length, length), curves.part_of(0.2 * length, length)
    found.sizes.stretch(*ends)
    found.sizes.slide("h", 2.0)
    assert found.tell.stretch.startswith("s = ") and 'class="stretch"' in found.tell.profile
    ridge = found.feature.ridge if found.feature else registered()
    assert ridge.height[0] == registered().height[0] and ridge.height.max() > 1.9 * HEIGHT
    found.sizes.whole()
    assert found.tell.stretch == ""
    found.sizes.stretch(ends[0], ends[0])
    assert found.tell.bad and "drag further" in found.tell.hint
    found.sizes.stretch(0.0, 1.0)
    assert found.feature is not None and found.feature.between == (0.0, length)


def test_the_dot_under_the_cursor_leaves_with_it_and_the_picked_place_stays(work: Work) -> None:
    page = work.page
    asyncio.run(work.click(*on(page, (20.0, 15.0, 0.0))))
    page.hover(*on(page, (45.0, 0.0, HEIGHT)))
    assert {"pick", "hover"} <= set(page.scene.names())
    page.away()
    assert "pick" in page.scene.names() and "hover" not in page.scene.names()


def test_what_is_wrong_with_a_value_stays_told_as_the_page_comes_to_rest(work: Work, found: Page) -> None:
    ask = triggers(found, work)
    for field, value, told in (("height", "1000", "height: expected"), ("h", 7.5, "h: expected a rate")):
        found.sizes.edited({**found.sizes.fields, field: value})
        ask["rest"]()
        assert found.tell.bad and found.tell.hint.startswith(told)
    found.sizes.edited({**found.sizes.fields, "h": 1.2})
    assert not found.tell.bad and found.tell.h == 1.2, "until something goes right"


def test_a_largest_value_is_met_in_a_stretch_and_room_is_told_as_it_is(found: Page) -> None:
    wavy = registered().resized(height=lambda s: HEIGHT * (1 + 0.2 * np.cos(s)))
    found.do(Session().added(wavy, PICK))
    found.sizes.stretch(*(curves.part_of(s, wavy.length) for s in (10.0, 24.0)))
    found.sizes.absolute("height", 2 * HEIGHT)
    assert found.feature is not None
    ridge = found.feature.ridge
    inside = (ridge.arc_length >= 10) & (ridge.arc_length <= 24)
    assert ridge.height[inside].max() == pytest.approx(2 * HEIGHT, rel=1e-9)
    found.sizes.whole()
    for _ in range(2):
        found.sizes.slide("w", found.tell.most_w)
        with pytest.raises(ValueError, match="width: expected ") as told:
            found.sizes.absolute("width", 1e3)
        most = float(str(told.value).split(" to ")[1].split()[0])
        found.sizes.absolute("width", most)
        assert float(found.tell.width) == pytest.approx(most, rel=2e-3)
        found.sizes.stretch(*(curves.part_of(s, wavy.length) for s in (10.0, 24.0)))


def test_curves_and_view_point_at_the_same_place(found: Page) -> None:
    length = registered().length
    found.point(curves.part_of(0.25 * length, length))
    assert f"s = {0.25 * length:.4g}" in found.tell.section and "place" in found.scene.names()
    found.hover(*on(found, (45.0, 0.0, HEIGHT)))
    told = curves.place_of(found.tell.place, length)
    start = float(registered().spine[0, 0])
    way = np.sign(registered().spine[-1, 0] - start)
    assert told == pytest.approx(way * (45.0 - start), abs=1.0)
    before = found.tell.place
    found.step(1)
    assert found.tell.place > before
    found.step(-1000)
    assert curves.place_of(found.tell.place, length) == pytest.approx(0.0, abs=1e-9)
    found.point(0.001)
    assert curves.place_of(found.tell.place, length) == pytest.approx(0.0, abs=1e-9), "beside the curves"


def test_ridges_are_shown_hidden_renamed_and_removed(found: Page) -> None:
    found.do(found.session.added(registered().resized(h=-1.0), PICK))
    assert [r["name"] for r in found.tell.ridges] == ["ridge 1", "groove 1"]
    found.toggle("ridge 1")
    assert "surface ridge 1" not in found.scene.names() and "surface groove 1" in found.scene.names()
    found.rename("groove 1", "seam")
    assert "surface seam" in found.scene.names() and "surface groove 1" not in found.scene.names()
    found.remove()
    assert found.tell.chosen == "ridge 1"
    found.remove("ridge 1")
    assert found.tell.ridges == [] and found.tell.rows == [] and found.tell.profile == ""
    for _ in range(4):
        found.undo()
    assert [r["name"] for r in found.tell.ridges] == ["ridge 1", "groove 1"]


def test_points_are_coloured_by_deviation_of_the_registered_ridge(found: Page) -> None:
    low = found.tell.legend
    found.sizes.slide("h", 3.0)
    found.colour("deviation")
    assert found.tell.colouring == "deviation" and found.tell.legend != low
    far = float(found.tell.legend[1].split()[0])
    assert 0.1 < far < 0.2, "three deviations of 0.05, whatever the slider says"
    legend = found.tell.legend
    found.do(found.session.added(registered().resized(h=1.2), PICK))
    assert found.tell.colouring == "deviation" and found.tell.legend != legend, "of the one that is chosen"
    found.remove()
    assert found.tell.legend == legend
    found.remove()
    assert found.tell.colouring == "height" and found.tell.legend == low


def test_a_change_is_drawn_once(found: Page) -> None:
    drawn: list[int] = []
    found.draw = lambda: drawn.append(1)
    for change in (
        partial(found.colour, "deviation"),
        found.undo,
        found.redo,
        partial(found.colour, "height"),
    ):
        drawn.clear()
        change()
        assert len(drawn) == 1, change


def test_what_is_known_of_a_ridge_goes_with_it(found: Page) -> None:
    found.history = History()
    ridge = replace(registered())
    found.found[ridge] = rf.diagnose(ridge, scan())
    found.do(Session().added(ridge, PICK))
    assert "coverage" in {row["name"] for row in found.tell.rows}
    found.undo()
    found.do(Session())
    del ridge
    gc.collect()
    assert not found.found  # another ridge may get its place in memory


def test_points_have_the_colours_of_their_file(work: Work, tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    colours = np.random.default_rng(1).integers(0, 256, (12_000, 3)).astype(np.uint8)
    trimesh.PointCloud(scan().points, colours).export(tmp_path / "a.ply")
    page = work.page
    asyncio.run(work.open_by_name("a.ply"))
    assert page.tell.coloured and page.tell.colouring == "file" and page.tell.legend == []
    shown = page.scene._actors["still"].GetMapper().GetInput().GetPointData().GetScalars()
    assert shown.GetTuple(5) == tuple(colours[5])
    page.colour("height")
    assert page.tell.colouring == "height" and len(page.tell.legend) == 2
    page.show_scan(scan(), "clay.ply")
    page.colour("file")
    assert not page.tell.coloured and page.tell.colouring == "height"


def test_the_view_is_moved_by_keys(page: Page) -> None:
    before = page.tell.bar_text, page.tell.bar
    page.look("zoom", 4.0)
    assert (page.tell.bar_text, page.tell.bar) != before
    page.look("turn", 30.0, 0.0)
    page.look("pan", 0.1, 0.1)
    page.look("fit")
    page.theme()
    assert page.tell.dark


def test_the_scale_bar_fits_the_picture_whatever_its_size(page: Page) -> None:
    page.look("fit")
    for size in ((900, 620), (900, 310)):
        page.scene.window.SetSize(*size)
        told = float(page.tell.bar_text.split()[0])
        assert page.tell.bar * page.scene.length_of_pixel() == pytest.approx(told)


def test_files_are_opened_by_name_in_the_working_folder_only(work: Work, tmp_path: Path) -> None:
    page = work.page
    np.save(tmp_path / "own.npy", scan().points[:5000])
    asyncio.run(work.open_by_name("own.npy"))
    assert page.tell.scan_name == "own.npy" and page.tell.scan_note.startswith("5,000 points")
    for name in ("../other.npy", "/etc/passwd"):
        asyncio.run(work.open_by_name(name))
        assert page.tell.bad and "expected a file in" in page.tell.hint
    assert work.files() == ["own.npy"]
    (tmp_path / "bad.ply").write_text("ply\nformat ascii 1.0\nelement vertex 3\n")
    asyncio.run(work.open_by_name("bad.ply"))
    assert page.tell.bad and "bad.ply" in page.tell.hint
    assert page.tell.scan_name == "own.npy" and page.tell.busy == "", "what was open stays open"


def test_a_page_is_saved_and_opened_again(work: Work, found: Page, tmp_path: Path) -> None:
    found.sizes.slide("h", 1.5)
    path = asyncio.run(work.take("page", "", tmp_path))
    assert path.name == "clay" + saved.SUFFIX
    found.show_scan(scan(), "other")
    asyncio.run(work.open(path, path.name))
    assert found.tell.chosen == "ridge 1" and found.tell.h == 1.5
    assert any(row["name"] == "coverage" for row in found.tell.rows)


@pytest.mark.parametrize("kind", preview.HOSTS)
def test_the_ridge_is_seen_on_a_part(work: Work, found: Page, kind: str, unchecked: None) -> None:
    found.sizes.slide("h", 1.2)
    found.tell.host = kind
    asyncio.run(work.preview.paste())
    part = work.preview.part
    assert part is not None and found.tell.pasting and found.tell.busy == ""
    assert part.solid.isValid() and part.solid.Volume() > 0 and len(part.grown) > 100
    assert not found.scene._actors["still"].GetVisibility()
    work.preview.leave()
    assert found.scene._actors["still"].GetVisibility() and "part" not in found.scene.names()


def test_a_part_is_checked_told_and_taken_away(work: Work, found: Page, tmp_path: Path) -> None:
    asyncio.run(work.preview.paste())
    assert "checked for self-intersections" in found.tell.part_note
    path = asyncio.run(work.take("part", "", tmp_path))
    import cad_export as cx

    assert np.allclose(cx.load(path).height, registered().height)


def test_a_part_follows_the_sliders_and_the_click(work: Work, found: Page, unchecked: None) -> None:
    async def story() -> list[float]:
        await work.preview.paste()
        volumes = []
        for change in (lambda: found.sizes.slide("h", 1.5), lambda: None):
            change()
            work.preview.again()
            assert work.preview._task is not None
            await work.preview._task
            assert work.preview.part is not None
            volumes.append(work.preview.part.solid.Volume())
        host = work.preview._host[2].Volume()
        middle = work.preview.part.points[np.unique(work.preview.part.grown)].mean(axis=0)
        await work.preview.put(*on(found, (middle[0] + 3.0, middle[1] + 3.0, middle[2])))
        assert work.preview._task is not None
        await work.preview._task
        assert work.preview.part is not None, found.tell.hint
        moved = work.preview.part.points[np.unique(work.preview.part.grown)].mean(axis=0)
        assert np.linalg.norm((moved - middle)[:2]) > 1.0
        return [v - host for v in volumes]

    taller, same = asyncio.run(story())
    assert taller == same and taller > 0


def test_a_ridge_is_turned_on_its_part(work: Work, found: Page, unchecked: None) -> None:
    async def story() -> list[np.ndarray]:
        await work.preview.paste()
        sizes = []
        for turn in (0.0, 90.0, -90.0, 180.0):
            found.tell.part_turn = turn
            work.preview.again()
            assert work.preview._task is not None
            await work.preview._task
            assert work.preview.part is not None, found.tell.hint
            sizes.append(np.ptp(work.preview.part.points[np.unique(work.preview.part.grown)], axis=0))
        return sizes

    along, across, other, back = asyncio.run(story())
    assert along[0] > 2 * along[1]
    np.testing.assert_allclose(across[[1, 0, 2]], along, rtol=0.01)
    np.testing.assert_allclose(other, across, rtol=0.01)
    np.testing.assert_allclose(back, along, rtol=0.01)


def test_a_part_that_is_asked_for_twice_and_a_click_meanwhile_are_both_heard(
    work: Work, found: Page, unchecked: None
) -> None:
    async def story() -> None:
        both = [asyncio.ensure_future(work.preview.paste()) for _ in range(2)]
        await asyncio.sleep(0)
        await asyncio.gather(*both)
        assert work.preview.part is not None and found.tell.busy == ""
        points = work.preview.part.points
        across, along = 0.98 * points[:, :2].max(axis=0)
        corner = on(found, (across, along, work.preview._host[3][2]))
        work.preview.again()
        await asyncio.sleep(0.001)
        await work.preview.put(*corner)
        assert work.preview._task is not None
        await work.preview._task
        assert work.preview.part is not None and found.tell.hint.endswith("It stays where it was.")

    asyncio.run(story())


def test_who_left_while_it_was_pasted_stays_with_the_scan(work: Work, found: Page, unchecked: None) -> None:
    async def story() -> None:
        await work.preview.paste()
        work.preview.again()
        await asyncio.sleep(0.001)
        work.preview.leave()
        assert work.preview._task is not None
        await work.preview._task

    asyncio.run(story())
    assert not found.tell.pasting and not found.tell.bad
    assert found.scene._actors["still"].GetVisibility()


def test_a_scan_that_is_opened_while_a_part_is_shown_is_seen(
    work: Work, found: Page, unchecked: None
) -> None:
    asyncio.run(work.preview.paste())
    assert not found.scene._actors["still"].GetVisibility()
    found.show_scan(scan(), "again.ply")
    assert found.scene._actors["still"].GetVisibility()


def test_a_hidden_ridge_is_not_pointed_at(found: Page) -> None:
    found.point(0.5)
    assert "place" in found.scene.names()
    found.toggle("ridge 1")
    found.point(0.6)
    assert "place" not in found.scene.names()
    found.toggle("ridge 1")
    assert "place" in found.scene.names()


def test_what_is_wrong_again_is_told_again(work: Work, found: Page) -> None:
    ask = triggers(found, work)
    for _ in range(2):
        ask["stretch"](0.5, 0.505)
        assert found.tell.bad and found.tell.hint.startswith("This stretch is too short")
    ask["set_unit"]("m")
    assert found.tell.bad and found.tell.hint.startswith("The unit of a scan")
    ask["rest"]()
    assert found.tell.bad
    ask["toggle"]("ridge 1")
    assert not found.tell.bad


def test_another_host_is_looked_at_anew(work: Work, found: Page, unchecked: None) -> None:
    async def story() -> list[np.ndarray]:
        await work.preview.paste()
        eyes = []
        for kind in ("plane", "cylinder", "sphere", "plane"):
            found.tell.host = kind
            work.preview.again()
            assert work.preview._task is not None
            await work.preview._task
            assert work.preview.part is not None and work.preview._host[0] == kind
            eyes.append(np.array(found.scene.renderer.GetActiveCamera().GetDirectionOfProjection()))
        return eyes

    plane, cylinder, sphere, again = asyncio.run(story())
    assert plane[2] < -0.8 and cylinder[0] > 0.8 and sphere[0] > 0.8
    np.testing.assert_allclose(again, plane, atol=1e-6)


@pytest.mark.parametrize("turn", [30.0, -135.0])
@pytest.mark.parametrize("kind", preview.HOSTS)
def test_turned_directions_lie_on_the_face(kind: str, turn: float) -> None:
    host, at = preview.host_for(kind, registered())
    told = preview.direction_on(host, at, registered(), turn)
    straight = preview.direction_on(host, at, registered(), 1e-9)
    assert told is not None and straight is not None
    assert preview.direction_on(host, at, registered(), 0.0) is None
    cosine = told @ straight / np.linalg.norm(told) / np.linalg.norm(straight)
    assert cosine == pytest.approx(np.cos(np.radians(turn)), abs=1e-6)
    up = replace(
        registered(), spine=registered().spine[:, [2, 1, 0]], tangent=registered().tangent[:, [2, 1, 0]]
    )
    across = [preview.direction_on(host, at, up, angle) for angle in (1e-9, turn)]
    assert across[0] @ across[1] / np.linalg.norm(across[0]) / np.linalg.norm(across[1]) == pytest.approx(
        np.cos(np.radians(turn)), abs=1e-6
    )
    outwards = {"plane": [0, 0, 1]}.get(kind, [-1, 0, 0])
    np.testing.assert_allclose([told @ outwards, straight @ outwards], 0, atol=1e-6 * np.linalg.norm(told))


def test_a_part_stays_as_it_was_where_it_cannot_be_put(work: Work, found: Page, unchecked: None) -> None:
    async def story() -> None:
        await work.preview.paste()
        assert work.preview.part is not None
        volume, points = work.preview.part.solid.Volume(), work.preview.part.points
        across, along = 0.98 * points[:, :2].max(axis=0)
        await work.preview.put(*on(found, (across, along, work.preview._host[3][2])))
        assert work.preview._task is not None
        await work.preview._task
        assert found.tell.bad and found.tell.hint.endswith("It stays where it was.")
        assert "=" not in found.tell.hint, "that is for scripts"
        assert work.preview.part is not None and found.tell.part_note
        assert work.preview.part.solid.Volume() == volume

    asyncio.run(story())


def test_what_cannot_be_pasted_is_told(work: Work, found: Page, tmp_path: Path) -> None:
    import cadquery as cq

    path = tmp_path / "small.step"
    cq.exporters.export(cq.Workplane().box(10, 10, 10), str(path))

    async def story() -> None:
        await work.preview.open_host(path, path.name)
        assert found.tell.host == "file" and found.tell.host_name == "small.step"
        assert found.tell.hint.startswith("Click on the face") and "part" in found.scene.names()
        await work.preview.put(*on(found, (0.0, 0.0, 5.0)))
        assert work.preview._task is not None
        await work.preview._task
        assert found.tell.bad and found.tell.hint.startswith("It cannot be pasted there: ")
        assert "part" in found.scene.names() and found.tell.busy == "", "another face may be clicked"
        await work.preview.put(0.001, 0.001)
        assert found.tell.hint.startswith("There is no part here")

    asyncio.run(story())
    assert "=" not in found.tell.hint
    with pytest.raises(ValueError, match="expected a part with a ridge"):
        asyncio.run(work.take("part", "", tmp_path))
    cq.exporters.export(cq.Workplane().rarray(30, 1, 2, 1).box(10, 10, 10), str(path))
    with pytest.raises(ValueError, match="expected one solid"):
        asyncio.run(work.preview.open_host(path, path.name))
    with pytest.raises(ValueError, match="host: expected one of"):
        preview.host_for("cone", registered())


def test_the_length_of_the_ridge_is_that_of_the_scan() -> None:
    assert registered().length == pytest.approx(LENGTH, rel=0.02)
