"""A straight ridge patch T(p) with 8 degrees of freedom, as a cubic B-spline patch with flat flanks."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import rotation_of
from ridgefeature.kernels.base import seen_from, standing
from ridgefeature.section import Section

Array = NDArray[np.float64]

STEEP = 0.4
"""Height, in widths, from which on flanks are steep: a fit must begin near them."""


@dataclass(frozen=True, eq=False)
class Template:
    """One straight ridge patch, and what its fit said.

    Frame of the scan. `position` (3,) is the centre of the patch on the base, under the apex; the columns of
    `rotation` (3, 3) are its axes: along the ridge, across, and up. `width` is the distance between the two
    feet, where the section meets the base with zero slope; `height` is the apex over the base. The full width
    at half height is width * section.half_height_width. `flank` is the breadth of the flat strip outside each
    foot and `length` the extent along the ridge.
    """

    position: Array
    rotation: Array
    width: float
    height: float
    length: float
    flank: float
    section: Section
    trend: Array = field(default_factory=lambda: np.zeros(3))
    """(3,) curvature of the path, slopes of height and width along it: from the neighbours, not fitted."""
    base: Array = field(default_factory=lambda: np.zeros(3))
    """(3,) curvature of the base along the ridge, its twist, and its curvature across: found with its
    neighbours, not fitted; zeros unless the data tell them. Positive where the base rises to both sides."""
    base_std: Array = field(default_factory=lambda: np.zeros(3))
    """(3,) one standard deviation of these, 0 where they are zeros."""
    std: Array | None = None
    """(8,) one standard deviation: translation (along: 0) and rotation in its own frame, height, width."""
    scale: float = 0.0
    """Robust standard deviation of the residuals."""
    evidence: float = 0.0
    """Twice the log likelihood ratio of ridge against no ridge."""
    points: int = 0
    inliers: int = 0
    evaluations: int = 0
    status: str = "start"
    M: float = np.nan
    """Mean directed distance from the patch to the scan (Eq. 3)."""
    M_floor: float = np.nan
    """What M would be for a perfect patch, from the density of the points alone."""

    def changed(self, **values: object) -> Template:
        """The template with other values, as `dataclasses.replace` gives it, at a tenth of its cost."""
        new = object.__new__(Template)
        held = new.__dict__
        held.update(self.__dict__)
        fields = len(held)
        held.update(values)
        if len(held) != fields:
            unknown = ", ".join(sorted(values.keys() - self.__dict__.keys()))
            raise TypeError(f"Template: expected names of its fields, got {unknown}; see help(Template)")
        return new

    @property
    def curved(self) -> bool:
        """Whether its base is known to be."""
        return any(self.base.tolist())

    @property
    def start(self) -> Array:
        """(3,) middle of the first row."""
        return self.position - 0.5 * self.length * self.rotation[:, 0]

    @property
    def end(self) -> Array:
        """(3,) middle of the last row."""
        return self.position + 0.5 * self.length * self.rotation[:, 0]

    @property
    def shape(self) -> tuple[float, float, Array, Array]:
        """Height, width, trend and section table: what the kernels take to know the surface in its frame."""
        return self.height, self.width, self.trend, self.section.table

    @property
    def half_breadth(self) -> float:
        """Distance from the spine to the outer border of a flank."""
        return 0.5 * self.width + self.flank

    @property
    def apex(self) -> Array:
        """(3,) point of the crest over the centre."""
        return self.position + self.height * self.rotation[:, 2]

    def slid(self, x: float) -> Template:
        """The patch moved by x along its own bent path, its height and width as their slopes say.

        Slopes are known nearby only: height and width change by no more than a half.
        """
        bend, rise, widening = self.trend
        turn, _ = rotation_of(np.array([0.0, 0.0, bend * x]))
        shift = np.array([x, 0.5 * bend * x**2, 0.0])
        base = self.base
        if base.any():
            base = seen_from(base, turn)
            shift, turn = standing(shift, turn, self.base)
        rate_h = 1.0 if not self.height else 1.0 + min(max(rise * x / self.height, -0.5), 0.5)
        rate_w = 1.0 + min(max(widening * x / self.width, -0.5), 0.5)
        return self.changed(
            position=self.position + self.rotation @ shift,
            rotation=self.rotation @ turn,
            height=float(self.height * rate_h),
            width=float(self.width * rate_w),
            base=base,
        )
