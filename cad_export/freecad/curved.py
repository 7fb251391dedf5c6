"""A ridge on a curved base as what its poles are made of: the macro makes them again at any rates."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ridgefeature import Ridge
from ridgefeature.base import registered_base
from ridgefeature.basis import basis_matrix
from ridgefeature.fitting import room_for_width
from ridgefeature.merge import DEGREE, along
from ridgefeature.on_base import knot_changes
from ridgefeature.scan import millimetres_per

Array = NDArray[np.float64]

LEAST_WIDTH = 0.05
"""The smallest rate of the width that is provided for: each octave of it has knots of its own."""


def curved_surface(ridge: Ridge) -> dict[str, Any]:
    """What the macro needs, as plain lists, in millimetres: `rows` of the base, the `section`, and `pieces`.

    rows: frames of the base, its curvature across, height, width and border at the surface's rows. pieces:
    knots across, for rates of the width up to `up_to`; they are the ridge's own, which change with the octave
    of the flanks. seam: what the poles of a ring fulfil besides: one row of factors for each condition.
    """
    surface, factor, base = ridge.surface(), millimetres_per(ridge.unit), registered_base(ridge)
    poles = len(surface.knots_u) - DEGREE - 1
    sites = np.linspace(0.0, ridge.length, poles - 2 if base.closed else poles)
    spine, left, normal, curvature = base.frames(sites)
    frames = {"spine": factor * spine, "left": left, "normal": normal, "curvature": curvature / factor}
    sizes = {
        name: factor * along(ridge.arc_length, getattr(ridge, name), sites, closed=base.closed)
        for name in ("height", "width", "border")
    }
    return {
        "rows": {name: values.tolist() for name, values in (frames | sizes).items()},
        "sites": sites.tolist(),
        "seam": _seam(surface.knots_u, ridge.length).tolist() if base.closed else [],
        "section": ridge.section.coefficients.tolist(),
        "pieces": _pieces(ridge),
        "least_width": LEAST_WIDTH,
        "largest_width": float(room_for_width(ridge).min()),
    }


def _seam(knots: Array, length: float) -> Array:
    """(2, poles) differences of the first and second derivative at both ends, in powers of the length."""
    ends = np.array([0.0, length])
    return np.array([length**d * -np.diff(basis_matrix(knots, DEGREE, ends, d), axis=0)[0] for d in (1, 2)])


def _pieces(ridge: Ridge) -> list[dict[str, Any]]:
    """Knots across by rates of the width, from the slimmest to the broadest."""
    most = float(room_for_width(ridge).min())
    ends = [LEAST_WIDTH, *knot_changes(ridge, LEAST_WIDTH, most).tolist(), most]
    pieces = []
    for low, high in pairwise(ends):
        knots = ridge.resized(w=math.sqrt(low * high)).surface().knots_v
        values, counts = np.unique(knots, return_counts=True)
        pieces.append({"up_to": high, "knots_v": values.tolist(), "multiplicities_v": counts.tolist()})
    return pieces
