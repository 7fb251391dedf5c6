"""Surfaces of triangles, and points spread evenly over them."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ridgefeature.io.problems import BadFile

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# Steps of the additive sequence with the most even spread in the plane: powers of 1/g, g**3 = g + 1.
_G = 1.324717957244746
_STEPS = np.array([1 / _G, 1 / _G**2])


class Surface(Protocol):
    """What a reader gives for a file that holds surfaces; a file of points gives an array."""

    def sample(self, n: int) -> Array:
        """n points on the surface, evenly by area: (n, 3). The same n gives the same points."""

    def vertices(self) -> Array:
        """The vertices the file holds: (k, 3)."""


@dataclass(frozen=True)
class Mesh:
    """Triangles given by their corners (m, 3, 3), and the file's own vertices (k, 3).

    repeats: whether the file repeats a vertex for each triangle at it.
    """

    corners: Array
    points: Array
    repeats: bool = False

    def sample(self, n: int) -> Array:
        """n points on the triangles, evenly by area: (n, 3)."""
        which, weights = spread(areas(self.corners), n)
        return blend(self.corners[which], weights)

    def vertices(self) -> Array:
        """The file's vertices, in its order; sorted and once each if it repeats them: (k, 3)."""
        return np.unique(self.points, axis=0) if self.repeats else self.points


def areas(corners: Array) -> Array:
    """Area of each triangle of (m, 3, 3) corners: (m,); zero where a corner is not finite."""
    with np.errstate(invalid="ignore", over="ignore"):
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return np.where(np.isfinite(area), area, 0.0)


def spread(area: Array, n: int) -> tuple[Indices, Array]:
    """Places for n points, evenly over triangles of these areas (m,).

    Returns the triangle of each point (n,), ascending, and its weights on the corners (n, 3). Nothing
    is random: each triangle gets its share of n to within one, and within it the points follow a
    low-discrepancy sequence, so that there are neither clumps nor holes.
    """
    total = np.cumsum(area)
    if not len(area) or not total[-1] > 0:
        raise BadFile("its faces have no area to sample: take the vertices (vertices=True) or mend the mesh")
    steps = np.arange(n)
    # The rounding of the sum may put the last place past the last triangle that has an area.
    last = int(np.flatnonzero(area)[-1])
    which = np.minimum(np.searchsorted(total, (steps + 0.5) / n * total[-1], side="right"), last)
    u, v = ((0.5 + np.outer(_STEPS, steps)) % 1.0)[:2]
    root = np.sqrt(u)
    return which, np.column_stack([1 - root, root * (1 - v), root * v])


def blend(corners: Array, weights: Array) -> Array:
    """Weighted means (n, d) of triangles' corners (n, 3, d); exact in a coordinate that all three share."""
    a = corners[:, 0]
    return a + weights[:, 1:2] * (corners[:, 1] - a) + weights[:, 2:] * (corners[:, 2] - a)
