"""Stations: a chain of templates as functions of arc length, on one C2 spine."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.basis import basis_matrix, periodic_interpolation
from ridgefeature.bspline import Curve
from ridgefeature.kernels.base import on_base, standing
from ridgefeature.kernels.natural_spline import natural_spline_matrix
from ridgefeature.medians import median
from ridgefeature.merge import LEAST_BORDER
from ridgefeature.settings import Settings
from ridgefeature.template import Template

Array = NDArray[np.float64]

_PER_TEMPLATE = 4
_SCATTERED, _DIFFERENT = 3.0, 1.2
"""Noise, in the usual one, and height, in that of its neighbours, from which on a template is out of line."""
_MOST = 401


@dataclass(frozen=True, eq=False)
class Stations:
    """k places along a ridge, evenly spaced in arc length, in the frame and unit of the scan."""

    arc_length: Array
    """(k,) ascending from 0."""
    spine: Array
    """(k, 3) centre line on the base, under the apex."""
    tangent: Array
    """(k, 3) unit."""
    normal: Array
    """(k, 3) unit, square to the tangent."""
    height: Array
    """(k,) apex over the base; negative for a groove."""
    width: Array
    """(k,) between the feet."""
    height_std: Array
    width_std: Array
    """(k,) one standard deviation, as those of the height."""
    border: Array
    """(k,) distance of the flanks' outer borders from the spine; a change of h or w does not move them."""
    curvature: Array = field(default_factory=lambda: np.empty(0), kw_only=True)
    """(k,) of the base across the path, positive where it rises to both sides; zeros if not given."""
    half_height_width_std: Array = field(default_factory=lambda: np.empty(0), kw_only=True)
    """(k,) of the full width at half height, which is often known better than that between the feet."""
    spine_std: Array = field(default_factory=lambda: np.empty(0), kw_only=True)
    """(k,) of the spine's place sideways. Both are infinite if not given."""

    def __post_init__(self) -> None:
        for name, value in (("curvature", 0.0), ("half_height_width_std", np.inf), ("spine_std", np.inf)):
            if not getattr(self, name).size:
                object.__setattr__(self, name, np.full(len(self.arc_length), value))


def interpolating_curve(sites: Array, points: Array) -> Curve:
    """Cubic spline (n, d) through points at sites (n,), not-a-knot; of lower degree below four points."""
    n = len(sites)
    degree = min(3, n - 1)
    inner = sites[2:-2] if n > 4 else sites[:0]
    knots = np.concatenate([np.full(degree + 1, sites[0]), inner, np.full(degree + 1, sites[-1])])
    poles = np.asarray(np.linalg.solve(basis_matrix(knots, degree, sites), points), dtype=np.float64)
    return Curve(poles, knots, degree)


def arc_lengths(path: Curve, sites: Array, per_site: int = 32) -> tuple[Array, Array]:
    """Parameters, dense between the sites, and the arc length of the curve up to each (Simpson's rule)."""
    fine = np.interp(np.arange(per_site * (len(sites) - 1) + 1) / per_site, np.arange(len(sites)), sites)
    speed = np.linalg.norm(path(fine, 1), axis=1)
    ends = fine[::2]
    pieces = np.diff(ends) / 6 * (speed[:-2:2] + 4 * speed[1::2] + speed[2::2])
    return ends, np.concatenate([[0.0], np.cumsum(pieces)])


def unit(vectors: Array) -> Array:
    """Vectors (..., 3) at length 1."""
    return np.asarray(vectors / np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True)), dtype=np.float64)


def _on_path(template: Template, x: float) -> Array:
    """Point of the template's bent spine at x along it."""
    place = np.array([x, 0.5 * template.trend[0] * x * x, 0.0])
    if template.curved:
        place = on_base(place[None], template.base)[0]
    return template.position + template.rotation @ place


def _normal(template: Template, part: float) -> Array:
    """Normal of the base so many lengths along the template."""
    if not template.curved:
        return template.rotation[:, 2]
    place = np.array([part * template.length, 0.0, 0.0])
    return np.asarray(template.rotation @ standing(place, np.eye(3), template.base)[1][:, 2])


def in_line(templates: tuple[Template, ...]) -> tuple[Template, ...]:
    """The templates without those whose points scatter more than usual and that differ from both neighbours.

    Their fit went wrong: what lies between the neighbours is known better without them.
    """
    usual = _SCATTERED * median([t.scale for t in templates])
    heights = [abs(t.height) for t in templates]

    def astray(i: int) -> bool:
        low, high = sorted((heights[i - 1], heights[i + 1]))
        return templates[i].scale > usual and not low / _DIFFERENT < heights[i] < _DIFFERENT * high

    return tuple(t for i, t in enumerate(templates) if i in (0, len(templates) - 1) or not astray(i))


def lay_out(templates: tuple[Template, ...], settings: Settings, closed: bool = False) -> Stations:
    """Stations of a chain of fitted templates; closed: the last station is the first again.

    The spine is a C2 spline through the templates' centres and outer ends; height and width are natural cubic
    splines through the templates' values in arc length, so the standard deviations follow by the same linear
    map. On a ring, which begins at the first template's centre, all splines are periodic. A template that is
    out of line among its neighbours is left out.
    """
    templates = in_line(templates)
    way = _ring(templates) if closed else _open_path(templates)
    k = int(np.clip(_PER_TEMPLATE * len(templates) + 1, 13, _MOST))
    s = np.linspace(0.0, way.total, k)
    t = np.interp(s, way.lengths, way.fine)
    tangent = unit(way.path(t, 1))
    normal = way.normals(templates, s)
    normal = unit(normal - tangent * (normal * tangent).sum(axis=1, keepdims=True))
    found = Stations(
        arc_length=s,
        spine=way.path(t),
        tangent=tangent,
        normal=normal,
        **_sizes(templates, way.spread(s), way.curvature(s), settings),
        curvature=way.spread(np.clip(s, way.at[0], way.at[-1])) @ [q.base[2] for q in templates],
    )
    return meeting(found) if closed else found


