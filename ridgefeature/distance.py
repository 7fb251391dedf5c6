"""Distances between two point sets: Hausdorff, directed Hausdorff, and mean directed Hausdorff.

The names and formulas are those of the paper, Eq. 1 to 3. A set is a scan (anything with `.points`), an
(n, 3) array with n >= 1, or a `Grid`, which saves building one again. Lengths are in the unit of the points.
The values do not depend, in any bit, on the order of the points.
"""

import math
from typing import Protocol, runtime_checkable

import numpy.typing as npt

from .grid import Floats, Grid, build_grid, nearest_distances


@runtime_checkable
class HasPoints(Protocol):
    """Anything that carries points (n, 3), such as a scan."""

    @property
    def points(self) -> Floats: ...


PointSet = HasPoints | npt.ArrayLike


def directed_hausdorff(A: PointSet, B: PointSet) -> float:
    """H(A, B), Eq. 1: the largest distance from a point of A to the nearest point of B.

    Raises ValueError unless both are finite (n, 3) points, n >= 1.
    """
    return _largest(_grid(A), _grid(B))


def hausdorff(A: PointSet, B: PointSet) -> float:
    """D(A, B): the larger of H(A, B) and H(B, A). Raises ValueError as `directed_hausdorff` does."""
    first, second = _grid(A), _grid(B)
    return max(_largest(first, second), _largest(second, first))


def mean_directed_hausdorff(A: PointSet, B: PointSet, k: int = 1) -> float:
    """M(A, B), Eq. 3: the mean over A of the distance to B.

    With k = 1 this is the distance to the nearest point of B, with k > 1 the mean of the distances to the k
    nearest (the paper's cure for aliasing). To stand for Eq. 2, A must sample its surface evenly. Compare
    the value with `sampling_floor`: no fit comes below it.
    Raises ValueError unless both are finite (n, 3) points, n >= 1, and k is from 1 to the number of points
    of B.
    """
    target = _grid(B)
    distances = nearest_distances(target, _grid(A).points, k)
    return math.fsum(distances.ravel()) / distances.size


def sampling_floor(density: float, k: int = 1) -> float:
    """The mean directed distance M, Eq. 3, from a perfect surface to its own scan.

    density: points per unit of area, scattered at random (a planar Poisson process). The j-th nearest of
    them is at gamma(j + 1/2) / gamma(j) / sqrt(pi density) in the mean; over j = 1 to k that averages to
    2/3 gamma(k + 3/2) / gamma(k + 1) / sqrt(pi density), for k = 1 to 0.5 / sqrt(density).
    Raises ValueError unless density is finite and above 0 and k >= 1.
    """
    if not 0.0 < density < math.inf:
        raise ValueError(f"expected a density above 0, in points per unit of area, got {density}")
    if k < 1:
        raise ValueError(f"expected k >= 1 nearest points, got {k}")
    return 2.0 / 3.0 * math.exp(math.lgamma(k + 1.5) - math.lgamma(k + 1.0)) / math.sqrt(math.pi * density)


def _grid(points: PointSet) -> Grid:
    return (
        points
        if isinstance(points, Grid)
        else build_grid(points.points if isinstance(points, HasPoints) else points)
    )


def _largest(source: Grid, target: Grid) -> float:
    return float(nearest_distances(target, source.points).max())
