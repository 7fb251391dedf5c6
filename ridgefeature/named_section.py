"""Which of the sections that have a name all points of a ridge agree with best."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ridgefeature.free_section import nearest_spline
from ridgefeature.kernels.strip import A, B, C, E, H, W
from ridgefeature.section import SECTIONS, Section

Array = NDArray[np.float64]

_WIDTHS = np.exp(np.linspace(-0.25, 0.25, 21))
"""Widths that are looked at, in that which keeps the width at half height."""
_UNTOLD = 1.0, 0.0, 0.0, 0.0, 0.0
"""What is found where points tell nothing: no change."""
_UNKNOWN = 2
"""Height and place, beside the changes of the base."""


@dataclass(frozen=True, eq=False)
class NamedSection:
    """A named section as fitted."""

    section: Section
    loss: float
    """Squared distance from the points in noise scales, but for what is the same for all sections."""
    wider: float
    """Its width, in those of the section before."""
    found: Array
    """(5,) its height in those of the section before, its shift in widths, changes of the base."""

    def applied(self, terms: Array) -> Array:
        """A ridge's terms (n, 6) with this section."""
        new = terms.copy()
        new[:, [A, B, C]] += self.found[_UNKNOWN:]
        new[:, E] += self.found[1] * new[:, W]
        new[:, W] *= self.wider
        new[:, H] *= self.found[0]
        return new


def best_named(
    matrix: Array, right: Array, before: Section, spans: int, wider: float
) -> tuple[NamedSection, NamedSection]:
    """The section before as fitted, and the likeliest of it and those with a name.

    matrix, right: what points say of a spline of so many spans over `wider` widths of the section before, and
    of changes of the base, as normal equations (`free_section.by_means`).
    """
    others = [section for section in (make() for make in SECTIONS.values()) if section is not before]
    own, *fits = (_fitted(matrix, right, before, section, spans, wider) for section in (before, *others))
    return own, min([own, *fits], key=lambda fit: fit.loss)


def _fitted(
    matrix: Array, right: Array, before: Section, section: Section, spans: int, wider: float
) -> NamedSection:
    """A section as fitted: linear least squares at each of some widths, to first order in its place."""
    columns = _columns(before, section, spans, wider)
    across = columns.transpose(0, 2, 1)
    normal, pull = across @ matrix @ columns, across @ right
    try:
        found = np.asarray(np.linalg.solve(normal, pull[:, :, None]), dtype=np.float64)[:, :, 0]
    except np.linalg.LinAlgError:  # too few points to tell of this one
        return NamedSection(section, 0.0, 1.0, np.array(_UNTOLD))
    loss = -(found * pull).sum(axis=1)
    k = int(np.argmin(loss))
    found[k, 1] /= found[k, 0]
    return NamedSection(section, float(loss[k]), float(_widths(before, section)[k]), found[k])


def _widths(before: Section, section: Section) -> Array:
    return np.asarray(_WIDTHS * before.half_height_width / section.half_height_width)


@lru_cache(maxsize=64)
def _columns(before: Section, section: Section, spans: int, wider: float) -> Array:
    """How the splines, and the base, change with height, place and base of a section of each width."""
    sites, nearest = nearest_spline(spans)
    widths = _widths(before, section)
    eta = (sites - 0.5) * wider / widths[:, None]
    n = spans + 3
    columns = np.zeros((len(widths), n + 3, _UNKNOWN + 3))
    columns[:, :n, 0] = section(eta) @ nearest.T
    columns[:, :n, 1] = -(section(eta, 1) / widths[:, None]) @ nearest.T
    columns[:, n:, _UNKNOWN:] = np.eye(3)
    columns.setflags(write=False)
    return columns
