"""Scan points as a ridge sees them: arc length, distance from the spine, height over the base."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.ridge import Ridge
from ridgefeature.template import Template

Array = NDArray[np.float64]

_BLOCK = 20_000


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


def template_places(ridge: Ridge) -> Array:
    """Arc length (m,) of the middle of each template."""
    middles = np.array([template.position for template in ridge.templates])
    return local_coordinates(ridge, middles)[0]


def outline(template: Template, samples: int = 25) -> Array:
    """A closed line (m, 3) around a template: its section at both ends, its borders between."""
    y = np.linspace(-template.half_breadth, template.half_breadth, samples)
    z = template.height * template.section(y / template.width)
    half = 0.5 * template.length
    back = np.column_stack([np.full_like(y, -half), y, z])
    front = np.column_stack([np.full_like(y, half), y, z])[::-1]
    return template.position + np.concatenate([back, front, back[:1]]) @ template.rotation.T


def thinned(points: Array, most: int) -> Array:
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
