"""The place on a ridge that is pointed at: marked on the view and on the curves, with the section there."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ridgefeature.curvilinear import local_coordinates
from ridgefeature.ridge import Ridge
from ridgefeature.viewer import curves
from ridgefeature.viewer.scene import Scene
from ridgefeature.viewer.session import Feature

Array = NDArray[np.float64]
_SLICE = 0.12
"""Half the thickness, in widths, of what is shown of the scan on a section."""
_MOST_FAR = 1.5
"""How far from a spine, in the farthest border, scan points are looked at for its sections."""


class Pointing:
    """What is pointed at on one page, where a ridge is chosen."""

    def __init__(self, tell: Any, scene: Scene) -> None:
        self.tell, self.scene = tell, scene
        self._near: WeakKeyDictionary[Ridge, tuple[Array, Array, Array]] = WeakKeyDictionary()

    def clear(self) -> None:
        """Forget the scan."""
        self._near.clear()

    def hover(self, feature: Feature | None, across: float, down: float) -> None:
        """The cursor is on the view: what a click would pick is marked there, and on the curves."""
        if self.tell.pasting or not len(self.scene.still):
            return
        place = self.scene.pick(across, down, coarsely=True)
        self.scene.mark(place, "hover", 9.0)
        if place is not None and feature is not None and feature.shown:
            s, y, _ = (float(x[0]) for x in local_coordinates(feature.ridge, place[None]))
            if 0.0 <= s <= feature.ridge.length and abs(y) < np.interp(
                s, feature.ridge.arc_length, feature.ridge.width
            ):
                self.show(feature, s)

    def away(self) -> None:
        """The cursor has left the view."""
        self.scene.mark(None, "hover")

    def point(self, feature: Feature, part: float) -> None:
        """The cursor is over the curves, at a part of their width: the place is marked on the ridge."""
        s = curves.place_of(part, feature.ridge.length)
        if s is not None:
            self.show(feature, s)

    def step(self, feature: Feature, way: int) -> None:
        """One station further, or back."""
        at = feature.ridge.arc_length
        k = int(np.clip(np.searchsorted(at, self.place(feature) - 1e-9) + way, 0, len(at) - 1))
        self.show(feature, float(at[k]))

    def place(self, feature: Feature) -> float:
        """The arc length that is pointed at; the middle, if none is."""
        length = feature.ridge.length
        s = curves.place_of(self.tell.place, length) if self.tell.place >= 0 else None
        return 0.5 * length if s is None else s

    def show(self, feature: Feature, s: float) -> None:
        """Mark an arc length of a ridge."""
        ridge = feature.ridge
        self.tell.place = curves.part_of(s, ridge.length)
        at = [np.interp(s, ridge.arc_length, ridge.spine[:, k]) for k in range(3)]
        up = [np.interp(s, ridge.arc_length, ridge.normal[:, k]) for k in range(3)]
        top = np.array(at) + float(np.interp(s, ridge.arc_length, ridge.height)) * np.array(up)
        self.scene.mark(top if feature.shown else None, "place", 13.0)
        where, y, z = self.points_near(feature.registered)
        slab = np.abs(where - s) < _SLICE * float(np.median(ridge.width))
        self.tell.section = curves.section(ridge, feature.registered, s, y[slab], z[slab])

    def points_near(self, ridge: Ridge) -> tuple[Array, Array, Array]:
        """Scan points beside a ridge, in its coordinates (s, y, z)."""
        if ridge not in self._near:
            points = self.scene.still
            far = _MOST_FAR * float(ridge.border.max())
            low, high = ridge.spine.min(axis=0) - far, ridge.spine.max(axis=0) + far
            points = points[((points >= low) & (points <= high)).all(axis=1)]
            s, y, z = local_coordinates(ridge, points)
            near = np.abs(y) < far
            self._near[ridge] = s[near], y[near], z[near]
        return self._near[ridge]
