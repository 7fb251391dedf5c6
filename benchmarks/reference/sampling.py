"""Points of a reference ridge: sampling, holes, noise, banding and outliers, all from one seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reference.hosts import Array
from reference.paths import Path
from reference.truth import Truth

NEAR = 0.75
"""Within so many widths of the path points are placed by their Fermi coordinates, exactly."""
_RATIOS = 25
_PARTS = 1200


@dataclass(frozen=True)
class Scanner:
    """How a surface is sampled. Lengths in largest foot widths, angles in radians.

    spacing: mean distance of points. grid: even in the base's chart as a depth image is, else at random, even
    by area over base and ridge, flanks too. noise: standard deviation, the same in all directions. outliers:
    share of all points, drawn evenly from a layer three largest heights thick about the base, from one below
    to two above. banding: standard deviation of what all points of a scan line share, square to the base.
    gap: arc lengths from which to which all data are missing within one width of the path.
    """

    spacing: float
    grid: bool = False
    turn: float = 0.0
    noise: float = 0.0
    outliers: float = 0.0
    banding: float = 0.0
    gap: tuple[float, float] | None = None
    margin: float = 1.6


@dataclass(frozen=True, eq=False)
class Sample:
    """Points (n, 3) in the host's frame, what they are exact points of, and which may be clicked.

    s, y (n,): Fermi coordinates, NaN beyond NEAR widths of the path, where the exact point is the host's.
    exact (n, 3): without noise. good (n,): no outlier.
    """

    points: Array
    exact: Array
    s: Array
    y: Array
    good: Array


def sample(truth: Truth, scanner: Scanner, random: np.random.Generator) -> Sample:
    """A scan of the ridge and of the host about it."""
    path, host = truth.path, truth.base
    box = _box(path, scanner.margin)
    uv = _chart_points(truth, scanner, box, random)
    base = host.place(uv)
    s, y = path.coordinates(base)
    width = truth.widths(np.clip(np.nan_to_num(s), 0.0, path.bends.length))
    near = np.abs(y) < NEAR * width
    if not scanner.grid:
        inside = truth.closed | ((s >= 0) & (s <= path.bends.length))
        far = ~(near & inside & (np.abs(y) < 0.5 * width))
        base, s, y, near = base[far], s[far], y[far], near[far]
        more = _even_on_ridge(truth, scanner, random)
        base = np.concatenate([base, np.zeros((len(more[0]), 3))])
        s, y = np.concatenate([s, more[0]]), np.concatenate([y, more[1]])
        near = np.concatenate([near, np.ones(len(more[0]), dtype=bool)])
    s, y = np.where(near, s, np.nan), np.where(near, y, np.nan)
    normal = host.normal(base)
    base[near], normal[near] = path.fermi(s[near], y[near])
    exact = base.copy()
    exact[near] += truth.elevation(s[near], y[near])[:, None] * normal[near]
    keep = _seen(truth, scanner, base, s, y)
    return _noisy(truth, scanner, random, box, exact[keep], normal[keep], s[keep], y[keep])


def _box(path: Path, margin: float) -> Array:
    """(2, 2) lowest and highest chart coordinates of the data."""
    on = (path.places >= 0) & (path.places <= path.bends.length)
    uv = path.host.chart(path.frames(path.places[on])[0])
    return np.array([uv.min(axis=0) - margin, uv.max(axis=0) + margin])


def _chart_points(truth: Truth, scanner: Scanner, box: Array, random: np.random.Generator) -> Array:
    """Chart coordinates (n, 2) in the box, a turned grid or even by area."""
    low, high = box
    host = truth.base
    if scanner.grid:
        reach = 0.5 * float(np.hypot(*(high - low)))
        ticks = np.arange(-reach, reach, scanner.spacing)
        u, v = (axis.ravel() for axis in np.meshgrid(ticks, ticks))
        c, s = np.cos(scanner.turn), np.sin(scanner.turn)
        uv = np.column_stack([c * u - s * v, s * u + c * v]) + 0.5 * (low + high)
        uv = uv[((uv >= low) & (uv <= high)).all(axis=1)]
        return uv[host.stretch(uv) > 0]
    most = float(host.stretch(np.array([[u, v] for u in box[:, 0] for v in box[:, 1]])).max()) or 1.0
    n = round(float(np.prod(high - low)) * most / scanner.spacing**2)
    uv = random.uniform(low, high, (n, 2))
    return uv[random.uniform(0.0, most, n) < host.stretch(uv)]


def _even_on_ridge(truth: Truth, scanner: Scanner, random: np.random.Generator) -> tuple[Array, Array]:
    """Fermi coordinates of points even by area on the ridge's own surface, between feet and ends.

    Area by arc length is the length of the profile times 1 - curvature * y; the host's own curvature, and the
    slope along the ridge, change the density in the second order only.
    """
    eta = np.linspace(-0.5, 0.5, _PARTS + 1)
    rise = np.diff(truth.section(np.clip(eta, -0.5 + 1e-12, 0.5 - 1e-12)))
    length = truth.path.bends.length
    x = np.linspace(0.0, length, 2001)
    ratio = np.abs(truth.height(x * truth.pose.scale)) / truth.width(x * truth.pose.scale)
    ratios = np.linspace(0.0, float(ratio.max()) + 1e-9, _RATIOS)
    lengths = np.array([np.concatenate([[0.0], np.cumsum(np.hypot(1 / _PARTS, r * rise))]) for r in ratios])
    area = truth.widths(x) * np.interp(ratio, ratios, lengths[:, -1])
    total = np.concatenate([[0.0], np.cumsum(0.5 * (area[1:] + area[:-1]) * np.diff(x))])
    wanted = round(total[-1] / scanner.spacing**2)
    s, y = np.empty(0), np.empty(0)
    while len(s) < wanted:
        at = np.interp(random.uniform(0.0, total[-1], wanted), total, x)
        # One of the two tabulated ratios beside the true one, at random by nearness, is right on average.
        row = np.interp(at, x, ratio) / ratios[-1] * (_RATIOS - 1)
        row = np.minimum(np.floor(row + random.uniform(0.0, 1.0, wanted)), _RATIOS - 1).astype(np.intp)
        part = random.uniform(0.0, 1.0, wanted) * lengths[row, -1]
        across = np.empty(wanted)
        for k in range(_RATIOS):
            across[row == k] = np.interp(part[row == k], lengths[k], eta)
        across *= truth.widths(at)
        thinner = 1 - truth.path.curvature(at) * across
        kept = random.uniform(0.0, 2.0, wanted) < thinner
        s, y = np.concatenate([s, at[kept]]), np.concatenate([y, across[kept]])
    return s[:wanted], y[:wanted]


def _seen(truth: Truth, scanner: Scanner, base: Array, s: Array, y: Array) -> Array:
    """Which points are no part of a gap and not beyond a border of the data (n,)."""
    keep = np.ones(len(base), dtype=bool)
    if scanner.gap is not None:
        at, aside = truth.path.coordinates(base)
        keep &= ~((at > scanner.gap[0]) & (at < scanner.gap[1]) & (np.abs(aside) < 1.0))
    for end, place, sign in zip(truth.ends, (0.0, truth.path.bends.length), (-1.0, 1.0), strict=True):
        if end == "border":
            p, t, _ = truth.path.frames(np.array([place]))
            beyond = sign * ((base - p) @ t[0]) > 0
            keep &= ~(beyond & (np.linalg.norm(base - p, axis=1) < 2.5))
    return keep


def _noisy(
    truth: Truth,
    scanner: Scanner,
    random: np.random.Generator,
    box: Array,
    exact: Array,
    normal: Array,
    s: Array,
    y: Array,
) -> Sample:
    n = len(exact)
    points = exact + random.normal(0.0, 1.0, (n, 3)) * scanner.noise
    if scanner.banding > 0:
        uv = truth.base.chart(exact)
        across = uv @ [-np.sin(scanner.turn), np.cos(scanner.turn)]
        line = np.floor((across - across.min()) / scanner.spacing).astype(np.intp)
        shared = random.normal(0.0, scanner.banding, line.max() + 1)
        points += shared[line][:, None] * normal
    good = np.ones(n, dtype=bool)
    strays = round(scanner.outliers * n)
    if strays:
        at = random.permutation(n)[:strays]
        uv = random.uniform(box[0], box[1], (strays, 2))
        feet = truth.base.place(uv)
        tallest = truth.heights.size * (1 + abs(truth.heights.swing))
        lift = random.uniform(-1.0, 2.0, strays) * tallest
        points[at] = feet + lift[:, None] * truth.base.normal(feet)
        good[at] = False
    order = random.permutation(n)
    return Sample(points[order], exact[order], s[order], y[order], good[order])
