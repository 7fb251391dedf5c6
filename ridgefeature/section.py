"""The cross-section of a ridge: height over the base by y / width, 1 at the apex and 0 at both feet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Uniform cubic B-spline on one span, as coefficients of 1, x, x^2, x^3; one row for each of the four poles.
_UNIFORM_CUBIC = np.array([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]) / 6.0


_ON_TOP = 0.8
"""Height from which on a section is its top."""
REACH = 4
"""Raised control points on either side of the apex's, in sections fitted to a shape or to points."""


@dataclass(frozen=True, eq=False)
class Section:
    """A cubic B-spline section on uniform knots from foot to foot.

    coefficients: (m,) heights of the raised control points; m + 3 equal spans make the width, so value, slope
    and curvature are zero at both feet. They are scaled so that the apex is 1. Raises ValueError unless they
    are finite and one is positive.
    """

    coefficients: Array
    name: str = "custom"
    table: Array = field(init=False, repr=False)
    """(m + 5, 4) coefficients of 1, x, x^2, x^3 by span, x in [0, 1); a row of zeros before and after."""

    def __post_init__(self) -> None:
        raised = np.array(self.coefficients, dtype=np.float64)
        if raised.ndim != 1 or raised.size == 0 or not np.isfinite(raised).all() or raised.max() <= 0:
            raise ValueError(
                f"section coefficients: expected one or more finite numbers, one of them positive, "
                f"got {self.coefficients!r}"
            )
        raised = raised / _largest(_table(raised))
        raised.setflags(write=False)
        table = _table(raised)
        table.setflags(write=False)
        object.__setattr__(self, "coefficients", raised)
        object.__setattr__(self, "table", table)

    def __call__(self, eta: ArrayLike, derivative: int = 0) -> Array:
        """Height at eta = y / width, or its derivative with respect to eta; 0 beyond the feet. Any shape."""
        eta = np.asarray(eta, dtype=np.float64)
        spans = self.spans
        position = (eta + 0.5) * spans
        span = np.clip(np.floor(position) + 1, 0, spans + 1).astype(np.intp)
        x = position + 1 - span
        rows = self.table[span]
        for _ in range(derivative):
            rows = rows[..., 1:] * np.arange(1, rows.shape[-1])
        value = sum(rows[..., k] * x**k for k in range(rows.shape[-1])) * float(spans) ** derivative
        return np.where((position >= 0) & (position < spans), value, 0.0)

    @property
    def spans(self) -> int:
        """Knot spans from foot to foot."""
        return len(self.table) - 2

    @cached_property
    def symmetric(self) -> bool:
        """Whether both of its flanks are alike to the last bit."""
        return bool((self.coefficients == self.coefficients[::-1]).all())

    @cached_property
    def half_height_width(self) -> float:
        """Full width at half height as a part of the width between the feet."""
        low, high = self.half_height_places
        return high - low

    @cached_property
    def half_height_places(self) -> tuple[float, float]:
        """The lowest and the highest place at half height, in widths from the middle between the feet."""
        eta = np.linspace(-0.5, 0.5, 2001)
        above = eta[self(eta) >= 0.5]
        return self._crossing(float(above[0])), self._crossing(float(above[-1]))

    @cached_property
    def top(self) -> tuple[float, float]:
        """The places, in widths from the middle between the feet, between which it is higher than 0.8."""
        eta = np.linspace(-0.5, 0.5, 2001)
        above = eta[self(eta) > _ON_TOP]
        return float(above[0]), float(above[-1])

    def _crossing(self, eta: float) -> float:
        """Where the height is one half, by Newton's method from eta near by."""
        for _ in range(5):
            eta -= float((self(eta) - 0.5) / self(eta, 1))
        return eta


def _table(raised: Array) -> Array:
    """Coefficients (m + 5, 4) of the spans of raised control points (m,)."""
    padded = np.concatenate([np.zeros(3), raised, np.zeros(3)])
    return np.array(
        [[0.0] * 4, *(padded[i : i + 4] @ _UNIFORM_CUBIC for i in range(raised.size + 3)), [0.0] * 4]
    )


def _largest(table: Array) -> float:
    """The largest height: at a knot, or where the slope of a span's cubic is zero."""
    best = float(table[:, 0].max())
    for a, b, c, d in table:
        for t in np.roots(np.trim_zeros(np.array([3 * d, 2 * c, b]), "f")) if (b or c or d) else ():
            if abs(t.imag) < 1e-6 and 0 < t.real < 1:
                best = max(best, float(a + t.real * (b + t.real * (c + t.real * d))))
    return best


@lru_cache(maxsize=1)
def bell() -> Section:
    """One raised control point on four spans: the cubic B-spline basis function."""
    return Section(np.array([1.0]), "bell")


@lru_cache(maxsize=1)
def plateau() -> Section:
    """Three control points raised alike on six spans: its width at half height is half the width."""
    return Section(np.ones(3), "plateau")


@lru_cache(maxsize=1)
def box() -> Section:
    """Control points raised alike on twenty spans: flanks as steep as a whole fit begins with."""
    return Section(np.ones(17), "box")


@lru_cache(maxsize=1)
def cosine() -> Section:
    """About (1 + cos(2 pi eta)) / 2: nine raised control points on twelve spans."""
    return _fitted(lambda eta: 0.5 + 0.5 * np.cos(2 * np.pi * eta), "cosine")


@lru_cache(maxsize=1)
def dome() -> Section:
    """About the parabola 1 - 4 eta^2, rounded at the feet: nine raised control points on twelve spans."""
    return _fitted(lambda eta: 1 - 4 * eta * eta, "dome")


def _fitted(shape: Callable[[Array], Array], name: str) -> Section:
    """The section of nine raised control points nearest to a symmetric shape in the mean square."""
    eta = np.linspace(-0.5, 0.5, 201)
    columns = np.stack([uniform_basis(eta, k) for k in range(-REACH, REACH + 1)], axis=1)
    raised = np.asarray(np.linalg.lstsq(columns, shape(eta), rcond=None)[0], dtype=np.float64)
    return Section(0.5 * (raised + raised[::-1]), name)


def uniform_basis(eta: Array, k: int) -> Array:
    """Uniform cubic B-spline centred k knots from the apex, on a section of twelve spans."""
    x = np.abs(2 * (REACH + 2) * eta - k)
    return np.where(x < 1, 2 / 3 - x * x + 0.5 * x**3, np.maximum(2 - x, 0.0) ** 3 / 6)


SECTIONS: dict[str, Callable[[], Section]] = {
    "bell": bell,
    "cosine": cosine,
    "plateau": plateau,
    "dome": dome,
}
"""The sections that have a name."""
