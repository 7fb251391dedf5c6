"""Height and width over arc length, and the section with the scan on it."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ridgefeature.curvilinear import local_coordinates, over_base, templates_on, thinned
from ridgefeature.plot.files import new_figure, save
from ridgefeature.ridge import Ridge
from ridgefeature.scan import Scan, as_scan

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

HEIGHT, WIDTH, FEET, POINTS = "#c2410c", "#1d4ed8", "#7c9bd6", "#475569"
_MOST = 12_000
_FLATTENED = 1.6
"""How many times higher than the curve its picture may be."""


def profile(
    ridge: Ridge,
    path: str | os.PathLike[str],
    scan: Scan | ArrayLike | None = None,
    registered: Ridge | None = None,
) -> Figure:
    """Draw h(s) and both widths with bands of one standard deviation, and each template's own values.

    registered: what the ridge was before it was changed; templates and section are of that, and its curves
    are dashed.

    Templates are drawn where they are part of the finished ridge, with their widths at half height: the march
    may have had another section, whose feet lie elsewhere. With the scan also the section: the scan points of
    the whole ridge, divided by the local width and height. Lengths in the ridge's unit. Writes a PNG of
    1200 x 800 (1700 x 800 with the scan) pixels and returns the figure. Raises OSError if the file cannot be
    written.
    """
    figure = new_figure(1200 if scan is None else 1700, 800)
    grid = figure.add_gridspec(
        2,
        1 if scan is None else 2,
        width_ratios=[1] if scan is None else [2.1, 1],
        hspace=0.12,
        wspace=0.18,
        left=0.075 if scan is None else 0.055,
        right=0.975,
        top=0.9,
        bottom=0.085,
    )
    above = figure.add_subplot(grid[0, 0])
    below = figure.add_subplot(grid[1, 0], sharex=above)
    first = ridge if registered is None else registered
    _height(above, ridge, first)
    _width(below, ridge, first)
    above.tick_params(labelbottom=False)
    below.set_xlabel(f"arc length s [{ridge.unit}]")
    below.set_xlim(0, ridge.length)
    if scan is not None:
        _section(figure.add_subplot(grid[:, 1]), first, as_scan(scan, ridge.unit).points)
    figure.suptitle(f"Height and width along the ridge{_origin(ridge)}", x=0.055, ha="left", weight="bold")
    save(figure, path)
    return figure


def _height(axes: Any, ridge: Ridge, first: Ridge) -> None:
    name = "height h" if np.median(ridge.height) >= 0 else "height h (below 0: a groove)"
    _band(axes, ridge, ridge.height, ridge.height_std, HEIGHT, "h(s) of the ridge")
    if first is not ridge:
        _before(axes, first, first.height, HEIGHT)
    shown = _templates(axes, first, 6, HEIGHT)
    axes.set_ylabel(f"{name} [{ridge.unit}]")
    _finish(axes, ridge.height, [*shown, *_band_of(ridge.height, ridge.height_std)])


def _width(axes: Any, ridge: Ridge, first: Ridge) -> None:
    half, half_std = ridge.half_height_width, ridge.half_height_width_std
    _band(axes, ridge, ridge.width, ridge.width_std, FEET, "w(s) between the feet")
    _band(axes, ridge, half, half_std, WIDTH, "width at half height")
    if first is not ridge:
        _before(axes, first, first.half_height_width, WIDTH)
    shown = _templates(axes, first, 7, WIDTH)
    axes.set_ylabel(f"width [{ridge.unit}]")
    _finish(axes, ridge.width, [*shown, *_band_of(ridge.width, ridge.width_std)])


def _band_of(values: Array, std: Array) -> list[float]:
    spread = np.where(np.isfinite(std), std, 0.0)
    return [*(values - spread), *(values + spread)]


def _band(axes: Any, ridge: Ridge, values: Array, std: Array, colour: str, label: str) -> None:
    # A template that was never fitted has no deviation: the band is left open there.
    spread = np.where(np.isfinite(std), std, np.nan)
    axes.fill_between(
        ridge.arc_length,
        values - spread,
        values + spread,
        color=colour,
        alpha=0.25,
        lw=0,
    )
    axes.plot(ridge.arc_length, values, color=colour, lw=2, label=f"{label}, ± one standard deviation")


def _before(axes: Any, first: Ridge, values: Array, colour: str) -> None:
    axes.plot(first.arc_length, values, color=colour, lw=1.2, ls="--", label="as registered")


def _templates(axes: Any, ridge: Ridge, column: int, colour: str) -> list[float]:
    """Heights (column 6 of their standard deviations) or widths at half height (7) of single templates.

    Returns the values drawn.
    """
    templates, places = templates_on(ridge)
    heights = column == 6
    rates = [1.0 if heights else t.section.half_height_width for t in templates]
    values = [rate * (t.height if heights else t.width) for rate, t in zip(rates, templates, strict=True)]
    bars = [
        np.nan if t.std is None else rate * t.std[column] for rate, t in zip(rates, templates, strict=True)
    ]
    axes.errorbar(
        places,
        values,
        yerr=np.where(np.isfinite(bars), bars, np.nan),
        fmt="o",
        ms=4.5,
        mfc="white",
        mec=colour,
        ecolor=colour,
        elinewidth=1.2,
        capsize=2.5,
        label="single templates, as the march fitted them",
    )
    return values


def _finish(axes: Any, values: Array, beside: list[float]) -> None:
    """Zero in sight, and what is beside the curve; but no runaway band or template may flatten it."""
    low, high = min(0.0, values.min()), max(0.0, values.max())
    low = max(min(low, *beside), _FLATTENED * low)
    high = min(max(high, *beside), _FLATTENED * high)
    room = 0.12 * (high - low) or 1.0
    high = high or (room if low == 0 else 0.0)
    axes.set_ylim(low - (room if low < 0 else 0.0), high + (room if high > 0 else 0.0))
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="best", framealpha=0.9, fontsize=9, ncols=2)


def _section(axes: Any, ridge: Ridge, points: Array) -> None:
    """Height over h against distance over w, for the scan points that lie on the ridge's surface."""
    low = ridge.spine.min(axis=0) - ridge.border.max()
    high = ridge.spine.max(axis=0) + ridge.border.max()
    room = np.abs(ridge.height).max() * np.abs(ridge.normal).max(axis=0)
    inside = ((points >= low - room) & (points <= high + room)).all(axis=1)
    s, y, z = local_coordinates(ridge, thinned(points[inside], 20 * _MOST))
    width, height, border = (
        np.interp(s, ridge.arc_length, a) for a in (ridge.width, ridge.height, ridge.border)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        eta, zeta = y / width, over_base(ridge, s, y, z) / height
    on = (s >= 0) & (s <= ridge.length) & (np.abs(y) <= border) & (np.abs(zeta) < 3)
    seen = thinned(np.column_stack([eta[on], zeta[on]]), _MOST)
    size = float(np.clip(90.0 / np.sqrt(max(len(seen), 1)), 2.0, 6.0))
    axes.plot(
        *seen.T,
        ".",
        ms=size,
        color=POINTS,
        alpha=0.35 if size < 3.0 else 0.7,
        mew=0,
        label=f"{len(seen):,} scan points",
        rasterized=True,
    )
    reach = min(float((ridge.border / ridge.width).max()), 1.2)
    y = np.linspace(-reach, reach, 401)
    axes.plot(y, ridge.section(y), color="black", lw=4)
    axes.plot(y, ridge.section(y), color="#f59e0b", lw=2, label=f"section: {ridge.section.name}")
    axes.axvspan(-0.5, 0.5, color=WIDTH, alpha=0.05, lw=0)
    axes.set(
        xlim=(-reach, reach),
        ylim=(-0.6, 1.7),
        xlabel="across, y / w   (feet at ± 0.5)",
        ylabel="height over the base, z / h",
    )
    axes.set_title("The whole scan on one section", fontsize=11)
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="upper right", framealpha=0.9, fontsize=9, markerscale=10.0 / size)


def _origin(ridge: Ridge) -> str:
    return "" if ridge.source is None else f" in {ridge.source.name}"
