"""A shaded picture of a CAD part with its ridges in another colour, drawn by VTK without a display."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cadquery as cq
import numpy as np
from PIL import Image

import cad_export as cx

HOST, RIDGE, EDGE = (0.78, 0.83, 0.89), (1.0, 0.66, 0.16), (0.16, 0.19, 0.25)
OVERSAMPLING = 3


def draw(part: cq.Shape, file: Path, toward: tuple[float, float, float], size: tuple[int, int]) -> None:
    """Write a PNG of size (width, height) of the part, seen from the direction `toward`, z up."""
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  (makes the renderer)
    from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow

    renderer = vtkRenderer()
    renderer.SetBackground(1.0, 1.0, 1.0)
    ridges = [face for face, _ in cx.carried_by(part)]
    for face in part.Faces():
        grown = any(face.wrapped.IsSame(ridge) for ridge in ridges)
        _add_face(renderer, face, RIDGE if grown else HOST)
    for edge in part.Edges():
        _add_edge(renderer, edge)
    _aim(renderer, toward, size)
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(OVERSAMPLING * size[0], OVERSAMPLING * size[1])
    window.AddRenderer(renderer)
    Image.fromarray(_pixels(window)).save(file)


def _add_face(renderer: Any, face: cq.Face, colour: tuple[float, ...]) -> None:
    from vtkmodules.vtkFiltersCore import vtkPolyDataNormals

    normals = vtkPolyDataNormals()
    normals.SetInputData(face.toVtkPolyData(0.003, 0.03))
    normals.SplittingOff()
    normals.Update()
    look = _actor(renderer, normals.GetOutput()).GetProperty()
    look.SetColor(*colour)
    look.SetAmbient(0.25)
    look.SetDiffuse(0.75)
    look.SetSpecular(0.25)
    look.SetSpecularPower(30)


def _add_edge(renderer: Any, edge: cq.Edge) -> None:
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    line = np.array([p.toTuple() for p in edge.positions(np.linspace(0.0, 1.0, 200))])
    data, places, cells = vtkPolyData(), vtkPoints(), vtkCellArray()
    places.SetData(numpy_to_vtk(line, deep=True))
    data.SetPoints(places)
    cells.InsertNextCell(len(line))
    for i in range(len(line)):
        cells.InsertCellPoint(i)
    data.SetLines(cells)
    actor = _actor(renderer, data)
    look = actor.GetProperty()
    look.LightingOff()
    look.SetColor(*EDGE)
    look.SetLineWidth(1.1 * OVERSAMPLING)
    # towards the eye, or half of the line would be hidden by its own faces
    actor.GetMapper().SetResolveCoincidentTopologyToPolygonOffset()
    actor.GetMapper().SetRelativeCoincidentTopologyLineOffsetParameters(0.0, -4.0)


def _actor(renderer: Any, data: Any) -> Any:
    from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

    mapper, actor = vtkPolyDataMapper(), vtkActor()
    mapper.SetInputData(data)
    mapper.ScalarVisibilityOff()
    actor.SetMapper(mapper)
    renderer.AddActor(actor)
    return actor


def _aim(renderer: Any, toward: tuple[float, float, float], size: tuple[int, int]) -> None:
    from vtkmodules.vtkRenderingCore import vtkLight

    eye = renderer.GetActiveCamera()
    eye.ParallelProjectionOn()
    eye.SetFocalPoint(0.0, 0.0, 0.0)
    eye.SetPosition(*toward)
    eye.SetViewUp(0.0, 0.0, 1.0)
    renderer.ResetCamera()
    eye.SetParallelScale(_half_height(renderer, eye, size[0] / size[1]))
    renderer.ResetCameraClippingRange()
    renderer.RemoveAllLights()
    for place, strength in (((-1.0, 0.9, 0.3), 0.95), ((0.3, 0.2, 1.0), 0.65)):
        light = vtkLight()
        light.SetLightTypeToCameraLight()
        light.SetPosition(*place)
        light.SetIntensity(strength)
        renderer.AddLight(light)


def _half_height(renderer: Any, eye: Any, aspect: float) -> float:
    """Half the picture's height in millimetres, with which all of the part's box is seen."""
    box = np.array(renderer.ComputeVisiblePropBounds()).reshape(3, 2)
    corners = np.stack(np.meshgrid(*box), -1).reshape(-1, 3) - eye.GetFocalPoint()
    forward = np.array(eye.GetDirectionOfProjection())
    up = np.array(eye.GetViewUp())
    up = up - (up @ forward) * forward
    up /= np.linalg.norm(up)
    right = np.cross(forward, up)
    return 1.03 * float(max(np.abs(corners @ up).max(), np.abs(corners @ right).max() / aspect))


def _pixels(window: Any) -> Any:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

    window.Render()
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    grab.ShouldRerenderOff()
    grab.Update()
    width, height = window.GetSize()
    image = vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars()).reshape(height, width, -1)
    window.Finalize()
    return np.ascontiguousarray(image[::-1, :, :3])
