"""Where to trust a ridge: a map of the points' distances from its surface, and what they say along it."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ridgefeature.curvilinear import thinned
from ridgefeature.diagnosis import Diagnosis, TemplateFit, diagnose
from ridgefeature.plot.files import new_figure, save
from ridgefeature.readable import rows
from ridgefeature.ridge import Ridge
from ridgefeature.scan import Scan

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SIZE = (1700, 1000)
_MOST = 60_000
_LIMIT = 4.0
"""Deviations in noise levels beyond which colours do not change any more."""
_FEW = 3_000
"""Points below which each is drawn with a rim."""
_STRAY, _DOUBT, _UNSEEN, _LINE = "#111827", "#fde68a", "#e5e7eb", "#334155"
_STATUS = {"converged": "#15803d", "interpolated": "#ca8a04"}
_OTHER = "#b91c1c"
_SEEN = "#0f766e"
_NUMBERED = 40
"""Templates up to which each has its number of evaluations beside it."""
_LETTERS, _LINES = 50, 28
"""Letters in a line of the text beside the panels, and lines."""


def deviation(
    scan: Scan | ArrayLike,
    ridge: Ridge,
    path: str | os.PathLike[str],
    diagnosis: Diagnosis | None = None,
) -> Figure:
    """Draw how the scan lies about the ridge's surface: unrolled, along the ridge, and in figures.

    scan: a Scan or (n, 3) points, in the ridge's frame and unit. diagnosis: of this ridge and scan, if it is
    there already. Stretches in doubt are shaded. Writes a PNG of 1700 x 1000 pixels and returns the figure.
    Raises OSError if the file cannot be written.
    """
    found = diagnose(ridge, scan) if diagnosis is None else diagnosis
    figure = new_figure(*_SIZE)
    grid = figure.add_gridspec(
        4, 1, height_ratios=[2.4, 1, 1, 1], hspace=0.12, left=0.075, right=0.7, top=0.9, bottom=0.065
    )
    panels = [figure.add_subplot(grid[0])]
    panels += [figure.add_subplot(grid[i], sharex=panels[0]) for i in (1, 2, 3)]
    _map(figure, panels[0], ridge, found)
    _distances(panels[1], ridge, found)
    _shares(panels[2], found)
    _templates(panels[3], found)
    for axes in panels:
        for low, high, _ in found.doubts:
            axes.axvspan(low, high, color=_DOUBT, alpha=0.5, lw=0, zorder=0)
        axes.set_xlim(0, ridge.length)
        axes.tick_params(labelbottom=axes is panels[-1])
    panels[-1].set_xlabel(f"arc length s [{ridge.unit}]")
    _figures(figure, ridge, found)
    name = "" if ridge.source is None else f" in {ridge.source.name}"
    figure.suptitle(f"Where to trust the ridge{name}", x=0.075, ha="left", weight="bold", fontsize=14)
    save(figure, path)
    return figure


def _map(figure: Figure, axes: Any, ridge: Ridge, found: Diagnosis) -> None:
    """Signed deviations over arc length and distance from the spine."""
    noise = found.noise if np.isfinite(found.noise) and found.noise > 0 else 1.0
    kept = thinned(np.flatnonzero(~found.stray), _MOST)
    dots = axes.scatter(
        found.arc_length[kept],
        found.across[kept],
        c=found.deviation[kept],
        cmap="coolwarm",
        vmin=-_LIMIT * noise,
        vmax=_LIMIT * noise,
        s=float(np.clip(60_000 / max(len(kept), 1), 2, 40)),
        lw=0.5 if len(kept) < _FEW else 0,
        ec=_LINE,
        rasterized=True,
    )
    _unseen(axes, ridge, found)
    stray = np.flatnonzero(found.stray)
    label = f"strays ({100 * found.outliers:.1f} %)" if len(stray) else "strays: none"
    axes.plot(
        found.arc_length[stray],
        found.across[stray],
        ".",
        ms=6 if len(kept) < _FEW else 2.5,
        color=_STRAY,
        mew=0,
        label=label,
    )
    for side in (-0.5, 0.5):
        axes.plot(
            ridge.arc_length, side * ridge.width, color=_LINE, lw=1.2, label="feet" if side > 0 else None
        )
    axes.plot([], [], color=_DOUBT, lw=8, label="in doubt")
    reach = 1.02 * float(ridge.border.max())
    axes.set(ylim=(-reach, reach), ylabel=f"across, left is up [{ridge.unit}]")
    axes.set_title(
        "The surface unrolled: points above it red, below it blue; grey: no points between the feet",
        loc="left",
        fontsize=11,
    )
    axes.legend(
        loc="lower right",
        fontsize=9,
        framealpha=0.9,
        ncols=3,
        bbox_to_anchor=(1.0, 1.0),
        markerscale=1.5 if len(kept) < _FEW else 4,
    )
    bar = figure.colorbar(dots, cax=figure.add_axes((0.735, 0.53, 0.012, 0.37)))
    bar.set_label(f"distance of points to the surface [{ridge.unit}]")


def _unseen(axes: Any, ridge: Ridge, found: Diagnosis) -> None:
    """Shade the surface between the feet where no scan points are near it."""
    from matplotlib.colors import ListedColormap

    n, m = found.seen.shape
    s = np.linspace(0.0, ridge.length, n + 1)
    feet = np.linspace(-0.5, 0.5, m + 1) * np.interp(s, ridge.arc_length, ridge.width)[:, None]
    grey = np.ma.masked_where(found.seen, np.ones((n, m)))
    along = np.broadcast_to(s[:, None], feet.shape)
    axes.pcolormesh(along, feet, grey, cmap=ListedColormap([_UNSEEN]), zorder=0, rasterized=True)


def _distances(axes: Any, ridge: Ridge, found: Diagnosis) -> None:
    """How far points lie off, between the feet, against the noise."""
    axes.stairs(
        found.stretch_rms,
        found.stretches,
        color=_LINE,
        lw=1.8,
        label="all points between the feet",
        baseline=None,
    )
    axes.axhline(found.noise, color=_LINE, ls="--", lw=1, label="noise level")
    _by_status(axes, found, lambda t: t.deviation_rms, "no strays, along one template")
    values = [*found.stretch_rms, *(t.deviation_rms for t in found.templates), found.noise]
    highest = max((v for v in values if np.isfinite(v)), default=0.0)
    if highest > 0:
        axes.set_ylim(0, 1.35 * (min(highest, 8 * found.noise) if found.noise > 0 else highest))
    axes.set_ylabel(f"rms deviation\n[{ridge.unit}]")
    _finish(axes)


def _shares(axes: Any, found: Diagnosis) -> None:
    """What part of the surface was seen, and what part of the points are strays or inliers."""
    axes.stairs(
        found.stretch_coverage, found.stretches, color=_SEEN, lw=1.8, label="surface seen", baseline=None
    )
    axes.stairs(found.stretch_outliers, found.stretches, color=_OTHER, lw=1.8, label="strays", baseline=None)
    _by_status(axes, found, lambda t: t.inliers / t.points if t.points else np.nan, "inliers of one template")
    axes.set(ylim=(-0.04, 1.45), yticks=[0, 0.5, 1], ylabel="share between\nthe feet")
    _finish(axes)


def _templates(axes: Any, found: Diagnosis) -> None:
    """M of each template by its floor, with the evaluations that its fit took."""
    axes.axhline(1, color=_LINE, ls="--", lw=1, label="a perfect patch; numbers: evaluations of the fit")
    ratio = [t.M / t.M_floor if t.M_floor > 0 else np.nan for t in found.templates]
    for status in sorted({t.status for t in found.templates}):
        _by_status(axes, found, lambda t: t.M / t.M_floor if t.M_floor > 0 else np.nan, status, status)
    if len(found.templates) <= _NUMBERED:
        for template, value in zip(found.templates, ratio, strict=True):
            if np.isfinite(value):
                axes.annotate(
                    f"{template.evaluations}",
                    (template.arc_length, value),
                    xytext=(0, 6),
                    textcoords="offset points",
                    ha="center",
                    fontsize=8,
                )
    highest = max((v for v in ratio if np.isfinite(v)), default=1.0)
    axes.set(ylim=(0, 1.6 * max(highest, 1.0)), ylabel="M of a template\nby its floor")
    _finish(axes)


def _by_status(
    axes: Any,
    found: Diagnosis,
    value: Callable[[TemplateFit], float],
    label: str,
    status: str | None = None,
) -> None:
    """A dot for each template (of one status), in the colour of its status."""
    those = [t for t in found.templates if status in (None, t.status)]
    colours = [_STATUS.get(t.status, _OTHER) for t in those]
    axes.scatter(
        [t.arc_length for t in those], [value(t) for t in those], s=26, c=colours, zorder=3, label=label
    )


def _finish(axes: Any) -> None:
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="upper left", fontsize=9, framealpha=0.9, ncols=4)


def _figures(figure: Figure, ridge: Ridge, found: Diagnosis) -> None:
    """The diagnosis in words and figures, beside the panels."""
    lines = []
    for name, value in rows(ridge, found):
        lines += [name.upper(), *textwrap.wrap(value, _LETTERS, initial_indent="  ", subsequent_indent="  ")]
    shown = lines if len(lines) <= _LINES else [*lines[: _LINES - 1], "  ... more in the summary"]
    figure.text(0.735, 0.46, "\n".join(shown), va="top", fontsize=9.5, family="monospace", linespacing=1.3)
