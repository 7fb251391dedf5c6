"""Polylines and closed lines in the plane of a face's parameters. numpy only."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_PARALLEL = 1e-12  # sine of the angle between pieces of one straight line, by rounding


def signed_area(loop: Floats) -> float:
    """Area within a closed polyline (n, 2), positive counter-clockwise."""
    x, y = (loop - loop.mean(axis=0)).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def inside(points: Floats, segments: Floats) -> NDArray[np.bool_]:
    """Whether points (n, 2) lie within closed lines given as pieces (m, 2, 2): the even-odd rule."""
    a, b = segments[None, :, 0], segments[None, :, 1]
    p = points[:, None]
    straddles = (a[..., 1] > p[..., 1]) != (b[..., 1] > p[..., 1])
    rise = np.where(straddles, b[..., 1] - a[..., 1], 1.0)
    x = a[..., 0] + (p[..., 1] - a[..., 1]) / rise * (b[..., 0] - a[..., 0])
    return np.asarray(np.count_nonzero(straddles & (p[..., 0] < x), axis=1) % 2 == 1)


def cross(a: Floats, b: Floats) -> bool:
    """Whether any straight piece of a (n, 2, 2) meets one of b (m, 2, 2)."""
    low, high = a.min(axis=(0, 1)), a.max(axis=(0, 1))
    near = b[((b.max(axis=1) >= low) & (b.min(axis=1) <= high)).all(axis=1)]
    return bool(meetings(a, near).any())


def meetings(a: Floats, b: Floats) -> NDArray[np.bool_]:
    """Which straight pieces of a (n, 2, 2) meet which of b (m, 2, 2): (n, m); parallel ones do not."""
    t, u = _shares(a, b)
    return np.asarray((t >= 0) & (t <= 1) & (u >= 0) & (u <= 1))


def polyline_meetings(a: Floats, b: Floats) -> list[tuple[int, float, int, float]]:
    """Segments of two polylines that meet, and how far along each, 0 to 1; ends count, by a small slack."""
    x, y = _shares(*(np.stack([line[:-1], line[1:]], axis=1) for line in (a, b)))
    meet = (np.abs(x - 0.5) <= 0.5 + 1e-6) & (np.abs(y - 0.5) <= 0.5 + 1e-6)
    return [(int(m), float(x[m, n]), int(n), float(y[m, n])) for m, n in np.argwhere(meet)]


def _shares(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """How far along each of a (n, 2, 2), and of b (m, 2, 2), their lines meet: (n, m); NaN if parallel."""
    p, r = a[:, None, 0], (a[:, 1] - a[:, 0])[:, None]
    q, s = b[None, :, 0], (b[:, 1] - b[:, 0])[None]
    d = q - p
    det = r[..., 0] * s[..., 1] - r[..., 1] * s[..., 0]
    # Pieces of one straight line are parallel but for rounding.
    parallel = np.abs(det) <= _PARALLEL * np.linalg.norm(r, axis=-1) * np.linalg.norm(s, axis=-1)
    safe = np.where(parallel, np.nan, det)
    t = (d[..., 0] * s[..., 1] - d[..., 1] * s[..., 0]) / safe
    return t, (d[..., 0] * r[..., 1] - d[..., 1] * r[..., 0]) / safe
