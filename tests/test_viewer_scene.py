"""The page's scene: what is in it, and that a click on what is seen finds it."""

from __future__ import annotations

import numpy as np
import pytest
from made_ridges import made_ridge

pytest.importorskip("vtkmodules")

from ridgefeature.viewer.colours import by_deviation, by_height, ramp
from ridgefeature.viewer.scene import MOVING, STILL, Scene


@pytest.fixture
def scene() -> Scene:
    random = np.random.default_rng(0)
    scene = Scene()
    scene.window.SetSize(640, 400)
    scene.show_points(random.uniform([-50, -30, 0], [50, 30, 1], (20_000, 3)))
    return scene


def test_a_click_on_a_point_finds_it(scene: Scene) -> None:
    scene.window.Render()
    for number in (3, 777, 19_999):
        place = scene.still[number]
        found = scene.pick(*scene.on_screen(place))
        assert found is not None
        assert np.linalg.norm(found - place) < 10 * scene.length_of_pixel(), "no further than eight pixels"
    assert scene.pick(0.01, 0.01) is None


def test_a_ridge_is_shown_changed_and_hidden(scene: Scene) -> None:
    ridge = made_ridge()
    scene.show_ridge("ridge 1", ridge, chosen=True)
    scene.show_ridge("ridge 10", ridge, chosen=False)
    actor = scene._actors["surface ridge 1"]
    before = actor.GetBounds()
    scene.show_ridge("ridge 1", ridge.resized(h=2.0), chosen=True)
    assert scene._actors["surface ridge 1"] is actor
    scene.window.Render()
    assert actor.GetMapper().GetInput().GetBounds()[5] == pytest.approx(2 * before[5], rel=1e-3)
    scene.hide_ridge("ridge 1")
    assert {"surface ridge 10", "crest ridge 10", "still", "moving"} == set(scene.names())


def test_many_points_are_thinned_for_the_screen() -> None:
    scene = Scene()
    scene.show_points(np.random.default_rng(1).uniform(-1, 1, (600_000, 3)))
    assert len(scene.still) == STILL
    counts = [scene._actors[n].GetMapper().GetInput().GetNumberOfPoints() for n in ("still", "moving")]
    assert counts == [STILL, MOVING]
    assert scene.pick(*scene.on_screen(scene.still[5]), coarsely=True) is not None


def test_the_camera_turns_pans_zooms_and_comes_back(scene: Scene) -> None:
    place = scene.still[100]
    scene.window.Render()
    begun, pixel = scene.on_screen(place), scene.length_of_pixel()
    scene.keep_camera()
    scene.pan(0.25, 0.0)
    moved = scene.on_screen(place)
    assert moved[0] == pytest.approx(begun[0] - 0.25 * 400 / 640, abs=1e-3)
    assert moved[1] == pytest.approx(begun[1], abs=1e-3)
    scene.zoom(2.0)
    assert scene.length_of_pixel() == pytest.approx(0.5 * pixel)
    scene.turn(30.0, 10.0)
    assert np.hypot(*np.subtract(scene.on_screen(place), moved)) > 0.01
    scene.restore_camera()
    assert scene.on_screen(place) == pytest.approx(begun, abs=1e-6)


def test_a_part_hides_the_scan_is_picked_and_leaves_it_as_it_was(scene: Scene) -> None:
    points = np.array([[0.0, 0, 5], [10, 0, 5], [0, 10, 5], [10, 10, 5]])
    scene.show_part(points, np.array([[0, 1, 2]]), np.array([[1, 3, 2]]))
    scene.look_at_part(points, np.array([[1, 3, 2]]))
    scene.window.Render()
    assert not scene._actors["still"].GetVisibility()
    for moving in (True, False):
        scene.coarse(moving)
        assert not any(scene._actors[name].GetVisibility() for name in ("still", "moving"))
    found = scene.pick_part(*scene.on_screen(np.array([7.0, 7.0, 5.0])))
    assert found == pytest.approx([7, 7, 5], abs=1e-3)
    scene.hide("part")
    scene.only_part(False)
    assert scene._actors["still"].GetVisibility() and scene.pick_part(0.5, 0.5) is None


def test_colours_run_from_low_to_high_whichever_way_the_scan_lies() -> None:
    x, y = np.random.default_rng(2).uniform(-10, 10, (2, 500))
    points = np.column_stack([x, y, 0.01 * x])
    points[0] = [0.0, 0.0, 3.0]
    assert by_height(points).pixels[0].tolist() == [253, 231, 37]
    assert by_height(points[:, [2, 0, 1]]).pixels[0].tolist() == [253, 231, 37]
    told = ramp(np.array([np.nan, 0.0, 1.0]))
    assert told.pixels[0].tolist() == [190, 190, 190] and (told.low, told.high) == (0.01, 0.99)
    assert ramp(np.array([np.nan])).pixels.tolist() == [[190, 190, 190]]


def test_deviations_are_blue_below_and_red_above() -> None:
    below, level, above, unknown = (
        by_deviation(np.array([-9.0, 0.0, 9.0, np.nan, 0.1, -0.1])).pixels[:4].tolist()
    )
    assert below[2] > 2 * below[0] and above[0] > 2 * above[2]
    assert level == [225, 225, 225] and unknown == [190, 190, 190]
    assert by_deviation(np.array([np.nan])).gradient.startswith("linear-gradient(to right, rgb(")
