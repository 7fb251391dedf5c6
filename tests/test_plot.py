"""Pictures: there, of the right size, not blank, and of the right figures."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ridgefeature as rf
from ridgefeature import plot
from ridgefeature.curvilinear import crest, local_coordinates, templates_on, thinned
from ridgefeature.kernels.algebra import rotation_of
from ridgefeature.plot import camera, scene
from ridgefeature.plot.marks import outline
from ridgefeature.readable import number
from ridgefeature.section import bell, plateau
from ridgefeature.synthetic import Spiral

SPIRAL = Spiral()


@pytest.fixture(scope="module")
def scan() -> rf.Scan:
    return rf.Scan(SPIRAL.points(15_000, 0.1, seed=3))


@pytest.fixture(scope="module")
def ridge(scan: rf.Scan) -> rf.Ridge:
    return rf.register(scan, (28.94, 7.906, 5.764))


def pixels(path: Path) -> np.ndarray[Any, Any]:
    from matplotlib.image import imread

    return imread(path)[..., :3]


def test_profile_shows_the_stations_and_their_bands(ridge: rf.Ridge, tmp_path: Path) -> None:
    figure = plot.profile(ridge, tmp_path / "p.png")
    image = pixels(tmp_path / "p.png")
    assert image.shape == (800, 1200, 3)
    assert image[100:700, 100:1100].std() > 0.02
    for axes, values, std in zip(
        figure.axes, (ridge.height, ridge.width), (ridge.height_std, ridge.width_std), strict=True
    ):
        lines = [line.get_xydata() for line in axes.lines]
        assert any(np.array_equal(line, np.column_stack([ridge.arc_length, values])) for line in lines)
        edge = axes.collections[0].get_paths()[0].vertices
        assert edge[:, 1].max() == pytest.approx((values + std).max())
        assert edge[:, 1].min() == pytest.approx((values - std).min())
        assert "[mm]" in axes.get_ylabel()
        low, high = axes.get_ylim()
        assert low <= 0 < values.max() < high
    assert "[mm]" in figure.axes[1].get_xlabel()


def test_profile_shows_each_template_with_its_error(ridge: rf.Ridge, tmp_path: Path) -> None:
    figure = plot.profile(ridge, tmp_path / "p.png")
    (bars,) = figure.axes[0].containers
    points, _, (segments,) = bars
    np.testing.assert_array_equal(points.get_ydata(), [t.height for t in ridge.templates])
    np.testing.assert_array_equal(points.get_xdata(), templates_on(ridge)[1])
    spans = [np.ptp(segment[:, 1]) for segment in segments.get_segments()]
    np.testing.assert_allclose(spans, [2 * t.std[6] for t in ridge.templates if t.std is not None], rtol=1e-9)


def test_a_ridge_that_was_changed_is_shown_with_what_was_registered(
    ridge: rf.Ridge, scan: rf.Scan, tmp_path: Path
) -> None:
    taller = ridge.resized(h=1.4)
    figure = plot.profile(taller, tmp_path / "p.png", scan, ridge)
    lines = [line.get_xydata() for line in figure.axes[0].lines]
    for one in (taller, ridge):
        assert any(np.array_equal(line, np.column_stack([one.arc_length, one.height])) for line in lines)
    names = figure.axes[0].get_legend_handles_labels()[1]
    assert "as registered" in names
    plain = plot.profile(ridge, tmp_path / "p.png", scan)
    np.testing.assert_array_equal(*(f.axes[2].lines[0].get_xydata() for f in (figure, plain)))
    assert "as registered" not in plain.axes[0].get_legend_handles_labels()[1]


def test_what_is_beside_the_curve_is_in_the_picture_but_for_what_is_far_off(
    ridge: rf.Ridge, tmp_path: Path
) -> None:
    first, *others = ridge.templates
    for height, shown in ((1.4, True), (40.0, False)):
        high = float(height * ridge.height.max())
        odd = replace(ridge, templates=(first.changed(height=high), *others))
        top = plot.profile(odd, tmp_path / "p.png").axes[0].get_ylim()[1]
        assert (high < top) == shown and top < 2 * ridge.height.max()
    wavering = replace(ridge, height_std=0.5 * ridge.height)
    assert plot.profile(wavering, tmp_path / "p.png").axes[0].get_ylim()[1] > 1.5 * ridge.height.max()


def test_widths_of_templates_of_another_section_are_compared_at_half_height(
    ridge: rf.Ridge, tmp_path: Path
) -> None:
    """The feet of a plateau lie elsewhere than those of a bell, on the same points."""
    rate = ridge.section.half_height_width / plateau().half_height_width
    others = tuple(t.changed(section=plateau(), width=rate * t.width) for t in ridge.templates)
    figure = plot.profile(replace(ridge, templates=others), tmp_path / "p.png")
    axes = figure.axes[1]
    (bars,) = axes.containers
    _, places = templates_on(ridge)
    curve = np.interp(places, ridge.arc_length, ridge.half_height_width)
    np.testing.assert_allclose(np.asarray(bars[0].get_ydata(), float), curve, rtol=0.1)
    lines = [line.get_xydata() for line in axes.lines]
    drawn = np.column_stack([ridge.arc_length, ridge.half_height_width])
    assert any(np.array_equal(line, drawn) for line in lines)


def _with_strangers(ridge: rf.Ridge) -> rf.Ridge:
    """With a template beyond the end, and one off the path, both as wide as the others."""
    first, middle = ridge.templates[0], ridge.templates[len(ridge.templates) // 2]
    beyond = first.changed(position=ridge.spine[0] - 1.5 * first.length * ridge.tangent[0])
    aside = middle.changed(position=middle.position + middle.width * middle.rotation[:, 1])
    return replace(ridge, templates=(beyond, *ridge.templates, aside))


def test_templates_that_are_no_part_of_the_ridge_are_not_drawn(ridge: rf.Ridge, tmp_path: Path) -> None:
    changed = _with_strangers(ridge)
    kept, places = templates_on(changed)
    assert kept == templates_on(ridge)[0] == ridge.templates
    assert (np.diff(places) > 0).all() and 0 <= places[0] < places[-1] <= ridge.length
    (bars,) = plot.profile(changed, tmp_path / "p.png").axes[0].containers
    assert len(bars[0].get_xdata()) == len(ridge.templates)
    outlines = scene.build(changed, SPIRAL.points(2000, seed=4)).outlines
    assert len(outlines) == len(ridge.templates)
    for line in outlines:
        s, y, _ = local_coordinates(ridge, line)
        on_spine = s[np.abs(y) < 0.1 * ridge.width[0]]
        assert on_spine.min() > -0.1 * ridge.width[0] and on_spine.max() < ridge.length + 0.1 * ridge.width[0]


def test_which_templates_are_drawn_does_not_depend_on_how_the_scan_is_turned(ridge: rf.Ridge) -> None:
    turn, _ = rotation_of(np.array([0.4, -1.1, 0.7]))
    changed = _with_strangers(ridge)
    moved = replace(
        changed,
        spine=changed.spine @ turn.T + 5,
        tangent=changed.tangent @ turn.T,
        normal=changed.normal @ turn.T,
        templates=tuple(
            t.changed(position=turn @ t.position + 5, rotation=turn @ t.rotation) for t in changed.templates
        ),
    )
    assert len(templates_on(moved)[0]) == len(templates_on(changed)[0])
    np.testing.assert_allclose(templates_on(moved)[1], templates_on(changed)[1], atol=1e-9)


def test_section_panel_collapses_the_scan(ridge: rf.Ridge, scan: rf.Scan, tmp_path: Path) -> None:
    figure = plot.profile(ridge, tmp_path / "p.png", scan)
    assert pixels(tmp_path / "p.png").shape == (800, 1700, 3)
    eta, zeta = figure.axes[2].lines[0].get_xydata().T
    assert len(eta) > 2000
    off = zeta - ridge.section(eta)
    assert np.sqrt(np.mean(off**2)) < 0.1
    assert zeta[np.abs(eta) < 0.05].mean() == pytest.approx(1, abs=0.08)


def test_a_groove_and_unknown_deviations_are_drawn(ridge: rf.Ridge, tmp_path: Path) -> None:
    unknown = np.full_like(ridge.height, np.inf)
    groove = replace(ridge.resized(h=-1), height_std=unknown)
    figure = plot.profile(groove, tmp_path / "p.png")
    low, high = figure.axes[0].get_ylim()
    assert high == 0 and low < ridge.height.max() * -1
    assert "groove" in figure.axes[0].get_ylabel()


def test_local_coordinates_find_the_stations_again(ridge: rf.Ridge) -> None:
    places = ridge.spine + 1.5 * ridge.across + 0.7 * ridge.normal
    s, y, z = local_coordinates(ridge, places)
    np.testing.assert_allclose(s, ridge.arc_length, atol=0.3)
    np.testing.assert_allclose(y, 1.5, atol=0.02)
    np.testing.assert_allclose(z, 0.7, atol=0.02)


def test_local_coordinates_between_stations(ridge: rf.Ridge) -> None:
    random = np.random.default_rng(1)
    s = random.uniform(10, SPIRAL.arc_length - 10, 500)
    places = SPIRAL.spine(s) * (1 - 1 / SPIRAL.radius) + [0, 0, 2]
    found, y, z = local_coordinates(ridge, places)
    assert np.ptp(found - s) < 0.5
    np.testing.assert_allclose(y, 1, atol=0.15)
    np.testing.assert_allclose(z, 2, atol=0.15)


def test_heights_on_a_pipe_are_over_the_pipe(tmp_path: Path) -> None:
    radius, x = 25.0, np.random.default_rng(1)
    s, across = x.uniform(-50, 50, 20_000), x.uniform(-15, 15, 20_000)
    out = radius + 3 * bell()(across / 10) + x.normal(0, 0.05, 20_000)
    points = np.column_stack([s, out * np.sin(across / radius), out * np.cos(across / radius) - radius])
    ridge = rf.register(points, at=(0, 0, 3))
    dots = plot.profile(ridge, tmp_path / "p.png", points).axes[-1].lines[0]
    eta, zeta = np.asarray(dots.get_data())
    assert np.abs(zeta - bell()(eta)).max() < 0.15  # the noise is 0.017, up to the borders
    assert np.abs(eta).max() > 0.9


def test_outline_lies_on_its_template(ridge: rf.Ridge) -> None:
    template = ridge.templates[3]
    line = (outline(template) - template.position) @ template.rotation
    np.testing.assert_array_equal(line[0], line[-1])
    assert line[:, 2].max() == pytest.approx(template.height, rel=1e-3)
    assert np.abs(line[:, 1]).max() == pytest.approx(template.half_breadth)
    assert np.ptp(line[:, 0]) == pytest.approx(template.length)


def test_the_crest_of_a_leaning_section_lies_aside_of_the_spine(ridge: rf.Ridge) -> None:
    top = ridge.spine + ridge.height[:, None] * ridge.normal
    np.testing.assert_allclose(crest(ridge), top, atol=0.01)
    leaning = rf.Section(np.array([0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 0.8, 0.1]), "leaning")
    lines = crest(replace(ridge, section=leaning))
    aside = ((lines - top) * ridge.across).sum(axis=1) / ridge.width
    assert (np.abs(aside - 2 / 12) < 0.02).all(), "its largest control point is the second beyond the middle"
    heights = ((lines - ridge.spine) * ridge.normal).sum(axis=1)
    assert (heights > 0.95 * ridge.height).all() and (heights < 1.001 * ridge.height).all()


def test_an_outline_is_cut_off_where_the_ridge_ends(ridge: rf.Ridge) -> None:
    template = ridge.templates[3]
    line = (outline(template, back=0.1 * template.length) - template.position) @ template.rotation
    assert line[:, 0].min() == pytest.approx(-0.1 * template.length)
    assert line[:, 0].max() == pytest.approx(0.5 * template.length)


def test_thinned_keeps_points_of_the_scan() -> None:
    points = np.random.default_rng(0).normal(size=(1000, 3))
    few = thinned(points, 100)
    assert len(few) == 100
    assert len(np.unique(few, axis=0)) == 100
    assert {tuple(p) for p in few} <= {tuple(p) for p in points}
    assert thinned(points, 1000) is points


@pytest.mark.parametrize("look", [camera.from_above, camera.oblique])
def test_cameras_frame_the_whole_ridge(look: Any, ridge: rf.Ridge) -> None:
    grid = ridge.surface().grid(50, 20)
    eye = look(ridge, grid, 1.7)
    axes = np.array([eye.right, eye.up, eye.toward])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
    assert eye.half_width == pytest.approx(1.7 * eye.half_height)
    seen = np.abs(eye.project(grid)) / [eye.half_width, eye.half_height]
    assert 0.85 < seen.max() < 1
    assert eye.toward @ ridge.normal.mean(axis=0) > 0.6


def test_a_long_ridge_lies_along_the_picture(ridge: rf.Ridge) -> None:
    assert not camera.is_long(ridge)
    line = np.linspace(0, 200, len(ridge.spine))[:, None] * np.array([0.6, 0.8, 0])
    straight = replace(ridge, spine=line, normal=np.tile([0.0, 0, 1], (len(line), 1)))
    assert camera.is_long(straight)
    eye = camera.from_above(straight, line, 4)
    np.testing.assert_allclose(eye.right, [0.6, 0.8, 0], atol=1e-9)


def _shows_ridge(path: Path, ridge: rf.Ridge, scan: rf.Scan) -> None:
    figure = plot.view(scan, ridge, path)
    image = pixels(path)
    assert image.shape == (1000, 1700, 3)
    panels = [axes for axes in figure.axes if axes.get_title(loc="left")]
    assert len(panels) == 2
    orange = []
    for axes in panels:
        box = axes.get_window_extent()
        part = image[1000 - round(box.y1) : 1000 - round(box.y0), round(box.x0) : round(box.x1)]
        assert part.std() > 0.1
        orange.append(((part[..., 0] - part[..., 2] > 0.45) & (part[..., 1] > 0.35)).mean())
        red = (part[..., 0] > 0.75) & (part[..., 1] < 0.3) & (part[..., 2] < 0.3)
        assert red.mean() > 0.002
        said = {text.get_text() for text in axes.texts}
        assert "start, s = 0" in said and "10 mm" in said
        assert any(words.startswith("end, s = ") for words in said)
    assert orange[1] > 0.05 > orange[0]
    legend = {text.get_text().split()[0] for text in figure.legends[0].get_texts()}
    assert legend == {"scan", "templates", "ridge", "crest", "pick"}


def test_view_by_vtk(
    ridge: rf.Ridge, scan: rf.Scan, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("vtkmodules.vtkRenderingOpenGL2")
    _shows_ridge(tmp_path / "v.png", ridge, scan)
    assert capfd.readouterr() == ("", "")


def test_view_without_vtk(
    ridge: rf.Ridge, scan: rf.Scan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "vtkmodules.vtkRenderingOpenGL2", None)
    _shows_ridge(tmp_path / "v.png", ridge, scan)


@pytest.mark.parametrize("turns", range(0, 8, 2))
def test_labels_of_a_ring_lie_inside_their_picture(turns: int, tmp_path: Path) -> None:
    """Wherever on the ring arc length begins."""
    angle = np.linspace(0, 2 * np.pi, 81) + turns * np.pi / 4
    out = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(81)])
    out[-1] = out[0]
    tangent = np.cross([0.0, 0, 1], out)
    even = np.ones(81)
    ring = rf.Ridge(
        arc_length=np.linspace(0, 60 * np.pi, 81),
        spine=30 * out,
        tangent=tangent,
        normal=np.tile([0.0, 0, 1], (81, 1)),
        height=2 * even,
        width=8 * even,
        height_std=0.1 * even,
        width_std=0.1 * even,
        border=6 * even,
        section=plateau(),
        templates=(),
        stop=("closed", "closed"),
        closed=True,
        pick=30 * out[0],
    )
    template = rf.Template(
        30 * out[0], np.column_stack([tangent[0], -out[0], [0, 0, 1]]), 8, 2, 6, 2, plateau()
    )
    ring = replace(ring, templates=(template,))
    figure = plot.view(
        np.random.default_rng(0).uniform(-40, 40, (2000, 3)) * [1, 1, 0], ring, tmp_path / "v.png"
    )
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    panels = [axes for axes in figure.axes if axes.get_title(loc="left")]
    for axes in panels:
        room = axes.get_window_extent()
        (words,) = (text for text in axes.texts if text.get_text().startswith("closed"))
        box = words.get_window_extent(renderer)
        assert room.x0 < box.x0 < box.x1 < room.x1 and room.y0 < box.y0 < box.y1 < room.y1


def test_view_of_few_metres_and_many_points(
    ridge: rf.Ridge, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scene, "MOST", 5000)
    built = scene.build(ridge, SPIRAL.points(20_000, 0.1, seed=4))
    assert len(built.points) == 5000
    near = built.points[built.on_ridge]
    expected = SPIRAL.elevation(near[:, :2])
    assert np.abs(built.heights[built.on_ridge] - expected).mean() < 0.3


def test_a_flattened_ridge_and_no_points_near_it(ridge: rf.Ridge, tmp_path: Path) -> None:
    flat = ridge.resized(h=0)
    figure = plot.profile(flat, tmp_path / "p.png")
    low, high = figure.axes[0].get_ylim()
    assert low == 0 < high
    plot.view(SPIRAL.points(500, seed=1) + 1e4, flat, tmp_path / "v.png")
    assert pixels(tmp_path / "v.png")[100:800, 900:1600].std() > 0.02


def test_far_points_are_left_out(ridge: rf.Ridge) -> None:
    points = np.concatenate([SPIRAL.points(2000, seed=4), np.full((50, 3), 1e4)])
    assert len(scene.build(ridge, points).points) == 2000


@pytest.mark.parametrize("draw", ["profile", "view", "deviation"])
def test_a_folder_that_is_not_there(draw: str, ridge: rf.Ridge, scan: rf.Scan, tmp_path: Path) -> None:
    target = tmp_path / "no" / "x.png"
    with pytest.raises(OSError, match="no"):
        plot.profile(ridge, target) if draw == "profile" else getattr(plot, draw)(scan, ridge, target)
    assert list(tmp_path.iterdir()) == []


def test_nothing_half_written_when_drawing_fails(
    ridge: rf.Ridge, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib.figure import Figure

    def interrupted(self: Figure, file: Any, **_: Any) -> None:
        file.write(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(Figure, "savefig", interrupted)
    with pytest.raises(KeyboardInterrupt):
        plot.profile(ridge, tmp_path / "x.png")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("value", "text"),
    [(169.2463, "169.2"), (13366.45, "13,366"), (0.0538391, "0.05384"), (0.0, "0"), (-25.5, "-25.5")],
)
def test_numbers_are_readable(value: float, text: str) -> None:
    assert number(value) == text
