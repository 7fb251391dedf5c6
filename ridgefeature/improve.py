"""IMPROVE: one template onto the scan, by NLopt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import nlopt
import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels import appraise
from ridgefeature.kernels import residual as kernel
from ridgefeature.kernels.algebra import moved
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window

Array = NDArray[np.float64]
FEWEST_POINTS = 12
_LEAN = (0.2, 0.2, 0.35)
"""Expected turn of a fit about its own x, y, z in radians: wide enough for any bend, narrow enough to hold on
to the ridge where the data are poor."""
_LEAST_SCALE = 5e-3
"""Least noise scale, in parts of the height: residuals below it are the model's own, never outliers."""
_LEAST_CONTRAST = 0.05
"""Least noise scale of evidence, in parts of the height, so that misfit of the model does not count."""

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
        width / change,
        width * change,
        min(low, high),
        max(low, high),
        np.array([[0, 0, 0, 0, 0, 0, height, width], deviation**-2.0]),
    )


def loss_of(settings: Settings) -> tuple[int, float]:
    """Number and tuning constant of the loss, as the kernels take it."""
    return _LOSS[settings.loss], settings.tuning


def _floor(template: Template) -> float:
    return _LEAST_SCALE * max(abs(template.height), 1e-3 * template.width)


def _minimise(
    points: Array,
    template: Template,
    loss: tuple[int, float],
    tolerance: float,
    limits: Limits,
    settings: Settings,
) -> tuple[Template, int, str]:
    """The template after one optimisation on a fixed window (points in its frame), evaluations and status."""
    h, w, trend, table = template.shape
    prior = limits.prior
    scale, transform = appraise.prepare(points, *template.shape, _floor(template), prior[1])
    start = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, h, w])
    number, tuning = loss
    objective = kernel.objective

    def value(q: Array, gradient: Array) -> float:
        return objective(q, gradient, transform, start, prior, trend, points, table, scale, number, tuning)

    return _run(value, template, start, transform, tolerance, limits, settings)


def _minimise_distance(
    window: Window, template: Template, limits: Limits, settings: Settings
) -> tuple[Template, int, str]:
    """The template after one optimisation of its mean distance M to the scan (Eq. 3, 4); as `_minimise`."""
    scale, transform = appraise.prepare(window(template), *template.shape, _floor(template), limits.prior[1])
    start = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, template.height, template.width])

    def value(q: Array, _: Array) -> float:
        return window.mean_distance(sample(_moved(template, start, transform, q)), settings.k) / scale

    return _run(value, template, start, transform, 1e-3, limits, settings)


def _moved(template: Template, start: Array, transform: Array, q: Array) -> Template:
    position, rotation, height, width = moved(template.position, template.rotation, start, transform, q)
    return template.changed(position=position, rotation=rotation, height=height, width=width)


def sample(template: Template, along: int = 9, across: int = 21) -> Array:
    """Points (along * across, 3) spread evenly over the patch, flanks included, in the frame of the scan."""
    local = appraise.sampled(*template.shape, template.length, template.half_breadth, along, across)
    return template.position + local @ template.rotation.T


def _run(
    value: Callable[[Array, Array], float],
    template: Template,
    start: Array,
    transform: Array,
    tolerance: float,
    limits: Limits,
    settings: Settings,
) -> tuple[Template, int, str]:
    """Minimise value(q, gradient) from q = 0 within the limits: template moved, evaluations, status."""
    h, w = template.height, template.width
    optimiser = nlopt.opt(getattr(nlopt, settings.algorithm), 7)
    optimiser.set_min_objective(value)
    low, high = np.full(7, -np.inf), np.full(7, np.inf)
    low[5], high[5] = (limits.lowest - h) / transform[6, 5], (limits.highest - h) / transform[6, 5]
    low[6], high[6] = (limits.narrowest - w) / transform[7, 6], (limits.widest - w) / transform[7, 6]
    optimiser.set_lower_bounds(np.minimum(low, 0.0))
    optimiser.set_upper_bounds(np.maximum(high, 0.0))
    optimiser.set_xtol_abs(tolerance)
    optimiser.set_ftol_rel(tolerance * tolerance)
    optimiser.set_maxeval(settings.max_evaluations * (1 if settings.algorithm.startswith("LD_") else 10))
    try:
        q = optimiser.optimize(np.zeros(7))
        status = "limit" if optimiser.last_optimize_result() == nlopt.MAXEVAL_REACHED else "converged"
    except (nlopt.RoundoffLimited, nlopt.runtime_error):
        return template, optimiser.get_numevals(), "failed"
    return _moved(template, start, transform, q), optimiser.get_numevals(), status


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
    scale = max(scale, _LEAST_CONTRAST * abs(start.height))
    mean, _ = appraise.mean_loss(points, *start.shape, scale, *_HUBER)
    return float(mean)


