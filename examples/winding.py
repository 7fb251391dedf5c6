"""A made-up scan with a known answer: a ridge along any smooth path on the plane z = 0."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ridgefeature.section import bell

Array = NDArray[np.float64]
Profile = Callable[[Array], Array]


@dataclass(frozen=True)
class Winding:
    """A ridge along `path`, with a height and a width at every arc length; both ends are round."""

    path: Array
    """(m, 2) points close together along the path."""
    height: Profile
    width: Profile
    arc_length: Array = field(init=False)
    """(m,) arc length at the points of the path."""

    def __post_init__(self) -> None:
        steps = np.linalg.norm(np.diff(self.path, axis=0), axis=1)
        object.__setattr__(self, "arc_length", np.concatenate([[0.0], np.cumsum(steps)]))

    def locate(self, xy: Array) -> tuple[Array, Array]:
        """Arc length and distance from the path of points (n, 2)."""
        _, i = cKDTree(self.path).query(xy)
        tangent = np.gradient(self.path, self.arc_length, axis=0)[i]
        along = ((xy - self.path[i]) * tangent).sum(axis=1)
        s = np.clip(self.arc_length[i] + along, 0.0, self.arc_length[-1])
        inside = s == self.arc_length[i] + along
        aside = xy - self.path[i]
        across = np.abs(tangent[..., 0] * aside[..., 1] - tangent[..., 1] * aside[..., 0])
        return s, np.where(inside, across, np.linalg.norm(xy - self.path[i], axis=1))

    def points(self, n: int, region: float, noise: float, seed: int = 0) -> Array:
        """n unordered points (n, 3), uniform at random over a square of side `region` about the origin."""
        random = np.random.default_rng(seed)
        xy = random.uniform(-region / 2, region / 2, (n, 2))
        s, distance = self.locate(xy)
        z = self.height(s) * bell()(distance / self.width(s))
        return np.column_stack([xy, z]) + random.normal(0.0, noise, (n, 3))
