"""numpy arrays to and from OCCT's array containers: the one place that names them (OCP 8 renames them)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from OCP.gp import gp_Pnt
from OCP.TColgp import TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal

Floats = NDArray[np.float64]


def points2(poles: Floats) -> TColgp_Array2OfPnt:
    """poles (nu, nv, 3) as an OCCT array of points, indices from 1."""
    nu, nv, _ = poles.shape
    array = TColgp_Array2OfPnt(1, nu, 1, nv)
    for i, row in enumerate(poles.tolist(), 1):
        for j, (x, y, z) in enumerate(row, 1):
            array.SetValue(i, j, gp_Pnt(x, y, z))
    return array


def reals(values: Floats) -> TColStd_Array1OfReal:
    """values (n,) as an OCCT array, indices from 1."""
    array = TColStd_Array1OfReal(1, len(values))
    for i, x in enumerate(values.tolist(), 1):
        array.SetValue(i, x)
    return array


def integers(values: NDArray[np.integer]) -> TColStd_Array1OfInteger:
    """values (n,) as an OCCT array, indices from 1."""
    array = TColStd_Array1OfInteger(1, len(values))
    for i, x in enumerate(values.tolist(), 1):
        array.SetValue(i, x)
    return array
