"""IMPROVE: one template onto the scan, by NLopt."""

from __future__ import annotations

from dataclasses import dataclass

import nlopt
import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels import residual as kernel
from ridgefeature.kernels.algebra import moved
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]
FEWEST_POINTS = 12
_LEAN = (0.2, 0.2, 0.35)
"""Expected turn of a fit about its own x, y, z in radians: wide enough for any bend, narrow enough to hold on to
the ridge where the data are poor."""
SMALLEST_SCALE = 5e-3
"""Noise scale in parts of the height below which residuals are the model's own: no point is an outlier there."""

LEAST_CONTRAST = 0.05
"""Noise scale in parts of the height that evidence assumes at least, so that misfit of the model does not count."""

_LOSS = {"huber": kernel.HUBER, "tukey": kernel.TUKEY, "square": kernel.SQUARE, "cauchy": kernel.CAUCHY}
_HUBER = (kernel.HUBER, 1.345)
_ROUGH = 1e-2
_AGREE = 0.1
_FEW_OUTLIERS = 0.02


@dataclass(frozen=True)
class Limits:
    """What a fit may do to height and width: bounds, and what is expected with its reciprocal variances."""

    narrowest: float
    widest: float
    lowest: float
    highest: float
    prior: Array
    """(2, 8) expected increments, height and width, and their reciprocal variances."""


def limits_of(height: float, width: float, settings: Settings) -> Limits:
    """Limits about an expected height and width."""
    change, drift = settings.width_change, settings.drift
    high = height * settings.height_change
    low = -high if settings.flips else 0.0
    size = abs(height) + 0.1 * width
    deviation = np.array([width, 0.25 * width, 0.5 * size, *_LEAN, 2 * drift * size, drift * width])
    return Limits(
        width / change, width * change, min(low, high), max(low, high),
        np.array([[0, 0, 0, 0, 0, 0, height, width], deviation**-2.0]),
    )


def loss_of(settings: Settings) -> tuple[int, float]:
    """Number and tuning constant of the loss, as the kernels take it."""
    return _LOSS[settings.loss], settings.tuning


def _moved(template: Template, p: Array) -> Template:
    """The template after increments p (8,) in its own frame."""
    position, rotation = moved(template.position, template.rotation, p)
    return template.changed(position=position, rotation=rotation, height=float(p[6]), width=float(p[7]))


def _minimise(points: Array, template: Template, scale: float, loss: tuple[int, float], tolerance: float,
              limits: Limits, settings: Settings) -> tuple[Template, int, str]:
    """The template after one optimisation on a fixed window (points in its frame), evaluations and status."""
    table, trend = template.section.table, template.trend
    h, w = template.height, template.width
    transform = kernel.precondition(points, h, w, trend, table, scale, limits.prior[1])
    start = np.array([0, 0, 0, 0, 0, 0, h, w])
    number, tuning = loss

    def value(q: Array, gradient: Array) -> float:
        return float(kernel.objective(q, gradient, transform, start, limits.prior, trend, points, table, scale, number, tuning))

    name = "LD_SLSQP" if settings.optimiser == "auto" else settings.optimiser
    optimiser = nlopt.opt(getattr(nlopt, name), 7)
    optimiser.set_min_objective(value)
    low, high = np.full(7, -np.inf), np.full(7, np.inf)
    low[5], high[5] = (limits.lowest - h) / transform[6, 5], (limits.highest - h) / transform[6, 5]
    low[6], high[6] = (limits.narrowest - w) / transform[7, 6], (limits.widest - w) / transform[7, 6]
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
    """Robust standard deviation of the residuals."""
    floor = SMALLEST_SCALE * max(abs(template.height), 1e-3 * template.width)
    return float(kernel.robust_scale(
        points, template.height, template.width, template.trend, template.section.table, floor
    ))


def sized(template: Template, settings: Settings) -> Template:
    """The template as long as its width asks for, and longer where the data tell the width poorly."""
    length = settings.length * template.width
    if template.points and template.height:
        usual = template.points * length / template.length
        width_error = 3.8 * template.scale / (abs(template.height) * np.sqrt(usual))
        length *= float(np.clip((width_error / settings.wanted_error) ** 2, 1.0, settings.longest))
    return template.changed(length=length, flank=settings.flank * template.width)


def start_loss(window: Window, start: Template, scale: float) -> float:
    """Mean robust loss of a template as it stands; infinite where there are too few points."""
    points = window(start)
    if len(points) < FEWEST_POINTS:
        return np.inf
    scale = max(scale, LEAST_CONTRAST * abs(start.height))
    return float(kernel.mean_loss(
        points, start.height, start.width, start.trend, start.section.table, scale, *_HUBER
    )[0])


def improve(window: Window, start: Template, settings: Settings) -> Template:
    """Fit one template roughly, from a start that may be far off; never raises for not converging.

    Huber's loss first; where outliers are seen, or the width changed much, the chosen loss on the window of the
    result, until window and width agree.
    """
    points = window(start)
    if len(points) < FEWEST_POINTS:
        return start.changed(status="no data", points=len(points), std=None)
    limits = limits_of(start.height, start.width, settings)
    template, evaluations, status = _minimise(
        points, start, _scale(points, start), _HUBER, _ROUGH, limits, settings
    )
    points = window(template)
    if len(points) >= FEWEST_POINTS and abs(template.width / start.width - 1) < _AGREE:
        scale = _scale(points, template)
        _, far = kernel.mean_loss(
            points, template.height, template.width, template.trend, template.section.table, scale, *_HUBER
        )
        if far < _FEW_OUTLIERS:
            return _noted(points, template, scale, evaluations, status, settings)
    return _rounds(window, template, limits, _ROUGH, _AGREE, evaluations, settings)


def refine(window: Window, start: Template, limits: Limits, settings: Settings) -> Template:
    """Fit one template to the last digit, from a start near the optimum; never raises for not converging."""
    return _rounds(window, start, limits, settings.tolerance, 0.02, 0, settings)


def _rounds(window: Window, template: Template, limits: Limits, tolerance: float, agree: float, evaluations: int,
            settings: Settings) -> Template:
    loss = loss_of(settings)
    for _ in range(4):
        before = template.width
        points = window(template)
        if len(points) < FEWEST_POINTS:
            return template.changed(status="no data", points=len(points), std=None)
        scale = _scale(points, template)
        template, n, status = _minimise(points, template, scale, loss, tolerance, limits, settings)
        evaluations += n
        if abs(template.width / before - 1) < agree:
            break
    return _noted(points, template, scale, evaluations, status, settings)


def _noted(points: Array, template: Template, scale: float, evaluations: int, status: str, settings: Settings
           ) -> Template:
    """The template with what its fit said. Misfit of a few per cent of the height is no evidence."""
    contrast = max(scale, LEAST_CONTRAST * abs(template.height))
    evidence = kernel.evidence(
        points, template.height, template.width, template.trend, template.section.table, contrast,
        *loss_of(settings),
    )
    return template.changed(scale=scale, evaluations=evaluations, status=status, points=len(points), evidence=float(evidence)
    )


def judge(window: Window, template: Template, settings: Settings) -> Template:
    """The template with standard deviations and counts as its window gives them."""
    points = window(template)
    std, inliers = kernel.deviations(
        points, template.height, template.width, template.trend, template.section.table, template.scale,
        *loss_of(settings),
    )
    return template.changed(std=std, points=len(points), inliers=int(inliers))
