"""Which cross-section the points of a whole ridge agree with: one that has a name, or a learned one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.improve import improve, limits_of, loss_of, refine, sample, sized
from ridgefeature.kernels import appraise
from ridgefeature.kernels.appraise import residuals
from ridgefeature.kernels.base import flattened, on_base
from ridgefeature.march import Track
from ridgefeature.medians import median
from ridgefeature.section import REACH, SECTIONS, Section, bell, plateau, uniform_basis
from ridgefeature.settings import Settings
from ridgefeature.settle import finish_ends, misfit_scale, settle, settle_base
from ridgefeature.template import STEEP, Template
from ridgefeature.window import Window

Array = NDArray[np.float64]

_MOST = 2000
_PROBES = 6
_SMALLEST_SHIFT = 0.01
_MUCH_BETTER = 0.8
_LEAST_NOISE = 0.02
"""Least noise scale, in parts of the height, by which the first template's section is judged."""
_DOUBT = 6.0
"""Log likelihood ratio from which on the march takes another section."""
_CLEARLY = 0.98
"""Distance of patch and points, in parts of the bell's, from which on it does so too."""
_AS_MUCH = 0.9
"""Evidence of all templates with another section, in that with their own, below which they went astray."""
_NOISIER = 1.5
"""Noise of the first template with that section, in that before, from which on its fit went wrong."""
_NARROWER = (1.0, 0.9, 0.8, 0.7)
"""Widths tried for a learned section, in widths of the section before it."""


def first_section(settings: Settings) -> Section:
    """The section to march with."""
    return SECTIONS.get(settings.section, bell)()


def march_section(window: Window, first: Template, settings: Settings) -> Template:
    """The first template, on steep flanks with a steeper section if that is likelier or nearer to its points.

    Distances count both ways: a bell on steep flanks comes out too wide, or as a spike whose top no point is
    near to.
    """
    if settings.section != "auto" or settings.measure == "M" or abs(first.height) < STEEP * first.width:
        return first
    points = window(first)
    steep = improve(window, with_section(first, plateau()), settings)
    if steep.status in ("failed", "no data") or not steep.height * first.height > 0:
        return first
    scale = max(min(first.scale, steep.scale), _LEAST_NOISE * abs(first.height))
    apart, losses = [], []
    for template in (first, steep):
        seen = _seen_from(template, points, first)
        losses.append(len(seen) * appraise.mean_loss(seen, *template.shape, scale, *loss_of(settings))[0])
        forth = median(np.abs(residuals(seen, *template.shape)))
        apart.append(float(forth) + window.mean_distance(sample(template), 1))
    if losses[1] > losses[0] - _DOUBT and apart[1] > _CLEARLY * apart[0]:
        return first
    longer = improve(window, sized(steep, settings), settings)
    return longer if longer.scale < _NOISIER * max(first.scale, steep.scale) else first


def in_doubt(misfit: Array, templates: tuple[Template, ...]) -> bool:
    """Whether residuals (2, m) by distance from the spine differ from 0 by more than chance and by enough.

    More than chance: a chi-square test. Enough: one per cent of the height somewhere.
    """
    count, total = misfit
    if not any(t.height for t in templates):
        return False
    square = float((total**2 / np.maximum(count, 1.0)).sum())
    noise = median([misfit_scale(t) / abs(t.height) for t in templates if t.height])
    shift = float(np.abs(total / np.maximum(count, 30.0)).max()) * noise
    return square > len(count) + 6.0 * np.sqrt(2.0 * len(count)) and shift > _SMALLEST_SHIFT


def choose_section(window: Window, templates: tuple[Template, ...], settings: Settings) -> Section:
    """The section that fits best; the templates' own unless another is better beyond doubt.

    Doubt is settled by refitting a few templates with each named section, and with one learned from the
    residuals: the likelihoods decide, with the Bayesian information criterion's price for what is learned.
    """
    current = templates[0].section
    if settings.section in SECTIONS:
        return current
    eta, zeta, sigma = _collapsed(window, templates)
    if len(eta) < 100:
        return current
    loss = _loss((zeta - current(eta)) / sigma, settings)
    learned, found = _learned(eta, zeta, sigma, settings)
    price = 0.5 * (REACH + 1) * np.log(len(eta))
    if settings.section == "auto" and not found < loss - price - 0.02 * loss:
        return current
    probes = _probes(templates)
    named = [make() for make in SECTIONS.values()]
    losses = [_refitted(window, probes, section, settings) for section in named]
    best, least = named[int(np.argmin(losses))], min(losses)
    if settings.section == "learned":
        best, least = learned, np.inf
    again, _ = _learned(*_collapsed(window, _refits(window, probes, best, settings)), settings)
    for section in (learned, again):
        loss = _refitted(window, probes, section, settings)
        if loss < _MUCH_BETTER * least - price:
            best, least = section, loss
    return best


