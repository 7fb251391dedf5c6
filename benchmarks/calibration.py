"""How good heights, widths and their standard deviations are, on noisy spirals with known answers.

    python benchmarks/calibration.py [--quick]

Deterministic: every scan is made from its own seed. --quick takes a tenth of the scans.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from report import Report, at_least, at_most, between
from scipy.spatial.transform import Rotation

import ridgefeature as rf
from ridgefeature.grid import build_grid, typical_spacing
from ridgefeature.synthetic import Spiral
from ridgefeature.window import Window

Array = NDArray[np.float64]
SPIRAL = Spiral()
NOISE = 0.1
PICK = (*SPIRAL.spine(np.array(30.0))[:2], SPIRAL.height(np.array(30.0)))


def residuals(template: rf.Template, points: Array, p: Array) -> Array:
    """Distances along the normal of points (n, 3), in the template's frame, after moves p.

    p (7,): shifts across and up, turns about x, y and z, changes of height and width. The path bends, and
    height and width change along it, as the template's trend says.
    """
    bend, climb, spread = template.trend
    height, width = template.height + p[5], template.width + p[6]
    x, y, z = Rotation.from_rotvec(p[2:5]).inv().apply(points - [0.0, p[0], p[1]]).T

    def surface(x: Array, y: Array) -> Array:
        return (height + climb * x) * template.section((y - 0.5 * bend * x * x) / (width + spread * x))

    step = 1e-5 * width
    along = (surface(x + step, y) - surface(x - step, y)) / (2 * step)
    across = (surface(x, y + step) - surface(x, y - step)) / (2 * step)
    return (z - surface(x, y)) / np.sqrt(1 + along**2 + across**2)


def cramer_rao(template: rf.Template, points: Array) -> tuple[float, float]:
    """The least standard deviations of height and width that an unbiased fit of these points can have.

    points (n, 3): in the template's frame; strays are left out. Noise is the same in all directions, so only
    its part along the surface's normal counts. A slide along the ridge is not observable, and left out.
    """
    step = 1e-5 * template.width
    near = points[np.abs(residuals(template, points, np.zeros(7))) < 5 * NOISE]
    jacobian = np.column_stack(
        [
            (residuals(template, near, step * unit) - residuals(template, near, -step * unit)) / (2 * step)
            for unit in np.eye(7)
        ]
    )
    bound = NOISE * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    return float(bound[5]), float(bound[6])


def noisy(n: int, noise: float, seed: int, outliers: float = 0.0) -> tuple[Array, rf.Ridge]:
    """A noisy scan of the spiral, and the ridge found in it."""
    points = SPIRAL.points(n, noise, outliers, seed)
    return points, rf.register(points, at=PICK)


def against_bound(outliers: float, seeds: range) -> tuple[float, float]:
    """Rms error of the templates' height and width in units of the Cramer-Rao bounds of their windows.

    The first and the last template are left out: they may be shorter than the ridge goes on.
    """
    errors = []
    for seed in seeds:
        points, ridge = noisy(40_000, NOISE, seed, outliers)
        grid = build_grid(points)
        window = Window(grid, typical_spacing(grid))
        for t in ridge.templates[1:-1]:
            s, _ = SPIRAL.path_coordinates(t.position[None, :2])
            error = t.height - SPIRAL.height(s)[0], t.width - SPIRAL.width(s)[0]
            errors.append(np.divide(error, cramer_rao(t, window(t))))
    height, width = np.sqrt(np.mean(np.square(errors), axis=0))
    return float(height), float(width)


def refit_against_bound(n: int, noise: float, outliers: float, seeds: range) -> tuple[float, float, int]:
    """Rms error of height and half-height width along whole ridges, in units of what points without any
    stray allow; and how many of the ridges were found over nine tenths of their length.

    The bound is the standard deviation that the same smooth model has from the same scan before some of its
    points are made strays. The last tenth at either end is left out; errors of more than ten bounds count as
    ten.
    """
    errors, whole = [], 0
    inner = np.linspace(0.1, 0.9, 81) * SPIRAL.arc_length
    half = SPIRAL.section.half_height_width * SPIRAL.width(inner)
    for seed in seeds:
        (_, clean), (_, ridge) = noisy(n, noise, seed), noisy(n, noise, seed, outliers)
        s, known = (SPIRAL.path_coordinates(r.spine[:, :2])[0] for r in (ridge, clean))
        on = (inner >= s.min()) & (inner <= s.max())
        whole += bool(on.mean() > 0.9)
        order, clean_order = np.argsort(s), np.argsort(known)
        for value, std, true in (
            (ridge.height, clean.height_std, SPIRAL.height(inner)),
            (ridge.half_height_width, clean.half_height_width_std, half),
        ):
            error = np.interp(inner, s[order], value[order]) - true
            errors.append((error / np.interp(inner, known[clean_order], std[clean_order]))[on])
    height, width = (
        float(np.sqrt(np.mean(np.minimum(np.concatenate(errors[k::2]) ** 2, 100.0)))) for k in (0, 1)
    )
    return height, width, whole


@dataclass(frozen=True)
class Stations:
    """What many noisy spirals gave."""

    height: Array
    """Errors of the height in standard deviations, at all stations that lie on the true path."""
    width: Array
    covered: Array
    """(m,) covered part of the true length, one for each scan."""
    ends: Array
    """(m, 2) distances of the ridge's ends from the true ends, in local widths."""


