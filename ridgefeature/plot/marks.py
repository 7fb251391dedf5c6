"""Outlines of templates, and fewer points: what the pictures draw."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ridgefeature.template import Template

Array = NDArray[np.float64]
T = TypeVar("T", bound=np.generic)


def outline(template: Template, back: float = np.inf, ahead: float = np.inf, samples: int = 25) -> Array:
    """A closed line (m, 3) around a template: its section at both ends, its borders between.

    back, ahead: lengths from its middle beyond which it is cut off.
    """
    y = np.linspace(-template.half_breadth, template.half_breadth, samples)
    z = template.height * template.section(y / template.width)
    half = 0.5 * template.length
    first = np.column_stack([np.full_like(y, -min(half, back)), y, z])
    last = np.column_stack([np.full_like(y, min(half, ahead)), y, z])[::-1]
    return template.position + np.concatenate([first, last, first[:1]]) @ template.rotation.T


def thinned(points: NDArray[T], most: int) -> NDArray[T]:
    """At most that many of the points, chosen at random (scans come in rows, which even steps would show)."""
    if len(points) <= most:
        return points
    return points[np.sort(np.random.default_rng(0).choice(len(points), most, replace=False))]