@dataclass(frozen=True, eq=False)
class _Path:
    """The spine of a chain of templates as a curve, and how values at their centres spread along it."""

    path: Curve
    fine: Array
    lengths: Array
    """Arc length up to the curve's parameters `fine`."""
    at: Array
    """Arc length of the templates' centres; of a ring that of the first again, too."""
    bends: Array
    """Curvatures there."""
    closed: bool

    @property
    def total(self) -> float:
        return float(self.lengths[-1])

    def spread(self, s: Array) -> Array:
        """(k, n) from values at the n templates to values at arc lengths s (k,)."""
        if not self.closed:
            return natural_spline_matrix(self.at, s)
        knots, inverse = periodic_interpolation(self.at)
        return _folded(basis_matrix(knots, 3, s) @ inverse)

    def normals(self, templates: tuple[Template, ...], s: Array) -> Array:
        """(k, 3) the base's normals at arc lengths s (k,), not yet of unit length."""
        own = [q.rotation[:, 2] for q in templates]
        if self.closed:
            return self.spread(s) @ np.array(own)
        ends = np.concatenate([[0.0], self.at, [self.total]])
        up = np.array([_normal(templates[0], -0.5), *own, _normal(templates[-1], 0.5)])
        return natural_spline_matrix(ends, s) @ up

    def curvature(self, s: Array) -> Array:
        return np.interp(s, self.at, self.bends)


def _open_path(templates: tuple[Template, ...]) -> _Path:
    first, last = templates[0], templates[-1]
    sites = np.array(
        [
            _on_path(first, -0.5 * first.length),
            *(t.position for t in templates),
            _on_path(last, 0.5 * last.length),
        ]
    )
    parameters = _chord_lengths(sites)
    path = interpolating_curve(parameters, sites)
    fine, lengths = arc_lengths(path, parameters)
    at = np.interp(parameters[1:-1], fine, lengths)
    return _Path(path, fine, lengths, at, np.array([abs(t.trend[0]) for t in templates]), False)


def _ring(templates: tuple[Template, ...]) -> _Path:
    round_again = (*templates, templates[0])
    sites = np.array([t.position for t in round_again])
    parameters = _chord_lengths(sites)
    knots, inverse = periodic_interpolation(parameters)
    path = Curve(inverse @ sites, knots, 3)
    fine, lengths = arc_lengths(path, parameters)
    at = np.interp(parameters, fine, lengths)
    return _Path(path, fine, lengths, at, np.array([abs(t.trend[0]) for t in round_again]), True)


def _chord_lengths(sites: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(sites, axis=0), axis=1))])


def _folded(matrix: Array) -> Array:
    """The map from values at n + 1 sites, the last of which is the first again, as one from n values."""
    out = matrix[:, :-1].copy()
    out[:, 0] += matrix[:, -1]
    return out


def meeting(stations: Stations) -> Stations:
    """The stations with the last one the first again, to the last bit."""
    changes = {}
    for name in (f.name for f in fields(Stations) if f.name != "arc_length"):
        values = np.array(getattr(stations, name))
        values[-1] = values[0]
        changes[name] = values
    return replace(stations, **changes)


def _sizes(
    templates: tuple[Template, ...], spread: Array, curvature: Array, settings: Settings
) -> dict[str, Array]:
    """Height, width, their deviations, and border at the stations.

    spread (k, n): from values at the templates; curvature (k,): of the path.
    """
    std = np.array([q.std[[6, 7, 1]] if q.std is not None else np.full(3, np.inf) for q in templates])
    widths = np.array([q.width for q in templates])
    width = np.maximum(spread @ widths, 0.25 * widths.min())
    heights = np.array([q.height for q in templates])
    # Beyond the last centres both go on straight, but neither vanishes nor changes its sign.
    sign = 1.0 if median(heights) > 0 else -1.0
    height = sign * np.maximum(sign * (spread @ heights), 0.05 * np.abs(heights).min())
    known = np.where(np.isfinite(std), std, 0.0)
    unknown = (np.abs(spread) > 1e-9) @ ~np.isfinite(std)  # a product of 0 and infinity is no number
    height_std, width_std, spine_std = np.where(unknown, np.inf, np.sqrt(spread**2 @ known**2)).T
    return {
        "height": height,
        "width": width,
        "height_std": height_std,
        "width_std": width_std,
        "half_height_width_std": templates[0].section.half_height_width * width_std,
        "spine_std": spine_std,
        "border": border_of(width, curvature, settings),
    }


def border_of(width: Array, curvature: Array, settings: Settings) -> Array:
    """(k,) where the flanks end: less far out where the path bends, by its curvature (k,)."""
    inner = np.maximum(0.9 / np.maximum(curvature, 1e-300), 1.01 * LEAST_BORDER * width)
    return np.minimum((0.5 + settings.border) * width, inner)
