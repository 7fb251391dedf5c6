"""Where a finished surface folds over itself: where its path bends more sharply than its flanks are broad."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ridgefeature.bspline import Surface
    from ridgefeature.ridge import Ridge

WHY = "the surface folds over itself"
_FINE, _PLACES, _ACROSS = 40, (400, 8000), 61
"""Places looked at in a width along the ridge, least and most of them in all; places across."""
_BACK = -0.05
"""Length that a flank goes along the path for each one of the spine, below which it goes back: less comes of
the directions between stations."""

Doubts = tuple[tuple[float, float, str], ...]


def folds(ridge: Ridge, surface: Surface | None = None) -> tuple[tuple[float, float], ...]:
    """From which arc length to which the surface goes back along the path, somewhere across.

    Cross-sections meet there, which steep flanks do not make them do. surface: the ridge's own at any rates.
    """
    surface = surface or ridge.surface()
    count = int(np.clip(_FINE * ridge.length / float(np.median(ridge.width)), *_PLACES))
    (first, last), sides = surface.domain
    edges = np.linspace(first, last, count + 1)
    u = 0.5 * (edges[1:] + edges[:-1])
    ahead = np.stack([np.interp(u, ridge.arc_length, x) for x in ridge.tangent.T], axis=1)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    steps = surface.on_grid(u, np.linspace(*sides, _ACROSS), (1, 0))
    back = (np.einsum("ijk,ik->ij", steps, ahead) < _BACK).any(axis=1)
    return _runs(back, edges)


def with_folds(doubts: Doubts, ridge: Ridge) -> Doubts:
    """Doubts and the stretches that fold, in order; of those that begin alike the longest first."""
    found = [*doubts, *((low, high, WHY) for low, high in folds(ridge))]
    return tuple(sorted(found, key=lambda doubt: (doubt[0], -doubt[1])))


def told_folds(ridge: Ridge, surface: Surface) -> str:
    """What to say of the surface's folds; empty where it has none."""
    found = folds(ridge, surface)
    if not found:
        return ""
    from ridgefeature.readable import number  # brings compiled code, which most exports do without

    where = ", ".join(f"{number(low, 3)} to {number(high, 3)}" for low, high in found)
    return (
        f"{WHY} at arc length {where} {ridge.unit}, where the path bends more sharply than the flanks are "
        "broad. A CAD program may call it valid all the same: see if that matters, or cut the ridge there"
    )


def _runs(rows: NDArray[np.bool_], edges: NDArray[np.float64]) -> tuple[tuple[float, float], ...]:
    """From where to where rows are true; those nearer than a tenth of a width are one."""
    runs: list[tuple[int, int]] = []
    for i in np.flatnonzero(rows).tolist():
        if runs and i - runs[-1][1] <= _FINE // 10:
            runs[-1] = runs[-1][0], i + 1
        else:
            runs.append((i, i + 1))
    return tuple((float(edges[a]), float(edges[b])) for a, b in runs)
