"""IMPROVE: one template onto the scan, by NLopt."""

from __future__ import annotations

from dataclasses import replace

import nlopt
import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels import residual as kernel
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]
FEWEST_POINTS = 12
SMALLEST_SCALE = 2e-3
"""Noise scale in parts of the height below which residuals are the model's own: no point is an outlier there."""

_LOSS = {"huber": kernel.HUBER, "tukey": kernel.TUKEY, "square": kernel.SQUARE, "cauchy": kernel.CAUCHY}
_FREE = np.array([1, 2, 3, 4, 5, 6, 7])  # sliding along a straight ridge is not observable
_BLOCK = np.ix_(_FREE, _FREE)
_HUBER = (kernel.HUBER, 1.345)
_ROUGH = 1e-2
Bounds = tuple[float, float, float]
"""Narrowest width, widest width, largest absolute height."""


def loss_of(settings: Settings) -> tuple[int, float]:
    """Number and tuning constant of the loss, as the kernels take it."""
    return _LOSS[settings.loss], settings.tuning


def _whitening(normal: Array) -> Array:
    """(8, 7) transform whose Hessian is near unity, height and width each an axis of their own.

    The five placements are whitened by the Cholesky factor of their block and follow height and width along
    the valley floor, so bounds on height and width stay simple bounds.
    """
    h = normal[_BLOCK]
    diagonal = np.diag(h)
    h = h + np.diag(1e-9 * diagonal + 1e-12 * diagonal.max() + 1e-300)
    a, b, c = h[:5, :5], h[:5, 5:], h[5:, 5:]
    lower = np.linalg.cholesky(a)
    half = np.linalg.solve(lower, b)
    inverse = np.linalg.inv(lower).T
    valley = -inverse @ half
    own = np.diag(c)
    steps = 1.0 / np.sqrt(np.maximum(own - (half * half).sum(axis=0), 1e-4 * own + 1e-300))
    transform = np.zeros((8, 7))
    transform[1:6, :5] = inverse
    transform[1:6, 5:] = valley * steps
    transform[6, 5], transform[7, 6] = steps
    return transform


def _moved(template: Template, p: Array) -> Template:
    """The template after increments p (8,) in its own frame."""
    turned = template.rotation @ kernel.rotation_of(p[3:6])[0]
    # One step of Newton's iteration keeps long chains of products orthonormal.
    turned = turned @ (1.5 * np.eye(3) - 0.5 * turned.T @ turned)
    return replace(
        template,
        position=template.position + template.rotation @ p[:3],
        rotation=turned,
        height=float(p[6]),
        width=float(p[7]),
    )


def _minimise(points: Array, template: Template, scale: float, loss: tuple[int, float], tolerance: float,
              bounds: Bounds, settings: Settings) -> tuple[Template, int, str]:
    """The template after one optimisation on a fixed window (points in its frame), evaluations and status."""
    table, trend = template.section.table, template.trend
    h, w = template.height, template.width
    normal = kernel.normal_matrix(points, h, w, trend, table, scale, *_HUBER)[0]
    transform = _whitening(normal / len(points))
    start = np.array([0, 0, 0, 0, 0, 0, h, w])
    number, tuning = loss

    def value(q: Array, gradient: Array) -> float:
        return float(kernel.objective(q, gradient, transform, start, trend, points, table, scale, number, tuning))

    name = "LD_SLSQP" if settings.optimiser == "auto" else settings.optimiser
    optimiser = nlopt.opt(getattr(nlopt, name), 7)
    optimiser.set_min_objective(value)
    narrowest, widest, tallest = bounds
    low, high = np.full(7, -np.inf), np.full(7, np.inf)
    low[5], high[5] = (-tallest - h) / transform[6, 5], (tallest - h) / transform[6, 5]
    low[6], high[6] = (narrowest - w) / transform[7, 6], (widest - w) / transform[7, 6]
    optimiser.set_lower_bounds(np.minimum(low, 0.0))
    optimiser.set_upper_bounds(np.maximum(high, 0.0))
    optimiser.set_xtol_abs(tolerance)
    optimiser.set_ftol_rel(tolerance * tolerance)
    optimiser.set_maxeval(settings.max_evaluations)
    try:
        q = optimiser.optimize(np.zeros(7))
        status = "limit" if optimiser.last_optimize_result() == nlopt.MAXEVAL_REACHED else "converged"
    except (nlopt.RoundoffLimited, nlopt.runtime_error):
        return template, optimiser.get_numevals(), "failed"
    return _moved(template, start + transform @ q), optimiser.get_numevals(), status


