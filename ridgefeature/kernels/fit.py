"""One optimisation of one template by NLopt's C functions, called by address: no Python in the loop."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from ridgefeature.kernels.algebra import moved
from ridgefeature.kernels.appraise import prepared
from ridgefeature.kernels.objective import FREE

Floats = NDArray[np.float64]
Addresses = NDArray[np.int64]
C_FUNCTIONS = (
    "create", "destroy", "set_min_objective", "set_lower_bounds", "set_upper_bounds", "set_xtol_abs1",
    "set_ftol_rel", "set_maxeval", "optimize", "get_numevals",
)  # fmt: skip
"""Functions of nlopt.h, without their prefix, in the order in which `minimise` takes their addresses."""


def _calls(result: Any) -> Any:
    """A function that calls the C function at an address with a tuple of arguments; it returns `result`."""

    @intrinsic
    def call(typing: Any, address: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            kinds = [context.get_value_type(kind) for kind in signature.args[1]]
            kind = cgutils.ir.FunctionType(context.get_value_type(signature.return_type), kinds)
            function = builder.inttoptr(values[0], kind.as_pointer())
            return builder.call(function, cgutils.unpack_tuple(builder, values[1]))

        return result(address, arguments), generate

    return call


_number = _calls(types.int32)
_address = _calls(types.intp)


@njit(cache=True)
def minimise(
    c: Addresses, problem: Floats, low: Floats, high: Floats, tolerance: float, most: int, algorithm: int
) -> tuple[Floats, int, int]:
    """Minimise a packed problem (kernels.objective) from q = 0: q (7,), evaluations, NLopt's result.

    c: addresses of C_FUNCTIONS, then that of kernels.objective.callback. low, high (7,): bounds that hold 0.
    """
    q, least = np.zeros(FREE), np.zeros(1)
    handle = _address(c[0], (np.int32(algorithm), np.uint32(FREE)))
    _number(c[2], (handle, c[10], problem.ctypes.data))
    _number(c[3], (handle, low.ctypes.data))
    _number(c[4], (handle, high.ctypes.data))
    _number(c[5], (handle, tolerance))
    _number(c[6], (handle, tolerance * tolerance))
    _number(c[7], (handle, np.int32(most)))
    result = _number(c[8], (handle, q.ctypes.data, least.ctypes.data))
    evaluations = _number(c[9], (handle,))
    _number(c[1], (handle,))
    return q, evaluations, result


@njit(cache=True)
def bounds(
    height: float, width: float, transform: Floats, limits: tuple[float, float, float, float]
) -> tuple[Floats, Floats]:
    """Bounds (7,) of q that keep height and width within limits (low, high, narrow, wide); they hold 0."""
    low, high = np.full(FREE, -np.inf), np.full(FREE, np.inf)
    low[5] = min((limits[0] - height) / transform[6, 5], 0.0)
    high[5] = max((limits[1] - height) / transform[6, 5], 0.0)
    low[6] = min((limits[2] - width) / transform[7, 6], 0.0)
    high[6] = max((limits[3] - width) / transform[7, 6], 0.0)
    return low, high


@njit(cache=True)
def fit(
    c: Addresses,
    points: Floats,
    position: Floats,
    rotation: Floats,
    height: float,
    width: float,
    trend: Floats,
    table: Floats,
    floor: float,
    prior: Floats,
    loss: int,
    tuning: float,
    limits: tuple[float, float, float, float],
    tolerance: float,
    most: int,
    algorithm: int,
) -> tuple[Floats, Floats, float, float, int, int]:
    """Position, rotation, height and width after one optimisation from here, evaluations, NLopt's result.

    points (n, 3) in the template's frame; the rest as `prepared`, `bounds` and `minimise` take it.
    """
    _, transform, problem = prepared(points, height, width, trend, table, floor, prior, loss, tuning)
    low, high = bounds(height, width, transform, limits)
    q, evaluations, result = minimise(c, problem, low, high, tolerance, most, algorithm)
    if result < 0:
        return position, rotation, height, width, evaluations, result
    place, axes, new_height, new_width = moved(position, rotation, height, width, transform, q)
    return place, axes, new_height, new_width, evaluations, result
