"""Outlines of templates, as the pictures draw them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ridgefeature.template import Template

Array = NDArray[np.float64]


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
