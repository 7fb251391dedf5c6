"""Surfaces that several tests share, and a stand-in for a Ridge."""

from __future__ import annotations

import dataclasses

import numpy as np

from ridgefeature.bspline import Surface, clamped_knots, greville, interpolate


def ridge_surface(
    height: float = 1.5,
    width: float = 2.0,
    turn: float = 1.0,
    slope: float = 2.0,
    bend: float = 0.01,
    rows: int = 18,
) -> Surface:
    """A bell on a base that climbs with `slope` and bends with `bend` along an arc of radius 40."""
    knots_u, knots_v = (
        clamped_knots(np.linspace(0.0, turn, rows), 3),
        clamped_knots(np.linspace(-6.0, 6.0, 11), 3),
    )
    a, y = greville(knots_u, 3)[:, None], greville(knots_v, 3)[None, :]
    z = slope * a**2 - bend * y**2 + height * np.exp(-((y / width) ** 2))
    values = np.stack([(40.0 - y) * np.sin(a), 40.0 - (40.0 - y) * np.cos(a), z], axis=-1)
    across = interpolate(knots_u, 3, values).swapaxes(0, 1)
    return Surface(interpolate(knots_v, 3, across).swapaxes(0, 1), knots_u, knots_v, 3, 3)


def ring() -> Surface:
    surface = ridge_surface(turn=2 * np.pi, slope=0.0, rows=40)
    poles = surface.poles.copy()
    poles[-1] = poles[0]
    return dataclasses.replace(surface, poles=poles)


@dataclasses.dataclass(frozen=True)
class FakeRidge:
    """As much of a Ridge as the exports use."""

    h: float = 1.0
    w: float = 1.0
    unit: str = "mm"

    def resized(self, *, h: float, w: float) -> FakeRidge:
        return dataclasses.replace(self, h=self.h * h, w=self.w * w)

    def surface(self) -> Surface:
        return ridge_surface(1.5 * self.h, 2.0 * self.w)


def same(a: Surface, b: Surface, digits: float = 1e-9) -> None:
    size = np.abs(b.poles).max()
    np.testing.assert_allclose(a.poles, b.poles, rtol=0, atol=digits * size)
    np.testing.assert_allclose(a.knots_u, b.knots_u, atol=1e-9)
    np.testing.assert_allclose(a.knots_v, b.knots_v, atol=1e-9)
    assert (a.degree_u, a.degree_v) == (b.degree_u, b.degree_v)


def patch() -> Surface:
    line = [0.0, 0.0, 1.0, 1.0]
    return Surface(np.array([[[0, 0, 0], [0, 8, 0]], [[10, 0, 0], [10, 8, 0]]]), line, line, 1, 1)


def bell(origin: float = 0.0, turn: float = 1.0) -> Surface:
    """The same ridge with poles away from the origin."""
    surface = ridge_surface(turn=turn, rows=20)
    return dataclasses.replace(surface, poles=surface.poles + origin)


def inner(rng: np.random.Generator, surface: Surface, n: int) -> tuple[np.ndarray, np.ndarray]:
    (u0, u1), (v0, v1) = surface.domain
    return rng.uniform(u0, u1, n), rng.uniform(v0, v1, n)
