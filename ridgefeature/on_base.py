"""The ridge's surface on a base: rows and columns enough that what is flat lies on the base."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ridgefeature.base import Base
from ridgefeature.basis import basis_matrix, greville
from ridgefeature.bspline import Surface
from ridgefeature.merge import (
    DEGREE,
    LEAST_BORDER,
    OUTSIDE,
    along,
    interpolation,
    row_controls,
    section_knots,
)
from ridgefeature.section import Section
from ridgefeature.stations import Stations, unit

Array = NDArray[np.float64]

ON_BASE = 1e-6
"""How far borders and spine may leave the base between rows, in least borders."""
ACROSS = 4e-6
"""How far feet and flanks may leave the base between columns, in least widths."""
_BESIDE = 100.0
"""How many times that they may lie beside their place, within the base."""
_NARROW = LEAST_BORDER - 0.5
"""Breadth of the narrowest flank, in widths."""
_MOST_ROWS = 1601
_MOST_SPLITS = 16


@dataclass(frozen=True, eq=False)
class _Layout:
    """Rows and columns of a surface on one base: all that does not change with height or width."""

    s: Array
    """(n,) arc lengths of the rows."""
    spread: Array
    """(n, k) from values at the stations to values at the rows."""
    knots_u: Array
    rows_to_poles: Array
    flank: float
    """Breadth of the flanks' knot spans, in widths."""
    knots_v: Array
    across: Array
    """(m, section's poles) from control values of a row to its values at the columns' sites."""
    columns_to_poles: Array
    raised: slice
    """The poles of a row that bear on nothing beyond the feet."""
    lift_to_poles: Array
    """(raised, m): the same as columns_to_poles for what stands on the base, zero for all other poles."""


# Kept beside the bases, not in them: a base need be no more than its protocol says.
_LAYOUTS: WeakKeyDictionary[Any, dict[Any, _Layout]] = WeakKeyDictionary()


def surface_on(base: Base, stations: Stations, section: Section) -> Surface:
    """The C2 bicubic surface of a ridge on a base: at arc length s, across the path,

        v -> base(s, Y(v)) + H(v) normal(s, Y(v)),

    Y and H the section's splines with the control values that a flat ridge has. u is arc length, v the
    distance from the path in widths. Poles are affine in height. On a flat base they are those of the flat
    ridge; on a curved one rows and columns are added until borders and spine lie on the base within
    ON_BASE borders, feet and flanks within ACROSS widths.
    Raises ValueError where the base is none, its length is not the ridge's, it returns anything but finite
    arrays, or it is closed and the ridge's ends do not meet.
    """
    return surfaces_on(base, stations, section)[0]


def surfaces_on(base: Base, stations: Stations, section: Section) -> tuple[Surface, Surface]:
    """The surface of a ridge on a base, and that of the same ridge with height 0; see surface_on."""
    _check(base, stations)
    layout = _kept_layout(base, stations, section)
    width, border, height = (layout.spread @ x for x in (stations.width, stations.border, stations.height))
    sideways, raised = row_controls(section, width, border, height, layout.flank)
    points, normals = _on(base, layout.s, sideways @ layout.across.T)
    lift = (raised @ layout.across.T)[..., None] * normals
    flat = np.tensordot(layout.rows_to_poles, np.matmul(layout.columns_to_poles, points), 1)
    poles = flat.copy()
    poles[:, layout.raised] += np.tensordot(layout.rows_to_poles, np.matmul(layout.lift_to_poles, lift), 1)
    if base.closed:
        poles[-1], flat[-1] = poles[0], flat[0]
    knots = layout.knots_u, layout.knots_v
    return Surface(poles, *knots, DEGREE, DEGREE), Surface(flat, *knots, DEGREE, DEGREE)


def _check(base: Base, stations: Stations) -> None:
    if not isinstance(base, Base):
        raise ValueError(f"base: expected a map (s, y) with length and closed, got {type(base).__name__}")
    length = float(stations.arc_length[-1])
    if not abs(base.length - length) <= 1e-6 * length:
        raise ValueError(
            f"base: expected the ridge's length {length:.9g}, got {base.length:.9g}; "
            f"fit the ridge first, by ridge.stretched({base.length:.9g})"
        )
    if base.closed:
        for name in ("height", "width", "border"):
            first, *_, last = getattr(stations, name)
            if abs(first - last) > 1e-9 * max(abs(first), abs(last)):
                raise ValueError(
                    f"base: expected a ridge whose ends meet on a closed base, its {name} is {first:g} and "
                    f"{last:g}; blend them by ridgefeature.fitting.joined(ridge)"
                )


