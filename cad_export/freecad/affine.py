"""The poles of a ridge as what stays, what goes with the height and what goes with the width."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ridgefeature import Ridge
from ridgefeature.fitting import room_for_width

Array = NDArray[np.float64]

TOLERANCE = 1e-12
"""Largest difference from the ridge's own poles, in parts of the largest coordinate: rounding alone."""


@dataclass(frozen=True, eq=False)
class AffinePoles:
    """Poles at rates h and w: fixed + h per_height + w per_width, each (nu, nv, 3), in the ridge's unit.

    `largest_width` is the largest rate w that leaves the feet on the flanks.
    """

    fixed: Array
    per_height: Array
    per_width: Array
    largest_width: float

    def __call__(self, h: float, w: float) -> Array:
        """The poles (nu, nv, 3)."""
        return self.fixed + h * self.per_height + w * self.per_width


def affine_poles(ridge: Ridge) -> AffinePoles:
    """The ridge's poles taken apart, from its own surface at a few rates, and held against it at others.

    Raises ValueError for a ridge whose poles are not affine in its rates to TOLERANCE.
    """
    flat = ridge.resized(h=0, w=1).surface().poles
    slim = ridge.resized(h=0, w=0.5).surface().poles
    if slim.shape != flat.shape:
        raise ValueError(
            f"expected poles that are affine in h and w, got {flat.shape[1]} across at w=1 and "
            f"{slim.shape[1]} at w=0.5: the ridge stands on a curved base; take its curved_surface"
        )
    per_width = 2 * (flat - slim)
    largest = float(room_for_width(ridge).min())
    poles = AffinePoles(flat - per_width, ridge.surface().poles - flat, per_width, largest)
    allowed = TOLERANCE * float(np.abs(poles.fixed).max())
    for h, w in ((1.0, 1.0), (-1.5, 0.25), (3.0, largest * (1 - TOLERANCE))):
        error = float(np.abs(poles(h, w) - ridge.resized(h=h, w=w).surface().poles).max())
        if not error <= allowed:
            raise ValueError(
                f"expected poles that are affine in h and w, got {error:.3g} off at h={h:g}, w={w:g}; "
                "export the surface at fixed rates instead"
            )
    return poles
