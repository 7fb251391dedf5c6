"""Rings: a march that comes back to where it began, and whether the ridge is there all the way round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.continuation import FLAT
from ridgefeature.ends import trends
from ridgefeature.improve import improve, loss_of
from ridgefeature.kernels import appraise
from ridgefeature.march import Track
from ridgefeature.medians import median
from ridgefeature.neighbours import FEWEST, HOME, TYPICAL, advances, alike, between
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]
Places = NDArray[np.intp]

CLOSED = "closed"
"""What a ring says in place of why its ends stopped."""
_WIDE = 1.25
"""Distance of the last template from the first, in their mean lengths, above which one more goes between."""
_BINS_PER_WIDTH = 10.0
_SHORTEST_GAP = 0.5
"""Length of the shortest gap that opens a ring, in widths."""
_BEYOND_DOUBT = 10.0
"""Log likelihood ratio of base against ridge that a ridge does not reach by chance."""


def ring_or_not(window: Window, track: Track, settings: Settings) -> Track:
    """The track as a ring where its march came home; open again where the ridge has a gap."""
    if not track.closed:
        return track
    templates = closed_chain(window, list(track.templates), settings.marching())
    chain = opened(window, templates, settings)
    if chain is None:
        return replace(track, templates=tuple(templates), stop=(CLOSED, CLOSED))
    return replace(track, templates=tuple(chain), stop=(FLAT, FLAT), closed=False)


def closed_chain(window: Window, chain: list[Template], settings: Settings) -> list[Template]:
    """The chain as a ring: what overlaps or is odd at the seam dropped, what lacks there fitted."""
    templates = _without_odd(_without_odd(chain)[::-1])[::-1]
    while len(templates) > FEWEST and not advances(templates[-1], templates[0]):
        del templates[-1]
    first, last = templates[0], templates[-1]
    apart = float(np.linalg.norm(first.position - last.position)) / (0.5 * (first.length + last.length))
    if apart < _WIDE:
        return templates
    count = max(round(apart) - 1, 1)
    for i in range(count):
        start = between(last, first, (i + 1) / (count + 1))
        fitted = improve(window, start, settings)
        if _fits(fitted, settings) and advances(templates[-1], fitted) and advances(fitted, first):
            templates.append(fitted)
    return templates


def _without_odd(templates: list[Template]) -> list[Template]:
    """The templates without first ones that are unlike those after them: there a march was lost."""
    for i in range(HOME):
        if len(templates) - i <= FEWEST:
            break
        if alike(templates[i], templates[i + 1 : i + 1 + TYPICAL]):
            return templates[i:]
    return templates


def _fits(template: Template, settings: Settings) -> bool:
    return template.status not in ("failed", "no data") and template.evidence >= settings.going_on


def opened(window: Window, ring: list[Template], settings: Settings) -> list[Template] | None:
    """The templates of a ring from behind its clearest gap to before it; None where there is no gap.

    A gap is a stretch of half a width or more where the points agree with the base beyond doubt, not one
    without points.
    """
    ring = trends(ring, closed=True)
    gain, owner, step = _base_over_ridge(window, ring, settings)
    low, high, most = _largest_run(gain)
    width = median([t.width for t in ring])
    if most < _BEYOND_DOUBT or (high - low) * step < _SHORTEST_GAP * width:
        return None
    inside = np.arange(low, high, dtype=np.intp) % len(gain)
    share = np.bincount(owner[inside], minlength=len(ring)) / np.bincount(owner, minlength=len(ring))
    kept = np.flatnonzero(share <= 0.5)
    if len(kept) == 0:
        return None
    start = int(owner[(low + high) // 2 % len(gain)])
    order = sorted((int(i) for i in kept), key=lambda i: (i - start) % len(ring))
    if order[0] == start and share[start] > 0 and _mostly_before(owner, inside, start):
        order = [*order[1:], order[0]]
    return _without_odd(_without_odd([ring[i] for i in order])[::-1])[::-1]


def _mostly_before(owner: Places, inside: Places, i: int) -> bool:
    """Whether the part of the i-th template's bins that lies before the gap is the larger one."""
    bins = np.flatnonzero(owner == i)
    gap = bins[np.isin(bins, inside)]
    return bool(np.sum(bins < gap[0]) > np.sum(bins > gap[-1]))


def _base_over_ridge(window: Window, ring: list[Template], settings: Settings) -> tuple[Array, Places, float]:
    """By how much the base explains the points better than the ridge does, (m,) round the ring in equal bins.

    Which template a bin belongs to (m,), and the bins' length.
    """
    n = len(ring)
    apart = [float(np.linalg.norm(ring[(i + 1) % n].position - t.position)) for i, t in enumerate(ring)]
    step = median([t.width for t in ring]) / _BINS_PER_WIDTH
    gains: list[Array] = []
    owners: list[Places] = []
    for i, template in enumerate(ring):
        low, high = 0.5 * apart[i - 1], 0.5 * apart[i]
        bins = max(round((low + high) / step), 1)
        gains.append(_gain(window, template, low, high, bins, settings))
        owners.append(np.full(bins, i, dtype=np.intp))
    owner: Places = np.concatenate(owners)
    return np.concatenate(gains), owner, step


def _gain(
    window: Window, template: Template, low: float, high: float, bins: int, settings: Settings
) -> Array:
    """(bins,) log likelihood ratio of base against ridge from `low` before to `high` after the centre."""
    half = 0.5 * template.length
    points = window(template, low / half, high / half)
    if not len(points):
        return np.zeros(bins)
    height, width, trend, table = template.shape
    trend = trend * np.array([1.0, 0.0, 0.0])
    # Errors of the model must not count as noise.
    scale = max(template.scale, 0.1 * abs(height))
    loss = loss_of(settings)
    ridge, base = (
        appraise.losses(appraise.residuals(points, h, width, trend, table) / scale, *loss)
        for h in (height, 0.0)
    )
    place = np.clip(((points[:, 0] + low) / (low + high) * bins).astype(np.intp), 0, bins - 1)
    return np.asarray(np.bincount(place, weights=ridge - base, minlength=bins), dtype=np.float64)


def _largest_run(gain: Array) -> tuple[int, int, float]:
    """Start, end and sum of the run of bins (n,) with the largest sum, on a circle; 0, 0, 0 for none."""
    n = len(gain)
    sums = np.concatenate([[0.0], np.cumsum(np.concatenate([gain, gain]))])
    start, length = np.arange(n)[:, None], np.arange(n + 1)
    runs = sums[start + length] - sums[start]
    low, longest = divmod(int(np.argmax(runs)), n + 1)
    return (low, low + longest, float(runs[low, longest])) if longest else (0, 0, 0.0)
