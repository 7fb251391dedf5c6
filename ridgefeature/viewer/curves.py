"""Height and width along a ridge, and its section, as SVG for the page.

The page points at places by the part of the picture's width between `LEFT` and `RIGHT`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.readable import number
from ridgefeature.ridge import Ridge

Array = NDArray[np.float64]
WIDTH, HEIGHT = 1000.0, 190.0
LEFT, RIGHT = 70.0, 985.0
_TOP, _BOTTOM, _GAP = 10.0, 168.0, 16.0
SECTION = (360.0, 190.0)
_MOST = 1500
"""Points of a scan on a section, at most."""


def profile(ridge: Ridge, between: tuple[float, float] | None = None) -> str:
    """h(s) above w(s), with bands of one standard deviation and the stretch that is chosen, if one is."""
    middle = 0.5 * (_TOP + _BOTTOM)
    parts = [_stretch(ridge, between)]
    rows = (
        ("h", ridge.height, ridge.height_std, _TOP, middle - 0.5 * _GAP),
        ("w", ridge.width, ridge.width_std, middle + 0.5 * _GAP, _BOTTOM),
    )
    for name, values, std, top, bottom in rows:
        parts.append(_row(ridge, name, values, std, top, bottom))
    for s in _ticks(0.0, ridge.length, 8):
        x = _x(ridge, s)
        parts.append(
            f'<text class="tick" x="{x:.1f}" y="{_BOTTOM + 14:.1f}" text-anchor="middle">{number(s)}</text>'
        )
    parts.append(f'<text class="tick" x="{RIGHT}" y="{HEIGHT - 1}" text-anchor="end">s [{ridge.unit}]</text>')
    title = f"Height {_told(ridge.height)} and width {_told(ridge.width)} {ridge.unit} along the ridge"
    return _svg(WIDTH, HEIGHT, title, parts)


def place_of(part: float, length: float) -> float | None:
    """The arc length at a part of the picture's width; None beside the curves."""
    s = (part * WIDTH - LEFT) / (RIGHT - LEFT) * length
    return float(s) if 0.0 <= s <= length else None


def part_of(s: float, length: float) -> float:
    """The part of the picture's width at an arc length."""
    return (LEFT + (RIGHT - LEFT) * s / length) / WIDTH


def section(ridge: Ridge, registered: Ridge, s: float, y: Array, z: Array) -> str:
    """The section at arc length s, as it is and as it was registered, with scan points near it (y, z)."""
    s = min(max(s, 0.0), ridge.length)
    now, then = ridge.section_at(s), registered.section_at(s)
    step = 1 + len(y) // _MOST
    y, z = y[::step], z[::step]
    across = np.concatenate([now[:, 0], then[:, 0]])
    up = np.concatenate([now[:, 1], then[:, 1], z[np.abs(z) < 3.0 * np.abs(then[:, 1]).max() + 1e-300]])
    width, height = SECTION
    (x0, x1), (z0, z1) = (across.min(), across.max()), (min(up.min(), 0.0), max(up.max(), 0.0))
    scale = min((width - 20) / max(x1 - x0, 1e-300), (height - 44) / max(z1 - z0, 1e-300))

    def place(points: Array) -> Array:
        x = 0.5 * width + (points[:, 0] - 0.5 * (x0 + x1)) * scale
        return np.column_stack([x, 0.5 * (height - 24) + 4 - (points[:, 1] - 0.5 * (z0 + z1)) * scale])

    dots = place(np.column_stack([y, z]))
    inside = (dots > 0).all(axis=1) & (dots[:, 0] < width) & (dots[:, 1] < height - 20)
    parts = [
        '<path class="dots" d="' + "".join(f"M{a:.1f} {b:.1f}h0" for a, b in dots[inside]) + '"/>',
        f'<polyline class="then" points="{_points(place(then))}"/>',
        f'<polyline class="now" points="{_points(place(now))}"/>',
    ]
    high, wide = (float(np.interp(s, ridge.arc_length, x)) for x in (ridge.height, ridge.width))
    told = f"s = {number(s)}   h = {number(high)}   w = {number(wide)} {ridge.unit}"
    parts.append(f'<text class="tick" x="{0.5 * width}" y="{height - 6}" text-anchor="middle">{told}</text>')
    return _svg(width, height, f"Section at {told}", parts)


def _row(ridge: Ridge, name: str, values: Array, std: Array, top: float, bottom: float) -> str:
    spread = np.where(np.isfinite(std), std, 0.0)
    low, high = float((values - spread).min()), float((values + spread).max())
    low, high = min(low, 0.0), max(high, 0.0)
    size = max(high - low, 1e-300)

    def at(v: Array) -> Array:
        return np.column_stack([_x(ridge, ridge.arc_length), bottom - (v - low) / size * (bottom - top)])

    band = np.concatenate([at(values + spread), at(values - spread)[::-1]])
    ticks = "".join(
        f'<line class="grid" x1="{LEFT}" x2="{RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
        f'<text class="tick" x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{number(v)}</text>'
        for v, y in ((v, bottom - (v - low) / size * (bottom - top)) for v in _ticks(low, high, 3))
    )
    label = f'<text class="name" x="10" y="{0.5 * (top + bottom) + 5:.1f}">{name}</text>'
    curve = f'<polyline class="{name}" points="{_points(at(values))}"/>'
    return f'{ticks}{label}<polygon class="band {name}" points="{_points(band)}"/>{curve}'


def _stretch(ridge: Ridge, between: tuple[float, float] | None) -> str:
    if between is None:
        return ""
    low, high = (float(_x(ridge, np.clip(s, 0.0, ridge.length))) for s in between)
    return (
        f'<rect class="stretch" x="{low:.1f}" y="{_TOP}" width="{high - low:.1f}" height="{_BOTTOM - _TOP}"/>'
    )


def _x(ridge: Ridge, s: Array | float) -> Array:
    return np.asarray(LEFT + (RIGHT - LEFT) * np.asarray(s) / ridge.length)


def _ticks(low: float, high: float, most: int) -> Array:
    """Round numbers from low to high, about so many."""
    size = max(high - low, 1e-300)
    rough = size / most
    power = 10.0 ** np.floor(np.log10(rough))
    step = next(float(k * power) for k in (1, 2, 5, 10) if k * power >= rough)
    first = np.ceil(low / step - 1e-9)
    return np.asarray((first + np.arange(int((high / step) - first + 1e-9) + 1)) * step + 0.0)


def _points(places: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in places)


def _told(values: Array) -> str:
    return f"{number(float(values.min()))} to {number(float(values.max()))}"


def _svg(width: float, height: float, title: str, parts: list[str]) -> str:
    body = "".join(parts)
    box = f'viewBox="0 0 {width:g} {height:g}"'
    return f'<svg {box} role="img" aria-label="{title}"><title>{title}</title>{body}</svg>'
