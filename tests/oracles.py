"""Plain numpy statements of what the kernels compute, and small scans with known answers."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

import ridgefeature as rf
from ridgefeature.grid import build_grid, typical_spacing
from ridgefeature.kernels.residual import CAUCHY, HUBER, SQUARE, TUKEY
from ridgefeature.section import Section, bell
from ridgefeature.synthetic import Spiral
from ridgefeature.template import Template
from ridgefeature.window import Window

LOSSES = {"huber": HUBER, "tukey": TUKEY, "square": SQUARE, "cauchy": CAUCHY}
NO_TREND = np.zeros(3)


def section_spline(section: Section) -> BSpline:
    """The section from its definition: scipy's cubic B-spline on uniform knots from foot to foot."""
    m = len(section.coefficients)
    knots = -0.5 + (np.arange(m + 10) - 3) / (m + 3)
    return BSpline(knots, np.concatenate([np.zeros(3), section.coefficients, np.zeros(3)]), 3)


def section_values(section: Section, eta: np.ndarray, derivative: int = 0) -> np.ndarray:
    inside = np.abs(eta) <= 0.5
    return np.where(inside, section_spline(section)(np.clip(eta, -0.5, 0.5), derivative), 0.0)


def residual(points: np.ndarray, height: float, width: float, trend: np.ndarray, section: Section):
    """Height over the section divided by the length of its gradient; points in the template's frame."""
    x, y, z = points.T
    lean = trend[0] * x / np.maximum(1 - trend[0] * y, 0.2)
    h, w = height + trend[1] * x, np.maximum(width + trend[2] * x, 0.1 * width)
    eta = (y - 0.5 * lean * x) / w
    slope = h * section_values(section, eta, 1) / w
    return (z - h * section_values(section, eta)) / np.sqrt(1 + slope**2)


def moved_residual(points: np.ndarray, p: np.ndarray, trend: np.ndarray, section: Section) -> np.ndarray:
    """The residual after increments p (8,): translation, rotation vector; height and width are values."""
    local = (points - p[:3]) @ Rotation.from_rotvec(p[3:6]).as_matrix()
    return residual(local, p[6], p[7], trend, section)


def jacobian(points: np.ndarray, height: float, width: float, trend: np.ndarray, section: Section):
    """(n, 8) derivatives of the residual by central differences."""
    p = np.array([0, 0, 0, 0, 0, 0, height, width], dtype=float)
    step = 1e-5 * np.array([width, width, width, 1, 1, 1, abs(height), width])
    columns = []
    for i in range(8):
        d = np.zeros(8)
        d[i] = step[i]
        up, down = (moved_residual(points, q, trend, section) for q in (p + d, p - d))
        columns.append((up - down) / (2 * step[i]))
    return np.stack(columns, axis=1)


def loss(x: np.ndarray, name: str, tuning: float) -> np.ndarray:
    size = np.abs(x)
    if name == "huber":
        return np.where(size <= tuning, 0.5 * x**2, tuning * (size - 0.5 * tuning))
    if name == "tukey":
        return tuning**2 / 6 * (1 - np.clip(1 - (x / tuning) ** 2, 0, None) ** 3)
    if name == "cauchy":
        return 0.5 * tuning**2 * np.log1p((x / tuning) ** 2)
    return 0.5 * x**2


def psi(x: np.ndarray, name: str, tuning: float) -> np.ndarray:
    """Derivative of the loss."""
    if name == "huber":
        return np.clip(x, -tuning, tuning)
    if name == "tukey":
        return np.where(np.abs(x) < tuning, x * (1 - (x / tuning) ** 2) ** 2, 0.0)
    return x / (1 + (x / tuning) ** 2) if name == "cauchy" else x


def straight_ridge(
    n=4000, height=3.0, width=8.0, noise=0.0, outliers=0.0, seed=0, section=None, half=(12, 8)
):
    """Points (n, 3) on a ridge along x over z = 0, and which of them are outliers."""
    random = np.random.default_rng(seed)
    xy = random.uniform(-1, 1, (n, 2)) * half
    points = np.column_stack([xy, height * (section or bell())(xy[:, 1] / width)])
    points += random.normal(0.0, noise, points.shape) if noise else 0.0
    stray = np.arange(n) < round(outliers * n)
    points[stray, 2] = random.uniform(-1, 2, stray.sum()) * abs(height)
    return points, stray


def window_on(points: np.ndarray) -> Window:
    grid = build_grid(rf.Scan(points).points)
    return Window(grid, typical_spacing(grid))


def template_at(
    height=3.0, width=8.0, position=(0, 0, 0), turn=(0, 0, 0), section=None, **values
) -> Template:
    values = {"length": 0.8 * width, "flank": 0.3 * width, **values}
    frame = Rotation.from_rotvec(np.array(turn, dtype=float)).as_matrix()
    return Template(
        np.array(position, dtype=float), frame, width, height, section=section or bell(), **values
    )


SPIRAL = Spiral()
PICK = 60.0
"""Arc length of the pick on the spiral."""


def apex(spiral: Spiral = SPIRAL, s: float = PICK) -> np.ndarray:
    """A point on the crest."""
    return spiral.spine(np.array(s)) + np.array([0.0, 0.0, float(spiral.height(np.array(s)))])


@lru_cache(maxsize=4)
def spiral_points(n: int = 12000, noise: float = 0.1, seed: int = 1) -> np.ndarray:
    points = SPIRAL.points(n, noise=noise, seed=seed)
    points.setflags(write=False)
    return points


@lru_cache(maxsize=4)
def spiral_ridge(n: int = 12000, noise: float = 0.1, seed: int = 1) -> rf.Ridge:
    return rf.register(spiral_points(n, noise, seed), at=apex())
