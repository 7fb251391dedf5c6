"""The five cross-sections of the reference ridges: height by y / width, 1 at most and 0 at both feet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ridgefeature.section import bell, dome, plateau

Array = NDArray[np.float64]
LEAN = 0.12
"""How far the apex of the asymmetric section lies off the middle between the feet, in widths."""
FLANK = 0.12
"""Breadth of each flank of the steep section, in widths: at h / w = 2 it is 88 degrees steep."""
CROWN = 0.15
"""How much lower the steep section's top would be at the feet than at the apex."""
TOP = 0.95
"""The apex is the middle of the stretch that is at least so high: defined for flat tops too."""


@dataclass(frozen=True)
class Profile:
    """A section with a name; `f` maps eta = y / width (any shape) to height over the apex height."""

    name: str
    f: Callable[[Array], Array]

    def __call__(self, eta: ArrayLike) -> Array:
        eta = np.asarray(eta, dtype=np.float64)
        return np.where(np.abs(eta) < 0.5, self.f(np.clip(eta, -0.5, 0.5)), 0.0)

    @cached_property
    def half_height_width(self) -> float:
        """Full width at half height as a part of the width."""
        low, high = level_crossings(self, 0.5)
        return high - low

    @cached_property
    def apex(self) -> float:
        """Where the apex is, in widths to the left of the middle between the feet."""
        return sum(level_crossings(self, TOP)) / 2


def level_crossings(section: Callable[[Array], Array], level: float) -> tuple[float, float]:
    """The lowest and the highest eta at which a section, 1 at most, is `level`, by bisection."""
    eta = np.linspace(-0.5, 0.5, 4001)
    high = np.flatnonzero(np.asarray(section(eta)) >= level)
    ends = []
    for inner, outer in (
        (eta[high[0]], eta[max(high[0] - 1, 0)]),
        (eta[high[-1]], eta[min(high[-1] + 1, 4000)]),
    ):
        for _ in range(45):
            middle = 0.5 * (inner + outer)
            above = float(section(np.array(middle))) >= level
            inner, outer = (middle, outer) if above else (inner, middle)
        ends.append(float(inner))
    return ends[0], ends[1]


def _asymmetric(eta: Array) -> Array:
    x = np.where(eta < LEAN, (eta - LEAN) / (0.5 + LEAN), (eta - LEAN) / (0.5 - LEAN))
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * x))


def _steep(eta: Array) -> Array:
    x = np.clip((0.5 - np.abs(eta)) / FLANK, 0.0, 1.0)
    return np.asarray(x**3 * (10 - 15 * x + 6 * x * x) * (1 - CROWN * 4 * eta * eta))


def _of(section: Callable[[ArrayLike], Array]) -> Callable[[Array], Array]:
    return lambda eta: section(eta)


PROFILES: dict[str, Profile] = {
    "bell": Profile("bell", _of(bell())),
    "round": Profile("round", _of(dome())),
    "flat-topped": Profile("flat-topped", _of(plateau())),
    "asymmetric": Profile("asymmetric", _asymmetric),
    "steep": Profile("steep", _steep),
}
