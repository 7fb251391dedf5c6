"""What a fit sees of the scan: the points of one template's window, thinned where they are very dense."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ridgefeature.grid import Grid, nearest_distances, points_in_ball, points_in_box
from ridgefeature.kernels.algebra import select
from ridgefeature.template import Template

Array = NDArray[np.float64]


@dataclass(eq=False)
class Window:
    """Points around a template, from the grid index; neighbouring requests share one look-up."""

    grid: Grid
    spacing: float
    most: int = 3000
    """Windows that hold more are thinned to the points nearest to the centres of about half as many bins."""
    margin: float = 0.15
    """How much wider than asked a look-up is, in half breadths: windows may then turn and shift a little."""
    _held: tuple[Array, Array, Array] | None = field(default=None, init=False)
    _points: Array = field(default_factory=lambda: np.empty((0, 3)), init=False)

    def __call__(self, template: Template, before: float = 1.0, after: float = 1.0) -> Array:
        """Points (m, 3) in the template's frame.

        The window covers the patch, flanks included, up to twice the height and a quarter of the width above
        and below the base. `before` and `after` stretch its halves along the ridge.
        """
        half_y = template.half_breadth
        half_z = 2.0 * abs(template.height) + 0.25 * template.width
        low, high = -0.5 * template.length * before, 0.5 * template.length * after
        box = (template.position, template.rotation, low, high, half_y, half_z)
        # What is held serves only while it is not far larger than what is asked.
        if self._held is not None and 0.3 * self._held[2][1] < half_y:
            found, covered = select(self._points, *self._held, *box)
            if covered:
                return found
        centre = template.position + 0.5 * (low + high) * template.rotation[:, 0]
        half = np.array([0.5 * (high - low), half_y, half_z])
        half = (1.0 + 0.5 * self.margin) * half + self.margin * half_y
        self._look_up(centre, template.rotation, half)
        return select(self._points, centre, template.rotation, half, *box)[0]

    def _look_up(self, centre: Array, rotation: Array, half: Array) -> None:
        expected = 4 * half[0] * half[1] * (0.5 / max(self.spacing, 1e-300)) ** 2
        cells = None
        if expected > self.most:
            ratio = half[0] / half[1]
            cells = (
                max(round(np.sqrt(0.5 * self.most * ratio)), 1),
                max(round(np.sqrt(0.5 * self.most / ratio)), 1),
            )
        self._points = points_in_box(self.grid, centre, rotation.T, half, cells, check=False)
        self._held = (centre, rotation, half)

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
