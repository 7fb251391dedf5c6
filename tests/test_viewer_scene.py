"""The page's scene: what is in it, and that a click on what is seen finds it."""

from __future__ import annotations

import numpy as np
import pytest
from made_ridges import made_ridge

pytest.importorskip("vtkmodules")

from ridgefeature.viewer.scene import MOVING, STILL, Scene, by_height, ramp


@pytest.fixture
def scene() -> Scene:
    random = np.random.default_rng(0)
    points = random.uniform([-50, -30, 0], [50, 30, 1], (20_000, 3))
    scene = Scene()
    scene.window.SetSize(640, 400)
    scene.show_points(points, by_height(points))
    return scene


def test_a_click_on_a_point_finds_it(scene: Scene) -> None:
    scene.window.Render()
    for number in (3, 777, 19_999):
        found = scene.pick(*scene.on_screen(scene.points[number]))
        assert found is not None
        assert np.linalg.norm((scene.points[found] - scene.points[number])[:2]) < 1.5, (
            "no further than eight pixels"
        )
    assert scene.pick(2.0, 2.0) is None


def test_a_ridge_is_shown_changed_and_hidden(scene: Scene) -> None:
    ridge = made_ridge()
    scene.show_ridge("one", ridge, chosen=True)
    actor = scene._actors["surface one"]
    before = actor.GetBounds()
    scene.show_ridge("one", ridge.resized(h=2.0), chosen=True)
    assert scene._actors["surface one"] is actor
    scene.window.Render()
    assert actor.GetMapper().GetInput().GetBounds()[5] == pytest.approx(2 * before[5], rel=1e-3)
    assert {"surface one", "crest one", "still", "moving"} <= set(scene.names())
    scene.hide("surface one")
    assert "surface one" not in scene.names()


def test_many_points_are_thinned_for_the_screen_and_kept_for_the_pick() -> None:
    points = np.random.default_rng(1).uniform(-1, 1, (600_000, 3))
    scene = Scene()
    scene.show_points(points, by_height(points))
    assert len(scene.points) == 600_000
    counts = [scene._actors[n].GetMapper().GetInput().GetNumberOfPoints() for n in ("still", "moving")]
    assert counts == [STILL, MOVING]


def test_colours_run_from_low_to_high_whichever_way_the_scan_lies() -> None:
    x, y = np.random.default_rng(2).uniform(-10, 10, (2, 500))
    points = np.column_stack([x, y, 0.01 * x])
    points[0] = [0.0, 0.0, 3.0]
    assert by_height(points)[0].tolist() == [253, 231, 37]
    assert by_height(points[:, [2, 0, 1]])[0].tolist() == [253, 231, 37]
    assert ramp(np.array([np.nan, 0.0, 1.0]))[0].tolist() == [190, 190, 190]
    assert ramp(np.array([np.nan])).tolist() == [[190, 190, 190]]
