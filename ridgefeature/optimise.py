"""NLopt's local optimisers: its C functions for compiled objectives, its Python interface for others."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache

import nlopt
import numpy as np
from numpy.typing import NDArray

from ridgefeature.kernels import objective
from ridgefeature.kernels.fit import C_FUNCTIONS

Array = NDArray[np.float64]


@cache
def c_functions() -> NDArray[np.int64] | None:
    """Addresses of NLopt's C functions, as kernels.fit takes them; None where this build hides them."""
    try:
        library = ctypes.CDLL(nlopt._nlopt.__file__)
        found = [getattr(library, f"nlopt_{name}") for name in C_FUNCTIONS]
    except (AttributeError, OSError):
        return None
    addresses = [ctypes.cast(function, ctypes.c_void_p).value for function in found]
    return np.array([*addresses, objective.callback().address], dtype=np.int64)


def minimise(
    value: Callable[[Array, Array], float],
    low: Array,
    high: Array,
    tolerance: float,
    most: int,
    algorithm: str,
) -> tuple[Array, int, int]:
    """Minimise value(q, gradient), which writes the gradient where it has a size, from q = 0.

    low, high (n,): bounds that hold 0. It ends at a step below tolerance, at a relative gain below its square
    or after `most` evaluations. algorithm: NLopt's name of it. Returns q (n,), the number of evaluations and
    NLopt's result, negative where it failed.
    """
    optimiser = nlopt.opt(getattr(nlopt, algorithm), len(low))
    optimiser.set_min_objective(value)
    optimiser.set_lower_bounds(low)
    optimiser.set_upper_bounds(high)
    optimiser.set_xtol_abs(tolerance)
    optimiser.set_ftol_rel(tolerance * tolerance)
    optimiser.set_maxeval(most)
    try:
        q = optimiser.optimize(np.zeros(len(low)))
    except (nlopt.RoundoffLimited, nlopt.runtime_error):
        return np.zeros(len(low)), optimiser.get_numevals(), nlopt.FAILURE
    return q, optimiser.get_numevals(), optimiser.last_optimize_result()


def status_of(result: int) -> str:
    """What NLopt's result says: converged, limit (of evaluations) or failed."""
    if result < 0:
        return "failed"
    return "limit" if result == nlopt.MAXEVAL_REACHED else "converged"