def improve(window: Window, start: Template, settings: Settings) -> Template:
    """Fit one template roughly, from a start that may be far off; never raises for not converging.

    Huber's loss first; where outliers are seen, or the width changed much, the chosen loss on the window of
    the result, until window and width agree.
    """
    points = window(start)
    if len(points) < FEWEST_POINTS:
        return start.changed(status="no data", points=len(points), std=None)
    limits = limits_of(start.height, start.width, settings)
    if settings.measure == "M":
        return _by_distance(window, start, limits, settings)
    template, evaluations, status = _minimise(points, start, _HUBER, _ROUGH, limits, settings)
    if abs(template.width / start.width - 1) < _AGREE:
        points = window(template)
        if len(points) >= FEWEST_POINTS:
            noted, far = _noted(points, template, evaluations, status, settings)
            if far < _FEW_OUTLIERS:
                return noted
    return _rounds(window, template, limits, _ROUGH, _AGREE, evaluations, settings)


def refine(window: Window, start: Template, limits: Limits, settings: Settings) -> Template:
    """Fit one template to the last digit, from a start near the optimum; never raises for not converging."""
    if settings.measure == "M":
        return _by_distance(window, start, limits, settings)
    return _rounds(window, start, limits, settings.tolerance, 0.02, 0, settings)


def _by_distance(window: Window, template: Template, limits: Limits, settings: Settings) -> Template:
    """The template fitted by M instead of by the residuals of the points."""
    if len(window(template)) >= FEWEST_POINTS:
        template, evaluations, status = _minimise_distance(window, template, limits, settings)
        points = window(template)
        if len(points) >= FEWEST_POINTS:
            return _noted(points, template, evaluations, status, settings)[0]
    return template.changed(status="no data", std=None)


def _rounds(
    window: Window,
    template: Template,
    limits: Limits,
    tolerance: float,
    agree: float,
    evaluations: int,
    settings: Settings,
) -> Template:
    """Optimise with the chosen loss on the window of the result, until window and width agree."""
    for _ in range(4):
        before = template.width
        points = window(template)
        if len(points) < FEWEST_POINTS:
            return template.changed(status="no data", points=len(points), std=None)
        template, n, status = _minimise(points, template, loss_of(settings), tolerance, limits, settings)
        evaluations += n
        if abs(template.width / before - 1) < agree:
            break
    points = window(template)
    if len(points) < FEWEST_POINTS:
        return template.changed(status="no data", points=len(points), std=None)
    return _noted(points, template, evaluations, status, settings)[0]


def _noted(
    points: Array, template: Template, evaluations: int, status: str, settings: Settings
) -> tuple[Template, float]:
    """The template with what its fit said, and the share of points far off.

    Misfit of a few per cent of the height is no evidence.
    """
    contrast = _LEAST_CONTRAST * abs(template.height)
    scale, far, evidence = appraise.assess(
        points, *template.shape, _floor(template), contrast, *loss_of(settings)
    )
    noted = template.changed(
        scale=scale, evaluations=evaluations, status=status, points=len(points), evidence=evidence
    )
    return noted, far


def judge(window: Window, template: Template, settings: Settings) -> Template:
    """The template with standard deviations and counts as its window gives them."""
    points = window(template)
    std, inliers = appraise.deviations(points, *template.shape, template.scale, *loss_of(settings))
    return template.changed(std=std, points=len(points), inliers=int(inliers))
