"""The view: scan, templates, crest and finished surface, from above and obliquely."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ridgefeature.curvilinear import templates_on
from ridgefeature.plot import camera as cameras
from ridgefeature.plot.camera import Camera
from ridgefeature.plot.files import new_figure, save
from ridgefeature.plot.scene import SPINE, SURFACE, TEMPLATE, Pixels, Scene, build, render, surface_colours
from ridgefeature.readable import number, round_below
from ridgefeature.ridge import Ridge
from ridgefeature.scan import Scan, as_scan

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_COLOURS = "viridis"
_PICK = "#e11d48"
_SIZE = (1700, 1000)
_ROOM = 6
"""Pixels between a text and the side of its picture."""


def view(scan: Scan | ArrayLike, ridge: Ridge, path: str | os.PathLike[str]) -> Figure:
    """Draw the scan with what was registered in it: from above the templates, obliquely the surface.

    scan: a Scan or (n, 3) points, in the ridge's frame and unit; at most 200,000 points near the ridge are
    drawn. Writes a PNG of 1700 x 1000 pixels and returns the figure. VTK draws it where it is installed,
    else matplotlib. Raises OSError if the file cannot be written.
    """
    scene = build(ridge, as_scan(scan, ridge.unit).points)
    figure = new_figure(*_SIZE)
    norm = _norm(ridge)
    for place, title, look, solid in _panels(ridge):
        axes = figure.add_axes(place)
        aspect = place[2] * _SIZE[0] / (place[3] * _SIZE[1])
        eye = look(ridge, scene.surface, aspect)
        _draw(axes, scene, eye, norm, solid)
        _mark(axes, ridge, scene.crest, eye)
        _scale_bar(axes, eye, ridge.unit)
        _triad(axes, eye, aspect)
        axes.set_title(title, loc="left", fontsize=12)
    _legend(figure, norm, ridge)
    name = "" if ridge.source is None else f" in {ridge.source.name}"
    figure.suptitle(
        f"Ridge registered{name}: {_figures(ridge)}", x=0.02, ha="left", weight="bold", fontsize=14
    )
    save(figure, path)
    return figure


def _panels(ridge: Ridge) -> list[tuple[tuple[float, float, float, float], str, Callable[..., Camera], bool]]:
    above, beside = (
        "From above: the scan, and a template for each step",
        "The same, with the ridge's surface on it",
    )
    if cameras.is_long(ridge):
        places = (0.02, 0.545, 0.96, 0.36), (0.02, 0.125, 0.96, 0.36)
    else:
        places = (0.02, 0.125, 0.475, 0.78), (0.505, 0.125, 0.475, 0.78)
    return [
        (places[0], above, cameras.from_above, False),
        (places[1], beside, cameras.oblique, True),
    ]


def _norm(ridge: Ridge) -> Any:
    from matplotlib.colors import Normalize

    low, high = min(0.0, ridge.height.min()), max(0.0, ridge.height.max())
    room = 0.15 * (high - low) or 0.1 * ridge.width.max()
    return Normalize(low - room, high + room, clip=True)


def _draw(axes: Any, scene: Scene, eye: Camera, norm: Any, solid: bool) -> None:
    """The panel's picture, in coordinates of the camera."""
    from matplotlib import colormaps

    colours: Pixels = colormaps[_COLOURS](norm(scene.heights), bytes=True)[:, :3].copy()
    # Paler away from the ridge, so that the eye finds it.
    colours[~scene.on_ridge] = (0.55 * colours[~scene.on_ridge] + 0.45 * 235).astype(np.uint8)
    box = axes.get_window_extent()
    try:
        pixels = render(scene, eye, colours, (round(box.width), round(box.height)), solid)
    except ImportError:
        _draw_flat(axes, scene, eye, colours, solid)
    else:
        axes.imshow(
            pixels,
            extent=(-eye.half_width, eye.half_width, -eye.half_height, eye.half_height),
            aspect="auto",
            interpolation="nearest",
        )
    axes.set(
        xlim=(-eye.half_width, eye.half_width), ylim=(-eye.half_height, eye.half_height), xticks=[], yticks=[]
    )


