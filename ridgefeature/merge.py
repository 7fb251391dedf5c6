"""CONSTRUCT: rows of control points across the ridge, merged into one C2 bicubic surface."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ridgefeature.basis import basis_matrix, greville, periodic_interpolation
from ridgefeature.bspline import Surface
from ridgefeature.section import Section
from ridgefeature.template import Template

Array = NDArray[np.float64]

DEGREE = 3
OUTSIDE = 0.1
"""Breadth of the flank's knot span, in widths."""
LEAST_BORDER = 0.5 + 2 * OUTSIDE / 3
"""The border must lie further out than this many widths, or the flank's control points would cross."""


def section_knots(section: Section, flank: float = OUTSIDE) -> Array:
    """Knots across, in widths: simple at feet and between, the end of the flanks repeated."""
    end = np.full(DEGREE + 1, 0.5 + flank)
    return np.concatenate([-end, np.linspace(-0.5, 0.5, section.spans + 1), end])


def section_poles(section: Section, flank: float = OUTSIDE) -> tuple[Array, Array]:
    """Control points of one row, (n,) positions across in widths and (n,) heights in apex heights.

    The outermost are the flanks' borders, which follow no width; their position here is not used.
    """
    knots = section_knots(section, flank)
    across = greville(knots, DEGREE)
    raised = np.zeros(len(across))
    raised[DEGREE + 1 : DEGREE + 1 + len(section.coefficients)] = section.coefficients
    return across, raised


@lru_cache(maxsize=16)
def interpolation(k: int, closed: bool = False) -> tuple[Array, Array]:
    """Cubic knots on [0, 1] for values at k even sites, and the map (n_poles, k) from values to poles.

    Not-a-knot, k poles; closed: C2 from the last site, which is the first again, to the first, k + 2 poles.
    """
    sites = np.linspace(0.0, 1.0, k)
    if closed:
        knots, inverse = periodic_interpolation(sites)
    else:
        knots = np.concatenate([np.zeros(4), sites[2:-2], np.ones(4)])
        inverse = np.asarray(np.linalg.inv(basis_matrix(knots, DEGREE, sites)), dtype=np.float64)
    knots.setflags(write=False)
    inverse.setflags(write=False)
    return knots, inverse


def along(arc_length: Array, values: Array, at: Array, derivative: int = 0, closed: bool = False) -> Array:
    """The C2 spline through values (k, ...) at even arc lengths (k,), or its derivative, at `at` (m,)."""
    knots, inverse = interpolation(len(arc_length), closed)
    total = arc_length[-1]
    basis = basis_matrix(knots * total, DEGREE, np.clip(at, 0.0, total), derivative)
    return np.tensordot(basis, np.tensordot(inverse, values, 1), 1)


def row_controls(
    section: Section, width: Array, border: Array, height: Array, flank: float = OUTSIDE
) -> tuple[Array, Array]:
    """Control values (k, n) of each row: distance sideways and height over the base."""
    eta, raised = section_poles(section, flank)
    sideways = width[:, None] * eta
    sideways[:, 0], sideways[:, -1] = -border, border
    return sideways, height[:, None] * raised


def merged_surface(
    arc_length: Array,
    spine: Array,
    across: Array,
    normal: Array,
    height: Array,
    width: Array,
    border: Array,
    section: Section,
    closed: bool = False,
) -> Surface:
    """The surface through one row of control points at each of k even stations.

    spine, across, normal (k, 3): origin and unit axes of each row; height, width, border (k,). The poles are
    affine in height and in width, so what does not change with them is not worked out again. u is arc length,
    v the distance from the spine in widths (on the ridge; on the flanks it runs on to the border).
    closed: the last station is the first again, and the surface C2 over that seam too.
    """
    knots, inverse = interpolation(len(arc_length), closed)
    sideways, raised = row_controls(section, width, border, height)
    rows = spine[:, None] + sideways[..., None] * across[:, None] + raised[..., None] * normal[:, None]
    poles = np.tensordot(inverse, rows, 1)
    if closed:
        poles[-1] = poles[0]
    return Surface(poles, knots * arc_length[-1], section_knots(section), DEGREE, DEGREE)


def template_surface(template: Template) -> Surface:
    """A straight template as the B-spline patch that it is: the same rows, four of them."""
    t = template.rotation[:, 0]
    s = np.linspace(0.0, template.length, 4)
    same = np.ones(4)
    return merged_surface(
        s,
        template.start + s[:, None] * t,
        np.tile(template.rotation[:, 1], (4, 1)),
        np.tile(template.rotation[:, 2], (4, 1)),
        template.height * same,
        template.width * same,
        max(template.half_breadth, 1.01 * LEAST_BORDER * template.width) * same,
        template.section,
    )
