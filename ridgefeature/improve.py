"""IMPROVE: one template onto the scan, by NLopt."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import nlopt
import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels import appraise, residual
from ridgefeature.kernels.algebra import moved
from ridgefeature.kernels.base import on_base, seen_from, standing
from ridgefeature.kernels.base_terms import found_terms
from ridgefeature.kernels.evidence import assess
from ridgefeature.kernels.fit import bounds, fit
from ridgefeature.kernels.objective import objective
from ridgefeature.optimise import c_functions, minimise, status_of
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
LEAST_CONTRAST = 0.05
"""Least noise scale of evidence, in parts of the height, so that misfit of the model does not count."""

_LOSS = {
    "huber": residual.HUBER,
    "tukey": residual.TUKEY,
    "square": residual.SQUARE,
    "cauchy": residual.CAUCHY,
}
_HUBER = (residual.HUBER, 1.345)
_ROUGH = 1e-2
_AGREE = 0.1
_SLIDES, _MOST_SLIDES = 0.15, 3
"""Share of its length by which a fit may leave its start's place along the ridge; how often it is slid."""
_FEW_OUTLIERS = 0.02


@dataclass(frozen=True)
class Limits:
    """What a fit may do to height and width: bounds, and what is expected with its reciprocal variances."""

    lowest: float
    highest: float
    narrowest: float
    widest: float
    prior: Array
    """(2, 8) expected increments, height and width, and their reciprocal variances."""

    @property
    def range(self) -> tuple[float, float, float, float]:
        """The four bounds, as kernels.fit takes them."""
        return self.lowest, self.highest, self.narrowest, self.widest


def limits_of(height: float, width: float, settings: Settings) -> Limits:
    """Limits about an expected height and width."""
    change, drift = settings.width_change, settings.drift
    high = height * settings.height_change
    low = -high if settings.flips else 0.0
    size = abs(height) + 0.1 * width
    deviation = np.array([width, 0.25 * width, 0.5 * size, *_LEAN, 2 * drift * size, drift * width])
    return Limits(
        min(low, high),
        max(low, high),
        width / change,
        width * change,
        np.array([[0, 0, 0, 0, 0, 0, height, width], deviation**-2.0]),
    )


def loss_of(settings: Settings) -> tuple[int, float]:
    """Number and tuning constant of the loss, as the kernels take it."""
    return _LOSS[settings.loss], settings.tuning


def floor(template: Template) -> float:
    """Least noise scale of a template's residuals."""
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
    most = settings.max_evaluations * (1 if settings.algorithm.startswith("LD_") else 10)
    c = c_functions()
    if c is None:
        _, transform, problem = appraise.prepare(
            points, *template.shape, floor(template), limits.prior, *loss
        )

        def value(q: Array, gradient: Array) -> float:
            return objective(q, gradient, problem)

        return _minimise_in_python(value, template, transform, tolerance, most, limits, settings)
    position, rotation, height, width, evaluations, result = fit(
        c,
        points,
        template.position,
        template.rotation,
        *template.shape,
        floor(template),
        limits.prior,
        *loss,
        limits.range,
        tolerance,
        most,
        getattr(nlopt, settings.algorithm),
    )
    return _standing(template, position, rotation, height, width), evaluations, status_of(result)


def _minimise_distance(
    window: Window, template: Template, limits: Limits, settings: Settings
) -> tuple[Template, int, str]:
    """The template after one optimisation of its mean distance M to the scan (Eq. 3, 4); as `_minimise`."""
    scale, transform, _ = appraise.prepare(
        window(template), *template.shape, floor(template), limits.prior, *_HUBER
    )

    def value(q: Array, _: Array) -> float:
        return window.mean_distance(sample(_moved(template, transform, q)), settings.k) / scale

    most = 10 * settings.max_evaluations
    return _minimise_in_python(value, template, transform, 1e-3, most, limits, settings)