def _on(base: Base, s: Array, y: Array) -> tuple[Array, Array]:
    points, normals = base(s, y)
    for name, array in (("points", points), ("normals", normals)):
        if np.shape(array) != (*y.shape, 3):
            raise ValueError(
                f"base: expected {name} of shape {(*y.shape, 3)}, got {np.shape(array)}; mend the base"
            )
        if not np.isfinite(array).all():
            i = int(np.argmax(~np.isfinite(array).all(axis=(1, 2))))
            raise ValueError(
                f"base: expected finite {name}, got others at arc length {s[i]:g}; mend the base"
            )
    return points, normals


def _kept_layout(base: Base, stations: Stations, section: Section) -> _Layout:
    flank = _octave(float((stations.border / stations.width).min()) - 0.5)
    key = (len(stations.arc_length), section.spans, stations.border.tobytes(), flank)
    try:
        kept = _LAYOUTS.setdefault(base, {})
    except TypeError:  # neither hashable nor weakly referenced: nothing is kept
        kept = {}
    if key not in kept:
        kept[key] = _layout(base, stations, section, flank)
    return kept[key]


def _layout(base: Base, stations: Stations, section: Section, flank: float) -> _Layout:
    k = len(stations.arc_length)
    parts = _row_parts(base, stations.border)
    n = parts * (k - 1) + 1
    s = np.linspace(0.0, base.length, n)
    spread = _spread(k, n, base.closed)
    knots, inverse = interpolation(n, base.closed)
    knots_v, flank = _columns(base, s, spread @ stations.border, section, flank)
    sites = greville(knots_v, DEGREE)
    return _Layout(
        s,
        spread,
        knots * base.length,
        inverse,
        flank,
        knots_v,
        basis_matrix(section_knots(section, flank), DEGREE, sites),
        np.asarray(np.linalg.inv(basis_matrix(knots_v, DEGREE, sites)), dtype=np.float64),
        *_lift_to_poles(knots_v, sites),
    )


def _lift_to_poles(knots: Array, sites: Array) -> tuple[slice, Array]:
    """The poles that bear on nothing beyond the feet, and the map to them from what stands on the base.

    Least squares by these poles alone: an interpolation would leave ripples on the flanks, and these belong
    to the base.
    """
    slack = 1e-9
    within = (knots[: -DEGREE - 1] > -0.5 - slack) & (knots[DEGREE + 1 :] < 0.5 + slack)
    between = np.abs(sites) < 0.5
    basis = basis_matrix(knots, DEGREE, sites)
    out = np.zeros((int(within.sum()), len(sites)))
    out[:, between] = np.linalg.pinv(basis[np.ix_(between, within)])
    first = int(np.argmax(within))
    return slice(first, first + len(out)), out


def _spread(k: int, n: int, closed: bool) -> Array:
    """(n, k): values at n even places of the spline through values at k of them."""
    return np.eye(k) if n == k else along(np.linspace(0, 1, k), np.eye(k), np.linspace(0, 1, n), 0, closed)


