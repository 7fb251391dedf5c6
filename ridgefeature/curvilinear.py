"""Points as a ridge sees them: arc length, distance from the spine, height over the spine or the base."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ridgefeature.ridge import Ridge
    from ridgefeature.template import Template

Array = NDArray[np.float64]
T = TypeVar("T", bound=np.generic)

_BLOCK = 20_000
_TOP = 0.9
"""Height, in that of the apex, from which on a place is on the crest: the apex of a flat top is anywhere."""
_ASIDE = 0.5
"""Distance from the spine, in widths between the feet, up to which a template's centre is on the path."""


def local_coordinates(ridge: Ridge, points: Array) -> tuple[Array, Array, Array]:
    """(s, y, z) of points (n, 3), each (n,): in the frame that the stations have at s.

    s runs on past both ends, in the direction of the ridge there. Right to second order in the stations'
    spacing, which is enough for a picture.
    """
    near = _nearest(ridge.spine, points)
    offset = points - ridge.spine[near]
    ahead = np.einsum("ij,ij->i", offset, ridge.tangent[near])
    step = ridge.arc_length[1]
    s = ridge.arc_length[near] + ahead
    # The frame between two stations: the straight line between them.
    part = np.clip(ahead / step, -1, 1)
    other = np.clip(near + np.where(part < 0, -1, 1), 0, len(ridge.spine) - 1)
    weight = np.where(other == near, 0.0, np.abs(part))[:, None]
    origin = (1 - weight) * ridge.spine[near] + weight * ridge.spine[other]
    across, normal = (
        (1 - weight) * axis[near] + weight * axis[other] for axis in (ridge.across, ridge.normal)
    )
    offset = points - origin
    return s, np.einsum("ij,ij->i", offset, across), np.einsum("ij,ij->i", offset, normal)


def over_base(ridge: Ridge, s: Array, y: Array, z: Array) -> Array:
    """Heights (n,) over the base, which is curved across the path, of what `local_coordinates` gives."""
    return np.asarray(z - 0.5 * np.interp(s, ridge.arc_length, ridge.curvature) * y**2)


def templates_on(ridge: Ridge) -> tuple[tuple[Template, ...], Array]:
    """The templates that are part of the finished ridge, and the arc length (m,) of the middle of each.

    Left out are those whose middle lies beyond the ridge's ends or off its path: the march went there, and
    the fit of the whole ridge did not follow.
    """
    middles = np.array([template.position for template in ridge.templates])
    s, y, _ = local_coordinates(ridge, middles)
    if ridge.closed:
        s = s % ridge.length
    aside = np.abs(y) <= _ASIDE * np.interp(s, ridge.arc_length, ridge.width)
    on = np.flatnonzero((s >= 0) & (s <= ridge.length) & aside)
    return tuple(ridge.templates[i] for i in on), s[on]


def crest(ridge: Ridge) -> Array:
    """(k, 3) the middle of the highest tenth of each section: aside of the spine, where the section leans."""
    eta = np.linspace(-0.5, 0.5, 1001)
    top = eta[ridge.section(eta) >= _TOP]
    return np.asarray(ridge.surface()(ridge.arc_length, 0.5 * float(top[0] + top[-1])))


def thinned(points: NDArray[T], most: int) -> NDArray[T]:
    """At most that many of the points, chosen at random (scans come in rows, which even steps would show)."""
    if len(points) <= most:
        return points
    return points[np.sort(np.random.default_rng(0).choice(len(points), most, replace=False))]


def _nearest(places: Array, points: Array) -> NDArray[np.intp]:
    """Index (n,) of the nearest of the places (k, 3) to each point (n, 3)."""
    middle = places.mean(axis=0)
    at = places - middle
    size = np.einsum("ij,ij->i", at, at)
    blocks = [
        np.argmin(size - 2 * (points[i : i + _BLOCK] - middle) @ at.T, axis=1)
        for i in range(0, len(points), _BLOCK)
    ]
    return np.concatenate(blocks) if blocks else np.zeros(0, np.intp)