def _minimise_in_python(
    value: Callable[[Array, Array], float],
    template: Template,
    transform: Array,
    tolerance: float,
    most: int,
    limits: Limits,
    settings: Settings,
) -> tuple[Template, int, str]:
    low, high = bounds(template.height, template.width, transform, limits.range)
    q, evaluations, result = minimise(value, low, high, tolerance, most, settings.algorithm)
    return _moved(template, transform, q), evaluations, status_of(result)


def _moved(template: Template, transform: Array, q: Array) -> Template:
    position, rotation, height, width = moved(
        template.position, template.rotation, template.height, template.width, transform, q
    )
    return _standing(template, position, rotation, height, width)


def _standing(template: Template, position: Array, rotation: Array, height: float, width: float) -> Template:
    """The template after a fit, which saw its base as flat: on a curved one the frame goes along with it."""
    base = template.base
    if template.curved:
        old, turn = template.rotation, template.rotation.T @ rotation
        place, axes = standing(old.T @ (position - template.position), turn, base)
        position, rotation, base = template.position + old @ place, old @ axes, seen_from(base, turn)
    return template.changed(position=position, rotation=rotation, height=height, width=width, base=base)


def sample(template: Template, along: int = 9, across: int = 21) -> Array:
    """Points (along * across, 3) spread evenly over the patch, flanks included, in the frame of the scan."""
    local = residual.sampled(*template.shape, template.length, template.half_breadth, along, across)
    if template.curved:
        local = on_base(local, template.base)
    return template.position + local @ template.rotation.T


def sized(template: Template, settings: Settings) -> Template:
    """The template as long as its width asks for, and longer where the data tell the width poorly."""
    length = settings.length * template.width
    if template.points and template.height:
        usual = template.points * length / template.length
        width_error = 3.8 * template.scale / (abs(template.height) * math.sqrt(usual))
        length *= min(max((width_error / settings.wanted_error) ** 2, 1.0), settings.longest)
    return template.changed(length=length, flank=settings.flank * template.width)


def start_loss(window: Window, start: Template, scale: float) -> float:
    """Mean robust loss of a template as it stands; infinite where there are too few points."""
    points = window(start)
    if len(points) < FEWEST_POINTS:
        return np.inf
    scale = max(scale, LEAST_CONTRAST * abs(start.height))
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
    """Fit one template to the last digit, from a start near the optimum; never raises for not converging.

    It stays at its place along the ridge. A fit does not move along its start's own axis, but where the start
    is tipped over, up and down is along the ridge too: then it is slid back and fitted again.
    """
    if settings.measure == "M":
        return _by_distance(window, start, limits, settings)
    fitted = _rounds(window, start, limits, settings.tolerance, 0.02, 0, settings)
    for _ in range(_MOST_SLIDES):
        # The crest tells the place: the start's base may have been anywhere.
        slide = float(fitted.rotation[:, 0] @ (start.apex - fitted.apex))
        if fitted.status == "no data" or abs(slide) < _SLIDES * start.length:
            break
        again = fitted.slid(slide)
        fitted = _rounds(window, again, limits, settings.tolerance, 0.02, fitted.evaluations, settings)
    return fitted


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
    contrast = LEAST_CONTRAST * abs(template.height)
    scale, far, evidence = assess(points, *template.shape, floor(template), contrast, *loss_of(settings))
    noted = template.changed(
        scale=scale, evaluations=evaluations, status=status, points=len(points), evidence=evidence
    )
    return noted, far


def judge(points: Array, template: Template, settings: Settings) -> Template:
    """The template with standard deviations and counts as the points in its window (n, 3) give them."""
    std, inliers = appraise.deviations(points, *template.shape, template.scale, *loss_of(settings))
    if template.base_std.any():
        effect = found_terms(points, *template.shape, floor(template), *loss_of(settings))[2]
        std[6:] = np.sqrt(std[6:] ** 2 + (effect * template.base_std) ** 2 @ np.ones(3))
    return template.changed(std=std, points=len(points), inliers=int(inliers))