def _draw_flat(axes: Any, scene: Scene, eye: Camera, colours: Pixels, solid: bool) -> None:
    """The same without VTK: everything from back to front, which hides what lies behind."""
    from matplotlib.collections import LineCollection, PolyCollection

    depth = scene.points @ eye.toward
    order = np.argsort(depth)
    axes.scatter(
        *eye.project(scene.points)[order].T, s=2, c=colours[order] / 255, lw=0, rasterized=True, zorder=1
    )
    if solid:
        grid = eye.project(scene.surface)
        quads = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2).reshape(
            -1, 4, 2
        )
        middle = scene.surface[:-1, :-1].reshape(-1, 3)
        shade = np.abs(scene.normals[:-1, :-1].reshape(-1, 3) @ (eye.toward - 0.5 * eye.right + 0.3 * eye.up))
        tint = np.broadcast_to(surface_colours(scene)[:-1], (*grid[:-1, :-1].shape[:2], 3)).reshape(-1, 3)
        paint = np.clip(0.35 + 0.6 * shade, 0, 1)[:, None] * tint
        back = np.argsort(middle @ eye.toward)
        axes.add_collection(
            PolyCollection(list(quads[back]), facecolors=paint[back], edgecolors="face", lw=0.3, zorder=2)
        )
    axes.add_collection(
        LineCollection([eye.project(x) for x in scene.outlines], colors=TEMPLATE, lw=1.2, zorder=3)
    )
    axes.plot(*eye.project(scene.crest).T, color=SPINE, lw=3, zorder=4)


def _mark(axes: Any, ridge: Ridge, crest: Array, eye: Camera) -> None:
    """Start, end and pick; of a ring the place where arc length begins."""
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=3, foreground="white")]
    top = eye.project(crest)
    total = f"s = {number(ridge.length)} {ridge.unit}"
    marks = [(0, 1, "start, s = 0", "white"), (-1, -2, f"end, {total}", SPINE)]
    if ridge.closed:
        marks = [(0, 1, f"closed, s = 0 and {total}", "white")]
    for end, inner, label, face in marks:
        axes.plot(*top[end], "o", ms=9, mfc=face, mec=SPINE, mew=2, zorder=6)
        out = top[end] - top[inner]
        out = out / max(np.linalg.norm(out), 1e-300)
        # Off the end of the ridge, unless the text would leave the picture there.
        right = out[0] >= 0 if abs(top[end][0]) < 0.7 * eye.half_width else top[end][0] < 0
        up = out[1] >= 0 if abs(top[end][1]) < 0.85 * eye.half_height else top[end][1] < 0
        words = axes.annotate(
            label,
            top[end],
            xytext=(12 if right else -12, 12 if up else -12),
            textcoords="offset points",
            ha="left" if right else "right",
            va="bottom" if up else "top",
            fontsize=11,
            weight="bold",
            path_effects=halo,
            zorder=9,
        )
        _keep_inside(axes, words)
    axes.plot(*eye.project(ridge.pick), "*", ms=17, mfc=_PICK, mec="white", mew=1.2, zorder=8)


def _keep_inside(axes: Any, words: Any) -> None:
    """Move an annotation whose text would be cut off at a side of the picture."""
    box, room = words.get_window_extent(axes.figure.canvas.get_renderer()), axes.get_window_extent()
    x, y = words.xyann
    points = 72 / axes.figure.dpi
    x += points * (max(room.x0 + _ROOM - box.x0, 0.0) + min(room.x1 - _ROOM - box.x1, 0.0))
    y += points * (max(room.y0 + _ROOM - box.y0, 0.0) + min(room.y1 - _ROOM - box.y1, 0.0))
    words.xyann = x, y


