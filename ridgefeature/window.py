"""What a fit sees of the scan: the points of one template's window, thinned where they are very dense."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ridgefeature.grid import Grid, nearest_distances, points_in_ball, points_in_box
from ridgefeature.kernels.base import flattened
from ridgefeature.kernels.region import covering, select, thin
from ridgefeature.template import Template

Array = NDArray[np.float64]
_Box = tuple[Array, Array, float, float, float, float]
_MARGIN = 0.2
"""How much wider than asked a look-up is, in half breadths: windows may then turn and shift a little."""
_LARGEST = 3.0
"""How many times the area that is asked a region may have."""
_MOST_REGIONS = 256


def _bins(half: Array, most: int) -> tuple[int, int]:
    """About half as many bins as `most`, nearly square, over a box of these half sizes."""
    ratio = half[0] / half[1]
    return max(round((0.5 * most * ratio) ** 0.5), 1), max(round((0.5 * most / ratio) ** 0.5), 1)


@dataclass(eq=False)
class _Regions:
    """What was looked up: boxes, and the points in them in their own frames."""

    boxes: Array = field(default_factory=lambda: np.empty((_MOST_REGIONS, 15)))
    """(m, 15) each: origin (3,), axes as columns (3, 3) by rows, half sizes (3,)."""
    points: list[Array] = field(default_factory=list)

    def add(self, box: Array, points: Array) -> tuple[Array, Array]:
        """The same box and points, held; the older half is dropped when there are too many."""
        if len(self.points) == len(self.boxes):
            dropped = len(self.boxes) // 2
            self.boxes[:-dropped] = self.boxes[dropped:].copy()
            del self.points[:dropped]
        self.boxes[len(self.points)] = box
        self.points.append(points)
        return box, points


@dataclass(eq=False)
class Window:
    """Points around a template, from the grid index; requests near one another share a look-up."""

    grid: Grid
    spacing: float
    most: int = 3000
    """Look-ups that hold more are thinned to the points nearest to the centres of about half as many bins."""
    source: Window | None = None
    """Window whose look-ups are thinned, instead of looking up."""
    _regions: _Regions = field(default_factory=_Regions, init=False)
    _last: tuple[_Box | None, Array] = field(default=(None, np.empty((0, 3))), init=False)

    def thinned(self, most: int) -> Window:
        """A window of fewer points, which shares this one's look-ups."""
        return Window(self.grid, self.spacing, most, self)

    def __call__(self, template: Template, before: float = 1.0, after: float = 1.0) -> Array:
        """Points (m, 3) in the template's frame, flattened where its base is known to be curved.

        The window covers the patch, flanks included, up to twice the height and a quarter of the width above
        and below the base. `before` and `after` stretch its halves along the ridge.
        """
        half_y = template.half_breadth
        half_z = 2.0 * abs(template.height) + 0.25 * template.width
        low, high = -0.5 * template.length * before, 0.5 * template.length * after
        if template.curved:
            return self._flattened(template, low, high, half_y, half_z)
        return self._inside((template.position, template.rotation, low, high, half_y, half_z))

    def _flattened(self, template: Template, low: float, high: float, half_y: float, half_z: float) -> Array:
        """The points of the window over a curved base, which is as large within the base."""
        xx, xy, yy = np.abs(template.base)
        far = max(-low, high)
        # A point above the base leans outwards where the base falls, and away from where it rises.
        stretch = 1.0 + half_z * (max(xx, yy) + xy)
        sag = 0.5 * xx * far**2 + xy * far * half_y + 0.5 * yy * half_y**2
        box = (low * stretch, high * stretch, half_y * stretch, 1.2 * sag + half_z)
        points = flattened(self._inside((template.position, template.rotation, *box)), template.base)
        x, y, z = points.T
        return points[(x >= low) & (x <= high) & (np.abs(y) <= half_y) & (np.abs(z) <= half_z)]

    def _inside(self, window: _Box) -> Array:
        """Points (m, 3) of a box, in its frame."""
        last, found = self._last
        if last is None or last[0] is not window[0] or last[1] is not window[1] or last[2:] != window[2:]:
            box, points = self._region(window)
            found = select(points, box, *window)
            self._last = window, found
        return found

    def _region(self, window: _Box) -> tuple[Array, Array]:
        """Box and points of a region that covers the window."""
        regions = self._regions
        n = covering(regions.boxes, len(regions.points), *window, _LARGEST)
        if n >= 0:
            return regions.boxes[n], regions.points[n]
        if self.source is None:
            return regions.add(*self._look_up(*window))
        box, points = self.source._region(window)
        if len(points) > self.most:
            points = thin(points, box[12], box[13], *_bins(box[12:], self.most))
        return regions.add(box, points)

    def _look_up(
        self, position: Array, rotation: Array, low: float, high: float, half_y: float, half_z: float
    ) -> tuple[Array, Array]:
        """Box and points of a region that a window lies well inside of."""
        centre = position + 0.5 * (low + high) * rotation[:, 0]
        half = np.array([0.5 * (high - low), half_y, half_z])
        half = (1.0 + 0.5 * _MARGIN) * half + _MARGIN * half_y
        expected = 4 * half[0] * half[1] * (0.5 / max(self.spacing, 1e-300)) ** 2
        cells = _bins(half, self.most) if expected > self.most else None
        points = points_in_box(self.grid, centre, rotation.T, half, cells, check=False)
        return np.concatenate([centre, rotation.ravel(), half]), points

    def around(self, centre: Array, radius: float, frame: Array, most: int = 400) -> Array:
        """Points (m, 3) relative to centre within the radius, about `most` of them, spread evenly.

        frame (3, 3): columns are two tangents and the normal; thinning is by bins along the tangents.
        """
        if np.pi * radius**2 * (0.5 / max(self.spacing, 1e-300)) ** 2 < 2 * most:
            return points_in_ball(self.grid, centre, radius) - centre
        bins = max(int(np.sqrt(most * 4 / np.pi)), 2)
        local = points_in_box(self.grid, centre, frame.T, np.full(3, radius), (bins, bins))
        local = local[(local * local).sum(axis=1) <= radius * radius]
        return local @ frame.T

    def mean_distance(self, points: Array, k: int) -> float:
        """Mean distance of points (m, 3) to their k nearest scan points (Eq. 3)."""
        return float(nearest_distances(self.grid, points, k).mean())
