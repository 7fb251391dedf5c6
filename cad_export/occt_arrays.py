"""numpy arrays to and from OCCT's array containers: the one place that names them (OCP 8 renames them)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from OCP.Geom import Geom_BSplineSurface
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.StepRepr import StepRepr_HArray1OfRepresentationItem, StepRepr_RepresentationItem
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array1OfPnt2d, TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal
from OCP.TDF import TDF_LabelSequence
from OCP.TopTools import TopTools_IndexedMapOfShape

Floats = NDArray[np.float64]


def points2(poles: Floats) -> TColgp_Array2OfPnt:
    """poles (nu, nv, 3) as an OCCT array of points, indices from 1."""
    nu, nv, _ = poles.shape
    array = TColgp_Array2OfPnt(1, nu, 1, nv)
    for i, row in enumerate(poles.tolist(), 1):
        for j, (x, y, z) in enumerate(row, 1):
            array.SetValue(i, j, gp_Pnt(x, y, z))
    return array


def points1(poles: Floats) -> TColgp_Array1OfPnt:
    """poles (n, 3) as an OCCT array of points, indices from 1."""
    array = TColgp_Array1OfPnt(1, len(poles))
    for i, (x, y, z) in enumerate(poles.tolist(), 1):
        array.SetValue(i, gp_Pnt(x, y, z))
    return array


def points1_2d(poles: Floats) -> TColgp_Array1OfPnt2d:
    """poles (n, 2) as an OCCT array of points of a plane, indices from 1."""
    array = TColgp_Array1OfPnt2d(1, len(poles))
    for i, (x, y) in enumerate(poles.tolist(), 1):
        array.SetValue(i, gp_Pnt2d(x, y))
    return array


@lru_cache(64)  # many curves and surfaces have the same
def knots(repeated: bytes) -> tuple[TColStd_Array1OfReal, TColStd_Array1OfInteger]:
    """The single knots and how often each comes, as OCCT arrays; of float64 knots with repeats."""
    single, counts = np.unique(np.frombuffer(repeated), return_counts=True)
    values, times = TColStd_Array1OfReal(1, len(single)), TColStd_Array1OfInteger(1, len(single))
    for i, (x, n) in enumerate(zip(single.tolist(), counts.tolist(), strict=True), 1):
        values.SetValue(i, x)
        times.SetValue(i, n)
    return values, times


def pole_array(geometry: Geom_BSplineSurface) -> Floats:
    """The poles (nu, nv, 3) of an OCCT surface."""
    g = geometry
    points = [[g.Pole(i, j) for j in range(1, g.NbVPoles() + 1)] for i in range(1, g.NbUPoles() + 1)]
    return np.array([[(p.X(), p.Y(), p.Z()) for p in row] for row in points])


def representation_items(
    items: Sequence[StepRepr_RepresentationItem],
) -> StepRepr_HArray1OfRepresentationItem:
    """STEP entities as an OCCT array, indices from 1."""
    array = StepRepr_HArray1OfRepresentationItem(1, len(items))
    for i, item in enumerate(items, 1):
        array.SetValue(i, item)
    return array


def shape_map() -> TopTools_IndexedMapOfShape:
    """An empty map of shapes, which keeps the order they come in."""
    return TopTools_IndexedMapOfShape()


def label_sequence() -> TDF_LabelSequence:
    """An empty sequence of labels of an OCAF document."""
    return TDF_LabelSequence()
