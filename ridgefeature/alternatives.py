"""What else than a ridge explains the points of one template: a smooth surface, a step or a crease."""

from __future__ import annotations

from ridgefeature.improve import FEWEST_POINTS, LEAST_CONTRAST
from ridgefeature.kernels.alternatives import advantage
from ridgefeature.kernels.base import on_base
from ridgefeature.settings import Settings
from ridgefeature.template import Template
from ridgefeature.window import Window


def distinct(window: Window, template: Template, settings: Settings) -> float:
    """Twice the log likelihood ratio of the ridge against the better of a smooth surface and an edge."""
    points = window(template)
    if len(points) < FEWEST_POINTS or template.height == 0:
        return 0.0
    # Misfit of the section is no evidence for another surface.
    scale = max(template.scale, LEAST_CONTRAST * abs(template.height))
    size = 0.5 * template.length, template.half_breadth, scale, settings.tuning
    views = [points]
    if template.curved:
        # On a base that is curved by mistake an edge no longer looks like one.
        views.append(on_base(points, template.base))
    return min(min(advantage(points, seen, *template.shape, *size)) for seen in views)
