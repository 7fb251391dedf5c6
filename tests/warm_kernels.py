"""Kernels that a registration needs late, compiled by the functions that use them."""

from __future__ import annotations

import numpy as np
from made_ridges import made_ridge
from oracles import template_at

from ridgefeature.curvature import curved, joined, terms_of
from ridgefeature.ends import place_ends
from ridgefeature.improve import judge
from ridgefeature.march import Track
from ridgefeature.section import bell
from ridgefeature.settings import Settings
from ridgefeature.stations import lay_out
from ridgefeature.template import Template
from ridgefeature.verdict import distinct


def compile_late_kernels() -> None:
    """The later half of them: another process compiles the earlier half meanwhile."""
    settings, random = Settings(), np.random.default_rng(0)
    x, y = random.uniform(-1, 1, (2, 400)) * [[4], [8]]
    points = np.column_stack([x, y, 3.0 * bell()(y / 10)]) + random.normal(0, 0.05, (400, 3))
    template = template_at(3.0, 10.0, scale=0.05, points=400)
    chain = tuple(template.changed(position=np.array([8.0 * i, 0.0, 0.0])) for i in range(6))

    def window(_: Template, before: float = 1.0, after: float = 1.0) -> np.ndarray:
        return points

    lay_out(tuple(judge(points, t, settings) for t in chain), settings, False)
    found = joined([terms_of(points, t, settings) for t in chain])
    found.significant(settings.base_chance)
    on_base = curved(chain, found)
    judge(points, on_base[0], settings)
    distinct(window, on_base[0], settings)
    place_ends(window, Track(chain, ("", "")), settings)
    made_ridge().distance(points)
