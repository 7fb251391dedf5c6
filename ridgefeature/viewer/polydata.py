"""Points, lines and surfaces as VTK keeps them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

Array = NDArray[np.float64]


def vertices(points: Array) -> vtkPolyData:
    data, places, cells = vtkPolyData(), vtkPoints(), vtkCellArray()
    places.SetData(numpy_to_vtk(np.ascontiguousarray(points, dtype=float), deep=True))
    data.SetPoints(places)
    cells.SetData(1, numpy_to_vtkIdTypeArray(np.arange(len(points), dtype=np.int64), deep=True))
    data.SetVerts(cells)
    return data


def quads(grid: Array) -> vtkPolyData:
    nu, nv = grid.shape[:2]
    index = np.arange(nu * nv).reshape(nu, nv)
    corners = [index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]]
    data = vertices(grid.reshape(-1, 3))
    data.SetVerts(vtkCellArray())
    cells = vtkCellArray()
    ravelled = np.stack([c.ravel() for c in corners], axis=1).ravel()
    cells.SetData(4, numpy_to_vtkIdTypeArray(np.ascontiguousarray(ravelled, dtype=np.int64), deep=True))
    data.SetPolys(cells)
    return data


def move(actor: Any, points: Array) -> None:
    """Other places for the points of what an actor shows."""
    held = actor.GetMapper().GetInput().GetPoints()
    vtk_to_numpy(held.GetData())[:] = points
    held.Modified()


def line(points: Array) -> vtkPolyData:
    """A line through points (n, 3)."""
    data, cells = vertices(points), vtkCellArray()
    data.SetVerts(vtkCellArray())
    cells.InsertNextCell(len(points), list(range(len(points))))
    data.SetLines(cells)
    return data


def triangles(points: Array, corners: NDArray[np.int64]) -> vtkPolyData:
    """A mesh of triangles (m, 3) over points (n, 3)."""
    data, cells = vertices(points), vtkCellArray()
    data.SetVerts(vtkCellArray())
    cells.SetData(
        3, numpy_to_vtkIdTypeArray(np.ascontiguousarray(corners.ravel(), dtype=np.int64), deep=True)
    )
    data.SetPolys(cells)
    return data