def resettled(window: Window, track: Track, section: Section, settings: Settings) -> Track:
    """The settled track settled with another section; as it was where templates tell less of a ridge then."""
    templates = tuple(with_section(t, section) for t in track.templates)
    # Two rounds: what is expected of a template comes from its neighbours, which change with the section too.
    found = settle(window, settle(window, replace(track, templates=templates), settings), settings)
    found = finish_ends(window, settle_base(window, found, settings), settings)
    before, after = (sum(t.evidence for t in told.templates) for told in (track, found))
    return found if after > _AS_MUCH * before else track


def with_section(template: Template, section: Section) -> Template:
    """The template with another section and the width that keeps its width at half height."""
    width = template.width * template.section.half_height_width / section.half_height_width
    return template.changed(section=section, width=width, flank=template.flank * width / template.width)


def _probes(templates: tuple[Template, ...]) -> tuple[Template, ...]:
    """A few templates, spread evenly, without the ends where there are enough."""
    inner = templates[1:-1] if len(templates) > _PROBES else templates
    return tuple(
        inner[i] for i in np.linspace(0, len(inner) - 1, min(_PROBES, len(inner))).round().astype(int)
    )


def _refits(
    window: Window, probes: tuple[Template, ...], section: Section, settings: Settings
) -> tuple[Template, ...]:
    starts = [with_section(t, section) for t in probes]
    return tuple(refine(window, t, limits_of(t.height, t.width, settings), settings) for t in starts)


def _refitted(window: Window, probes: tuple[Template, ...], section: Section, settings: Settings) -> float:
    """Loss of a few templates refitted with a section, each on the window and scale it had before."""
    total = 0.0
    for probe, fit in zip(probes, _refits(window, probes, section, settings), strict=True):
        points = _seen_from(fit, window(probe), probe)
        mean, _ = appraise.mean_loss(points, *fit.shape, probe.scale, *loss_of(settings))
        total += len(points) * mean
    return float(total)


def _seen_from(template: Template, points: Array, other: Template) -> Array:
    """Points (n, 3) of another template's frame in that of a template; flat as each sees its base."""
    if other.curved:
        points = on_base(points, other.base)
    points = (points @ other.rotation.T + (other.position - template.position)) @ template.rotation
    return flattened(points, template.base) if template.curved else points


def _collapsed(window: Window, templates: tuple[Template, ...]) -> tuple[Array, Array, Array]:
    """Points of all windows as y / width and z / height, with the noise scale in heights."""
    rows = []
    step = max(sum(t.points for t in templates) // _MOST, 1)
    for t in (t for t in templates if t.height):
        points = window(t)
        # By x, so that the choice does not depend on how the scan is turned.
        x, y, z = points[np.argsort(points[:, 0], kind="stable")[::step]].T
        bend, rise, widening = t.trend
        y = y - 0.5 * bend * x * x / np.maximum(1 - bend * y, 0.2)
        height = t.height + rise * x
        width = np.maximum(t.width + widening * x, 0.1 * t.width)
        slope = height / width * t.section(y / width, 1)
        rows.append((y / width, z / height, np.abs(t.scale / height) * np.sqrt(1 + slope * slope)))
    eta, zeta, sigma = (np.concatenate(column) for column in zip(*rows, strict=True))
    return eta, zeta, sigma


def _learned(eta: Array, zeta: Array, sigma: Array, settings: Settings) -> tuple[Section, float]:
    """The symmetric section of nine raised control points that fits collapsed points best, and its loss.

    Of the widths that do equally well the smallest is the one whose feet are where the ridge begins.
    """
    tried = [_fit(eta / factor, zeta, sigma, settings) for factor in _NARROWER]
    best = min(loss for _, loss in tried)
    raised, loss = [fit for fit in tried if fit[1] <= 1.01 * best + 2.0][-1]
    return Section(raised, "learned"), loss


def _fit(eta: Array, zeta: Array, sigma: Array, settings: Settings) -> tuple[Array, float]:
    """Raised control points (9,), falling outwards, by reweighted least squares, and their loss."""
    columns = np.stack(
        [
            uniform_basis(eta, 0),
            *(uniform_basis(eta, k) + uniform_basis(eta, -k) for k in range(1, REACH + 1)),
        ],
        1,
    )
    first = bell()(np.arange(REACH + 1) / (2 * REACH + 4))
    half = first
    for _ in range(3):
        r = (zeta - columns @ half) / sigma
        weight = np.maximum(1 - (r / settings.tuning) ** 2, 0.0) / sigma
        found, *_ = np.linalg.lstsq(columns * weight[:, None], zeta * weight, rcond=None)
        half = np.minimum.accumulate(np.maximum(np.asarray(found, dtype=np.float64), 0.0))
        half = half if half[0] > 0 else first
    return np.concatenate([half[:0:-1], half]), _loss((zeta - columns @ half) / sigma, settings)


def _loss(x: Array, settings: Settings) -> float:
    return float(appraise.losses(x, *loss_of(settings)).sum())
