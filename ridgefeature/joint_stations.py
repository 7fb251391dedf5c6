"""Stations of a ridge that was fitted as a whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.basis import periodic_interpolation
from ridgefeature.bspline import Curve
from ridgefeature.curled_ends import uncurled
from ridgefeature.joint import Joint
from ridgefeature.kernels.strip import E, H, W
from ridgefeature.medians import median
from ridgefeature.settings import Settings
from ridgefeature.smoothing import basis_at
from ridgefeature.stations import Stations, arc_lengths, border_of, interpolating_curve, meeting, unit

Array = NDArray[np.float64]

_NARROWEST, _LOWEST = 0.2, 0.02
"""Least width and height, in those that are usual: neither vanishes nor changes its sign."""


def stations_of(
    joint: Joint,
    count: int,
    settings: Settings,
    between: tuple[float, float] | None = None,
    known: bool = False,
) -> Stations:
    """Evenly spaced stations, `count` of them; of a ring the last is the first again.

    between: arc lengths of the joint's path, if not all of it. known: their standard deviations are without
    those of the section, as if that was known.
    """
    path = joint.path
    closed = path.overlap > 0
    start, end = between or (float(path.at[0]) + path.overlap, float(path.at[-1]) - path.overlap)
    s = np.linspace(start, end, count)
    spine, up, sizes, _ = _places(joint, s, False)
    if not closed:
        spine = uncurled(spine, up, sizes[:, 1], sizes[:, 2])
    chords = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(spine, axis=0), axis=1))])
    if closed:
        spine[-1] = spine[0]
        knots, inverse = periodic_interpolation(chords)
        curve = Curve(inverse @ spine, knots, 3)
    else:
        curve = interpolating_curve(chords, spine)
    fine, lengths = arc_lengths(curve, chords, 8)
    even = np.linspace(0.0, lengths[-1], count)
    t = np.interp(even, lengths, fine)
    where = np.interp(t, chords, s)
    _, normal, values, stds = _places(joint, where)
    tangent = unit(curve(t, 1))
    normal = unit(normal - tangent * (normal * tangent).sum(axis=1, keepdims=True))
    bend = np.abs((np.gradient(tangent, even, axis=0) * np.cross(normal, tangent)).sum(axis=1))
    curvature, height, width = values.T
    width = np.maximum(width, _NARROWEST * median(joint.terms[:, W]))  # those are never negative
    usual = median(height)
    height = np.copysign(np.maximum(height * np.sign(usual), _LOWEST * abs(usual)), usual)
    half = joint.section.half_height_width
    found = Stations(
        arc_length=even,
        spine=curve(t),
        tangent=tangent,
        normal=normal,
        height=height,
        width=width,
        height_std=stds[:, 0],
        width_std=stds[:, 1],
        half_height_width_std=half * stds[:, 1],
        spine_std=stds[:, 2],
        border=border_of(width, bend, settings),
        curvature=curvature,
    )
    found = found if known else with_section_std(found, joint)
    return meeting(found) if closed else found


def with_section_std(stations: Stations, joint: Joint) -> Stations:
    """Stations whose standard deviations were without those of the section, with these."""
    shape = joint.section_std
    return replace(
        stations,
        height_std=np.hypot(stations.height_std, np.abs(stations.height) * shape.height),
        width_std=np.hypot(stations.width_std, stations.width * shape.width),
        half_height_width_std=np.hypot(
            stations.half_height_width_std, stations.width * shape.half_height_width
        ),
        spine_std=np.hypot(stations.spine_std, stations.width * shape.apex),
    )


def _places(joint: Joint, s: Array, sure: bool = True) -> tuple[Array, Array, Array, Array]:
    """Spine, normal (k, 3 each); curvature, height, width (k, 3); standard deviations of these two
    and of the place sideways (k, 3), zeros unless `sure`.

    s (k,): arc lengths of the path that the ridge was fitted along.
    """
    path = joint.path
    if not path.overlap:
        return _unblended(joint, s, sure)
    # A ring was fitted beyond its seam at both ends: there one end fades into the other.
    length = float(path.at[-1] - path.at[0]) - 2.0 * path.overlap
    signed = (s + 0.5 * length) % length - 0.5 * length
    near = np.abs(signed) < path.overlap
    low = np.where(near, signed, s % length)
    x = np.clip(0.5 * (signed / path.overlap + 1.0), 0.0, 1.0)
    share = np.where(near, x**3 * (10 - 15 * x + 6 * x * x), 1.0)[:, None]
    one, other = (_unblended(joint, x, sure) for x in (low, np.where(near, signed + length, low)))
    blend = [share * a + (1.0 - share) * b for a, b in zip(one, other, strict=True)]
    return blend[0], blend[1], blend[2], blend[3]


def _unblended(joint: Joint, s: Array, sure: bool) -> tuple[Array, Array, Array, Array]:
    path = joint.path
    place = np.interp(s, path.at, path.knots)
    first, basis = basis_at(path.coefficients, place)
    a, b, c, e, h, w = (
        (basis[:, :, None] * joint.smooth.coefficients[first[:, None] + np.arange(4)]).sum(axis=1).T
    )
    origin, left, normal, bend = path.between(s)
    tilt = b + (bend + 2.0 * c) * e
    rise = a + b * e + (0.5 * bend + c) * e * e
    spine = origin + e[:, None] * left + rise[:, None] * normal
    up = unit(normal - tilt[:, None] * left)
    stds = np.zeros((3, len(s)))
    if sure:
        stds = np.array([joint.smooth.deviations(first, basis, term) for term in (H, W, E)])
    return spine, up, np.column_stack([bend + 2.0 * c, h, w]), stds.T