def _scale_bar(axes: Any, eye: Camera, unit: str) -> None:
    length = round_below(0.3 * eye.half_width)
    right, low = 0.97 * eye.half_width, -0.93 * eye.half_height
    box = {"boxstyle": "round,pad=0.25", "fc": "white", "ec": "none", "alpha": 0.85}
    axes.text(
        right - 0.5 * length,
        low + 0.03 * eye.half_height,
        f"{number(length)} {unit}",
        ha="center",
        va="bottom",
        fontsize=11,
        bbox=box,
        zorder=6,
    )
    axes.plot([right - length, right], [low, low], color="white", lw=8, solid_capstyle="butt", zorder=5)
    axes.plot([right - length, right], [low, low], color="black", lw=4, solid_capstyle="butt", zorder=7)


def _triad(axes: Any, eye: Camera, aspect: float) -> None:
    """The directions of the scan's x, y and z, in the lower left corner."""
    from matplotlib.patches import Rectangle

    size = 0.13 * eye.half_height * (1.0 if aspect > 2 else 0.6)
    corner = np.array([-eye.half_width + 1.9 * size, -eye.half_height + 1.9 * size])
    low = corner - 1.7 * size
    axes.add_patch(
        Rectangle((low[0], low[1]), 3.4 * size, 3.4 * size, fc="white", ec="none", alpha=0.8, zorder=5)
    )
    tips = sorted(
        zip(np.column_stack([eye.right, eye.up]), "xyz", strict=True), key=lambda t: -np.linalg.norm(t[0])
    )
    drawn: list[Array] = []
    for tip, name in tips:
        way = tip / max(np.linalg.norm(tip), 1e-300)
        # An axis that points at the eye, or lies on a longer one, would only be a blot.
        if np.linalg.norm(tip) < 0.2 or any(way @ other > 0.97 for other in drawn):
            continue
        drawn.append(way)
        style = {"arrowstyle": "-|>", "lw": 1.5, "color": "black", "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", corner + size * tip, xytext=corner, arrowprops=style, zorder=7)
        label = corner + size * (tip + 0.38 * tip / np.linalg.norm(tip))
        axes.text(*label, name, ha="center", va="center", fontsize=10, zorder=7)


def _legend(figure: Figure, norm: Any, ridge: Ridge) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from matplotlib.ticker import MaxNLocator

    marks = [
        Line2D([], [], marker="o", ls="", ms=6, color="#21918c", label="scan"),
        Line2D([], [], color=TEMPLATE, lw=1.6, label="templates"),
        Patch(color=SURFACE, label="ridge surface"),
        Line2D([], [], color=SPINE, lw=3.5, label="crest"),
        Line2D([], [], marker="*", ls="", ms=15, mfc=_PICK, mec="white", label="pick"),
    ]
    figure.legend(
        handles=marks, loc="lower left", bbox_to_anchor=(0.012, 0.015), ncols=5, frameon=False, fontsize=12
    )
    bar = figure.colorbar(
        ScalarMappable(norm, _COLOURS),
        cax=figure.add_axes((0.66, 0.058, 0.3, 0.02)),
        orientation="horizontal",
    )
    bar.locator = MaxNLocator(6)
    bar.update_ticks()
    bar.set_label(f"height of the scan over the ridge's base [{ridge.unit}]", fontsize=11)


def _figures(ridge: Ridge) -> str:
    def span(values: Array) -> str:
        low, high = number(values.min(), 3), number(values.max(), 3)
        return f"{low if low == high else f'{low} to {high}'} {ridge.unit}"

    fitted, on = len(ridge.templates), len(templates_on(ridge)[0])
    count = f"{on} of {fitted}" if on < fitted else f"{fitted}"
    return (
        f"{number(ridge.length)} {ridge.unit} long, {span(ridge.height)} high, {span(ridge.width)} wide, "
        f"{count} template{'s' if fitted != 1 else ''}"
    )
