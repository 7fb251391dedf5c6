"""A picture of a case: its points by height over the base, the true spine, the found one, and the click."""

from __future__ import annotations

from pathlib import Path as File

import numpy as np

import ridgefeature as rf
from reference.make import Case


def picture(case: Case, ridge: rf.Ridge | None, title: str, file: File) -> None:
    """The case in its base's chart, as a PNG."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    truth = case.truth
    chart, pose = truth.base.chart, truth.pose
    points = pose.back(case.points)
    at = chart(points)
    foot = truth.base.place(at)
    height = ((points - foot) * truth.base.normal(foot)).sum(axis=1)
    limit = abs(truth.heights.size) * (1 + truth.heights.swing)
    figure, axes = plt.subplots(figsize=(9, 7))
    shown = axes.scatter(*at.T, c=height, s=2, cmap="coolwarm", vmin=-limit, vmax=limit, linewidths=0)
    figure.colorbar(shown, label="height over the base / w")
    axes.plot(
        *chart(pose.back(truth.spine(np.linspace(0, truth.length, 500)))).T, "k--", lw=1, label="true spine"
    )
    if ridge is not None:
        axes.plot(*chart(pose.back(ridge.spine)).T, "g-", lw=2, label="found")
        for template in ridge.templates:
            axes.plot(*chart(pose.back(template.position[None])).T, "g.", ms=5)
    axes.plot(*chart(pose.back(case.click[None])).T, "y*", ms=14, mec="k", label="click")
    axes.set_title(f"{title}\n{', '.join(case.kinds.values())}", fontsize=8)
    axes.set_aspect("equal")
    axes.legend(fontsize=7)
    figure.savefig(file, dpi=80)
    plt.close(figure)
