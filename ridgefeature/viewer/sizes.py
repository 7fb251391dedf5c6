"""Height and width of the ridge that is chosen on the page, all along or in a stretch."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from ridgefeature.fitting import room_for_width
from ridgefeature.readable import reason
from ridgefeature.viewer import curves
from ridgefeature.viewer.session import LEAST, MOST, Feature

if TYPE_CHECKING:
    from ridgefeature.viewer.page import Page

Array = NDArray[np.float64]
_ROUNDED = 1e-3
"""Relative difference of a value from a limit as it was told, rounded."""
FIELDS = ("h", "w", "height", "width")
"""What of it is changed there."""


class Sizes:
    """What sliders and fields of a page do. fields: what the page was told that they are."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.fields: dict[str, Any] = {}

    def tell(self, feature: Feature) -> None:
        """Tell the page what its sliders and fields are."""
        height, width = (_largest(x, feature) for x in (feature.ridge.height, feature.ridge.width))
        told = _short(feature.h), _short(feature.w), f"{height:.5g}", f"{width:.5g}"
        self.fields = dict(zip(FIELDS, told, strict=True))
        tell = self.page.tell
        tell.h, tell.w, tell.height, tell.width = told
        tell.most_w = _reach(feature, "w")[1]

    def slide(self, rate: str, value: float) -> None:
        """Another rate, "h" or "w", for the chosen ridge or its stretch; a slider's steps are one undo.

        Raises ValueError where it is out of reach, or of room; nothing is changed then.
        """
        if self.page.session.chosen is not None and rate in ("h", "w"):
            name = self.page.session.chosen
            self.page.history.do(self.page.session.changed(name, **{rate: value}), f"{rate} of {name}")
            if not self.page.tell.pasting:
                self.page.scene.coarse(True)
            self.page.refresh()

    def absolute(self, what: str, value: float) -> None:
        """Another largest "height" or "width" of the chosen ridge, or its stretch, in the scan's unit."""
        feature = self.page.feature
        if feature is None or what not in ("height", "width"):
            return
        rate, limits = what[0], _reach(feature, what[0])

        def largest(to: float) -> float:
            changed = feature.begun.resized(**{rate: to}, between=feature.between)
            return _largest(getattr(changed, what), feature)

        low, high = sorted(map(largest, limits))
        if low == high:
            return
        if not low - _ROUNDED * abs(low) <= value <= high + _ROUNDED * abs(high):
            got = "no number" if np.isnan(value) else f"{value:g}"
            raise ValueError(f"{what}: expected {low:.4g} to {high:.4g} {self.page.tell.unit}, got {got}")
        if low < value < high:
            self.slide(rate, float(brentq(lambda to: largest(to) - value, *limits, xtol=1e-12)))
        else:
            self.slide(rate, min(limits, key=lambda limit: abs(largest(limit) - value)))

    def edited(self, told: dict[str, Any]) -> bool:
        """Fields of the page, FIELDS, as they are now; whether one was changed there: the first counts."""
        changed = next((name for name in FIELDS if told[name] != self.fields.get(name)), None)
        if changed is None or self.page.feature is None:
            return False
        value = told[changed]
        try:
            wanted = float(value)
        except (TypeError, ValueError):
            wanted = float("nan")
        try:
            if changed in ("h", "w"):
                self.slide(changed, wanted)
            else:
                self.absolute(changed, wanted)
        except ValueError as error:
            self.page.say(reason(error), bad=True)
            self.page.refresh()
        else:
            self.page.right()
        return True

    def reset(self) -> None:
        """The chosen ridge as it was registered."""
        if self.page.session.chosen is not None:
            self.page.do(
                self.page.session.changed(self.page.session.chosen, h=1.0, w=1.0, between=None, before=None)
            )

    def stretch(self, first: float, last: float) -> None:
        """The rates hold between two places of the curves, in parts of their width; all along if alike."""
        feature = self.page.feature
        if feature is None:
            return
        length = feature.registered.length
        places = [curves.place_of(x, length) for x in sorted((first, last))]
        low, high = (x if x is not None else e for x, e in zip(places, (0.0, length), strict=True))
        try:
            feature.ridge.resized(h=1.01, between=(low, high))
        except ValueError:
            self.page.say("This stretch is too short to be changed; drag further over the curves.", bad=True)
            return
        self.page.do(self.page.session.along(feature.name, (low, high)))

    def bound(self, which: int) -> None:
        """The rates hold from, 0, or up to, 1, the place that is pointed at."""
        feature = self.page.feature
        if feature is not None and which in (0, 1):
            length = feature.registered.length
            ends = list(feature.between or (0.0, length))
            ends[which] = self.page.pointing.place(feature)
            if ends[0] >= ends[1]:
                ends[1 - which] = (0.0, length)[1 - which]
            self.stretch(*(curves.part_of(s, length) for s in ends))

    def whole(self) -> None:
        """The rates hold along the whole ridge."""
        if self.page.session.chosen is not None:
            self.page.do(self.page.session.along(self.page.session.chosen, None))


def _short(rate: float) -> float:
    """As fields show it."""
    return float(f"{rate:.4g}")


def _reach(feature: Feature, rate: str) -> tuple[float, float]:
    """The least and the largest rate that there is room for, "h" or "w", of hundredths."""
    if rate == "h":
        return LEAST, MOST
    begun, low, high = feature.begun, *(feature.between or (-np.inf, np.inf))
    inside = (begun.arc_length >= low) & (begun.arc_length <= high)
    room = float(room_for_width(begun)[inside].min())
    return LEAST, float(np.clip(np.floor(100.0 * room * (1 - 1e-9)) / 100.0, 1.0, MOST))


def _largest(values: Array, feature: Feature) -> float:
    """The value that is farthest from 0 where the ridge's rates hold."""
    at = feature.registered.arc_length
    low, high = feature.between or (0.0, float(at[-1]))
    inside = values[(at >= low) & (at <= high)]
    return float(inside[np.argmax(np.abs(inside))])
