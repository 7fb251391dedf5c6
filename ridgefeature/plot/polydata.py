"""Points, lines and surfaces as VTK keeps them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

Array = NDArray[np.float64]
Corners = NDArray[np.int64]


def vertices(points: Array) -> vtkPolyData:
    """A dot at each of the points (n, 3)."""
    data = _points(points)
    data.SetVerts(_cells(np.arange(len(points))[:, None]))
    return data


def line(points: Array) -> vtkPolyData:
    """A line through points (n, 3)."""
    data = _points(points)
    data.SetLines(_cells(np.arange(len(points))[None]))
    return data


def triangles(points: Array, corners: Corners) -> vtkPolyData:
    """A mesh of triangles (m, 3) over points (n, 3)."""
    data = _points(points)
    data.SetPolys(_cells(corners))
    return data


def smooth(mesh: vtkPolyData) -> vtkPolyData:
    """A mesh with normals at its points, so that light does not show its triangles; edges are twice there."""
    normals = vtkPolyDataNormals()
    normals.SetInputData(mesh)
    normals.SplittingOff()
    normals.ConsistencyOff()
    normals.Update()
    return normals.GetOutput()


def quads(grid: Array) -> vtkPolyData:
    """A surface with its points on a grid (nu, nv, 3)."""
    nu, nv = grid.shape[:2]
    index = np.arange(nu * nv).reshape(nu, nv)
    corners = [index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]]
    data = _points(grid.reshape(-1, 3))
    data.SetPolys(_cells(np.stack([c.ravel() for c in corners], axis=1)))
    return data


def paint(data: vtkPolyData, colours: NDArray[np.uint8]) -> None:
    """Give points (n,) colours (n, 3)."""
    data.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(colours), deep=True))


def move(actor: Any, points: Array) -> None:
    """Other places (n, 3) for the points of what an actor shows."""
    held = actor.GetMapper().GetInput().GetPoints()
    vtk_to_numpy(held.GetData())[:] = points
    held.Modified()


def actor_in(renderer: Any, data: vtkPolyData) -> vtkActor:
    """Have a renderer show it."""
    mapper, actor = vtkPolyDataMapper(), vtkActor()
    mapper.SetInputData(data)
    actor.SetMapper(mapper)
    renderer.AddActor(actor)
    return actor


def _points(points: Array) -> vtkPolyData:
    data, places = vtkPolyData(), vtkPoints()
    places.SetData(numpy_to_vtk(np.ascontiguousarray(points, dtype=float), deep=True))
    data.SetPoints(places)
    return data


def _cells(corners: Corners) -> vtkCellArray:
    """Cells (m, k) of k corners each."""
    count, per = corners.shape
    cells = vtkCellArray()
    ends = numpy_to_vtkIdTypeArray(np.arange(0, count * per + 1, per, dtype=np.int64), deep=True)
    cells.SetData(ends, numpy_to_vtkIdTypeArray(np.ascontiguousarray(corners, np.int64).ravel(), deep=True))
    return cells
