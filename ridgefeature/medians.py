"""The median of few numbers, at a fifth of the cost: a march asks for it a hundred times."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def median(values: ArrayLike) -> float:
    """As `numpy.median` of all values, to the last bit: NaN where one of them is, or there are none."""
    found = np.array(values, dtype=np.float64).ravel()
    last = found.size - 1
    if last < 0:
        return np.nan
    low = last // 2
    found.partition((low, last - low, last))
    # NaN comes last.
    return float(found[-1] if np.isnan(found[-1]) else 0.5 * (found[low] + found[last - low]))