def stations(n: int, noise: float, seeds: range) -> Stations:
    """Errors at the stations, and how much was found."""
    total = SPIRAL.arc_length
    height, width, covered, ends = [], [], [], []
    for seed in seeds:
        _, ridge = noisy(n, noise, seed)
        s, _ = SPIRAL.path_coordinates(ridge.spine[:, :2])
        on = (s >= 0) & (s <= total)
        height.append(((ridge.height - SPIRAL.height(s)) / ridge.height_std)[on])
        width.append(((ridge.width - SPIRAL.width(s)) / ridge.width_std)[on])
        low, high = float(s.min()), float(s.max())
        covered.append((min(high, total) - max(low, 0.0)) / total)
        ends.append([abs(low) / SPIRAL.widths[0], abs(high - total) / SPIRAL.widths[1]])
    return Stations(np.concatenate(height), np.concatenate(width), np.array(covered), np.array(ends))


def false_alarms(n: int, noise: float, seeds: range) -> int:
    """On how many flat noisy planes a ridge is found."""
    found = 0
    for seed in seeds:
        random = np.random.default_rng(seed)
        points = np.column_stack([random.uniform(-50.0, 50.0, (n, 2)), np.zeros(n)])
        points += random.normal(0.0, noise, points.shape)
        try:
            rf.register(points, at=(*random.uniform(-40.0, 40.0, 2), 0.0), kind="auto")
            found += 1
        except rf.NoRidgeError:
            pass
    return found


def main() -> None:
    part = 10 if "--quick" in sys.argv else 1
    report = Report()
    for outliers, limit in ((0.0, 1.15), (0.1, 1.3)):
        name = f"40k, noise 0.1, {100 * outliers:g} % outliers: rms error / Cramer-Rao bound"
        for value, of in zip(against_bound(outliers, range(40 // part)), ("h", "w"), strict=True):
            report.add(f"{name}, {of}", at_most(limit), value)
    for n, noise in ((40_000, 0.1), (10_000, 0.3)):
        for outliers, limit in ((0.0, 1.1), (0.1, 1.2), (0.2, 1.4)):
            seeds = range(max(20 // part, 10))
            *values, whole = refit_against_bound(n, noise, outliers, seeds)
            name = f"whole ridge, {n // 1000}k, noise {noise}, {100 * outliers:g} % outliers"
            for value, of in zip(values, ("h", "half-height width"), strict=True):
                report.add(f"{name}: rms error / Cramer-Rao bound, {of}", at_most(limit), value)
            report.tell(f"{name}: found over nine tenths", f"{whole} of {len(seeds)}")
    for n, noise, seeds in ((40_000, 0.1, range(100 // part)), (10_000, 0.3, range(60 // part))):
        found = stations(n, noise, seeds)
        name = f"{n // 1000}k, noise {noise}, {len(seeds)} spirals"
        report.add(
            f"{name}: standard deviation of error / std, h", between(0.85, 1.15), float(found.height.std())
        )
        report.add(
            f"{name}: standard deviation of error / std, w", between(0.85, 1.15), float(found.width.std())
        )
        report.tell(
            f"{name}: mean of error / std, h, w", f"{found.height.mean():.3f}, {found.width.mean():.3f}"
        )
        report.add(f"{name}: covered, the least [%]", at_least(97), 100 * float(found.covered.min()))
        report.tell(f"{name}: covered at least 97 %", f"{(found.covered >= 0.97).sum()} of {len(seeds)}")
        report.add(f"{name}: ends, the furthest off [local widths]", at_most(1), float(found.ends.max()))
        report.tell(
            f"{name}: both ends within one width", f"{(found.ends.max(axis=1) <= 1).sum()} of {len(seeds)}"
        )
    for n, noise in ((40_000, 0.1), (10_000, 0.3)):
        planes = 200 // part
        name = f"{n // 1000}k, noise {noise}: ridges found on {planes} flat planes [%]"
        report.add(name, at_most(1), 100 * false_alarms(n, noise, range(planes)) / planes)
    report.show()


if __name__ == "__main__":
    main()