def _scale(points: Array, template: Template) -> float:
    """Robust standard deviation of the residuals, from the median of their absolute values."""
    r = kernel.residuals(points, template.height, template.width, template.trend, template.section.table)
    floor = SMALLEST_SCALE * max(abs(template.height), 1e-3 * template.width)
    return max(1.4826 * kernel.median_absolute(r), floor)


def _bounds(start: Template, settings: Settings) -> Bounds:
    change = settings.width_change
    return start.width / change, start.width * change, abs(start.height) * settings.height_change


def improve(window: Window, start: Template, settings: Settings) -> Template:
    """Fit one template roughly, from a start that may be far off; never raises for not converging.

    Huber's loss first, then the chosen loss on the window of the result, until window and width agree.
    """
    points = window(start)
    if len(points) < FEWEST_POINTS:
        return replace(start, status="no data", points=len(points), std=None)
    bounds = _bounds(start, settings)
    template, evaluations, _ = _minimise(
        points, start, _scale(points, start), _HUBER, _ROUGH, bounds, settings
    )
    return _rounds(window, template, bounds, _ROUGH, 0.1, evaluations, settings)


def refine(window: Window, start: Template, settings: Settings) -> Template:
    """Fit one template to the last digit, from a start near the optimum; never raises for not converging."""
    return _rounds(window, start, _bounds(start, settings), settings.tolerance, 0.02, 0, settings)


def _rounds(window: Window, template: Template, bounds: Bounds, tolerance: float, agree: float, evaluations: int,
            settings: Settings) -> Template:
    loss = loss_of(settings)
    for _ in range(4):
        before = template.width
        points = window(template)
        if len(points) < FEWEST_POINTS:
            return replace(template, status="no data", points=len(points), std=None)
        scale = _scale(points, template)
        template, n, status = _minimise(points, template, scale, loss, tolerance, bounds, settings)
        evaluations += n
        if abs(template.width / before - 1) < agree:
            break
    return judge(window, replace(template, scale=scale, evaluations=evaluations, status=status), settings)


def judge(window: Window, template: Template, settings: Settings) -> Template:
    """The template with standard deviations, counts and evidence as its window gives them."""
    points = window(template)
    if len(points) < FEWEST_POINTS:
        return replace(template, status="no data", points=len(points), std=None)
    h, w, trend, table, scale = template.height, template.width, template.trend, template.section.table, template.scale
    loss, tuning = loss_of(settings)
    _, plain, sums = kernel.normal_matrix(points, h, w, trend, table, scale, loss, tuning)
    n, psi2, slope = sums
    std = np.full(8, np.inf)
    std[0] = 0.0
    if n > 8 and slope > 0:
        block = plain[_BLOCK]
        d = 1 / np.sqrt(np.maximum(np.diag(block), 1e-300))
        inverse = np.linalg.pinv(block * np.outer(d, d), hermitian=True) * np.outer(d, d)
        # Asymptotic variance of an M-estimator (Huber 1981, 7.6), with its small-sample factor.
        factor = n * psi2 / slope**2 * n / (n - 7)
        std[_FREE] = np.sqrt(np.diag(inverse) * factor)
    r = kernel.residuals(points, h, w, trend, table)
    ridge = kernel.losses(r / scale, loss, tuning).sum()
    flat = kernel.plane_loss(points, scale, loss, tuning, 6)
    return replace(template, std=std, evidence=2 * float(flat - ridge), points=len(points), inliers=int(n))