def _row_parts(base: Base, border: Array) -> int:
    """Into how many rows a step from station to station is cut, for borders and spine to lie on the base."""
    k, tolerance = len(border), ON_BASE * float(border.min())
    most = min(_MOST_SPLITS, max(1, (_MOST_ROWS - 1) // (k - 1)))
    parts = 1
    for _ in range(4):
        n = parts * (k - 1) + 1
        y = _spread(k, n, base.closed) @ border
        points, _ = _on(base, np.linspace(0, base.length, n), y[:, None] * [-1.0, 0.0, 1.0])
        dense = _spread(k, 2 * n - 1, base.closed)[1::2] @ border
        between = (np.arange(n - 1) + 0.5) / (n - 1)
        spline = along(np.linspace(0, 1, n), points, between, 0, base.closed)
        error = _off(base, between * base.length, dense[:, None] * [-1.0, 0.0, 1.0], spline)
        if error <= tolerance or parts == most:
            break
        parts = min(most, max(parts + 1, int(np.ceil(parts * (1.2 * error / tolerance) ** 0.25))))
    return parts


def _octave(breadth: float) -> float:
    """The power of 2 that a flank of such breadth in widths has for its knot span.

    Knots change with the octave of the width only, so that most other widths change the poles alone. The
    power is near enough for positions to run evenly over the flank, and never so large that they turn back.
    """
    return float(2.0 ** np.floor(np.log2(breadth * np.sqrt(2))))


def knot_changes(stations: Stations, least: float, most: float) -> Array:
    """Rates of the width between `least` and `most`, ascending, at which the knots across change.

    Up to and with each of them the knots are the same, for stations on one curved base.
    """
    broad = float((stations.border / stations.width).min())
    octaves = np.arange(np.floor(np.log2(broad / least)) + 2, np.floor(np.log2(_NARROW)) - 1, -1)
    rates = broad / (0.5 + 2.0 ** (octaves - 0.5))
    return np.asarray(rates[(rates > least) & (rates < most)])


def _columns(base: Base, s: Array, border: Array, section: Section, flank: float) -> tuple[Array, float]:
    """Knots across and the breadth of the flanks' spans: the flat ridge's where they do, or finer ones.

    Finer ones are cut evenly on each flank and between the feet, and looked at for both ends of the octave,
    with room for a width that varies along.
    """
    chosen = np.unique(np.linspace(0, len(s) - 1, min(len(s), 33)).round().astype(np.intp))
    s, border = s[chosen], border[chosen]
    tolerance = ACROSS * float(border.min()) / (0.5 + flank)
    widest = border / LEAST_BORDER
    plain = section_knots(section)
    if all(
        _errors_across(base, s, w, border, section, plain, OUTSIDE).max() < tolerance
        for w in (widest, 0.25 * widest)
    ):
        return plain, OUTSIDE
    breaks = np.unique(section_knots(section, flank))
    widths = [np.minimum(border / (0.5 + flank * x), widest) for x in (0.5**0.5, 1.7)]
    parts = np.ones(3, dtype=np.intp)  # left flank, ridge, right flank
    for _ in range(8):
        knots = _cut(breaks, parts)
        error = np.maximum(*(_errors_across(base, s, w, border, section, knots, flank) for w in widths))
        # an error spreads to its neighbours: first mend where it is largest
        wrong = (error > tolerance) & (error > 0.3 * error.max()) & (parts < _MOST_SPLITS)
        if not wrong.any():
            break
        more = np.ceil(parts * (1.1 * error / tolerance) ** 0.25).astype(np.intp)
        parts = np.where(wrong, np.clip(more, parts + 1, np.minimum(3 * parts, _MOST_SPLITS)), parts)
    return _cut(breaks, parts), flank


def _cut(breaks: Array, parts: NDArray[np.intp]) -> Array:
    """Knots with the left flank, each span of the ridge and the right flank in so many parts."""
    each = np.full(len(breaks) - 1, parts[1])
    each[0], each[-1] = parts[0], parts[2]
    inner = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(breaks, breaks[1:], each, strict=False)]
    return np.concatenate([np.full(DEGREE, breaks[0]), *inner, np.full(DEGREE + 1, breaks[-1])])


def _errors_across(
    base: Base, s: Array, width: Array, border: Array, section: Section, knots: Array, flank: float
) -> Array:
    """Largest distance of the rows from the base on left flank, ridge and right flank."""
    coarse = section_knots(section, flank)
    controls, _ = row_controls(section, width, border, 0 * border, flank)
    sites = greville(knots, DEGREE)
    points, _ = _on(base, s, controls @ basis_matrix(coarse, DEGREE, sites).T)
    poles = np.matmul(np.linalg.inv(basis_matrix(knots, DEGREE, sites)), points)
    breaks = np.unique(knots)
    between = (breaks[:-1, None] + np.diff(breaks)[:, None] * [0.25, 0.5, 0.75]).ravel()
    y = controls @ basis_matrix(coarse, DEGREE, between).T
    rows = np.matmul(basis_matrix(knots, DEGREE, between), poles)
    error = _distances(base, s, y, rows).max(axis=0)
    places = (between < -0.5, np.abs(between) <= 0.5, between > 0.5)
    return np.array([error[place].max() for place in places])


def _off(base: Base, s: Array, y: Array, found: Array) -> float:
    return float(_distances(base, s, y, found).max())


def _distances(base: Base, s: Array, y: Array, found: Array) -> Array:
    """(k, m) distance of found points (k, m, 3) from the base; beside their place it counts less."""
    points, normals = _on(base, s, y)
    gap = found - points
    left = unit(np.gradient(points, axis=1))
    left -= normals * (left * normals).sum(axis=-1, keepdims=True)
    from_base = np.abs((gap * normals).sum(axis=-1))
    return np.maximum(from_base, np.abs((gap * left).sum(axis=-1)) / _BESIDE)
