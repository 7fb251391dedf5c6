"""What the page shows, drawn by VTK: scan points, templates, ridges, the place that is pointed at."""

from __future__ import annotations

from typing import Any

import numpy as np
import vtkmodules.vtkInteractionStyle
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  (makes the renderer)
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkRenderWindowInteractor,
)

from ridgefeature.curvilinear import crest
from ridgefeature.plot.marks import outline
from ridgefeature.ridge import Ridge
from ridgefeature.template import Template
from ridgefeature.viewer.picking import picked, thinned

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]
STILL, MOVING = 400_000, 60_000
"""Most scan points that are drawn at rest, and while the view turns: all others are there for the fit."""
_SURFACE, _CHOSEN, _CREST, _TEMPLATE = (
    (0.75, 0.55, 0.25),
    (0.96, 0.62, 0.04),
    (0.86, 0.15, 0.15),
    (0.1, 0.1, 0.1),
)
_ACROSS, _A_STATION = 31, 2


class Scene:
    """Actors by name in one renderer; the camera is VTK's."""

    def __init__(self) -> None:
        self.renderer, self.window = vtkRenderer(), vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.AddRenderer(self.renderer)
        self.interactor = vtkRenderWindowInteractor()
        self.interactor.SetRenderWindow(self.window)
        self.interactor.GetInteractorStyle().SetCurrentStyleToTrackballCamera()
        self.points: Array = np.empty((0, 3))
        self._actors: dict[str, vtkActor] = {}
        self.interactor.AddObserver("StartInteractionEvent", lambda *_: self._coarse(True))
        self.interactor.AddObserver("EndInteractionEvent", lambda *_: self._coarse(False))

    def show_points(self, points: Array, colours: Pixels) -> None:
        """The scan (n, 3) and its colours (n, 3); the camera looks at all of it."""
        self.points = points
        self.renderer.RemoveAllViewProps()
        self._actors.clear()
        for name, most in (("still", STILL), ("moving", MOVING)):
            kept = thinned(len(points), most)
            data = _vertices(points[kept])
            data.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(colours[kept]), deep=True))
            look = self._show(name, data).GetProperty()
            look.LightingOff()
            look.SetPointSize(2.0 if len(kept) > 50_000 else 3.0)
        self._coarse(False)
        self.fit()

    def paint_points(self, colours: Pixels) -> None:
        """Other colours (n, 3) for the scan."""
        for name, most in (("still", STILL), ("moving", MOVING)):
            if name in self._actors:
                data = self._actors[name].GetMapper().GetInput().GetPointData()
                kept = thinned(len(self.points), most)
                data.SetScalars(numpy_to_vtk(np.ascontiguousarray(colours[kept]), deep=True))

    def show_ridge(self, name: str, ridge: Ridge, chosen: bool) -> None:
        """Its surface and crest; a surface of the same size only gets other points."""
        grid = ridge.surface().grid(_A_STATION * len(ridge.arc_length), _ACROSS)
        surface, line = f"surface {name}", f"crest {name}"
        known = self._actors.get(surface)
        if known is not None and known.GetMapper().GetInput().GetNumberOfPoints() == grid[..., 0].size:
            _move(known, grid.reshape(-1, 3))
        else:
            self._show(surface, _quads(grid))
        look = self._actors[surface].GetProperty()
        look.SetColor(*(_CHOSEN if chosen else _SURFACE))
        look.SetOpacity(0.85)
        self._line(line, crest(ridge), _CREST, 3.0)

    def show_template(self, template: Template, number: int) -> None:
        self._line(f"template {number}", outline(template), _TEMPLATE, 1.5)

    def mark(self, place: Array | None, name: str = "mark", size: float = 10.0) -> None:
        """A dot at a place (3,); None: no dot."""
        if place is None:
            self.hide(name)
            return
        look = self._show(name, _vertices(np.asarray(place, dtype=float)[None])).GetProperty()
        look.SetPointSize(size)
        look.SetColor(*_CREST)
        look.LightingOff()
        look.RenderPointsAsSpheresOn()

    def hide(self, prefix: str) -> None:
        """All whose names begin so."""
        for name in [n for n in self._actors if n.startswith(prefix)]:
            self.renderer.RemoveActor(self._actors.pop(name))

    def names(self) -> list[str]:
        return sorted(self._actors)

    def fit(self) -> None:
        """Look at all that is there."""
        self.renderer.ResetCamera()

    def pick(self, x: float, y: float) -> int | None:
        """The number of the scan point under a place on the screen, in pixels from the lower left."""
        camera = self.renderer.GetActiveCamera()
        self.renderer.ResetCameraClippingRange()
        width, height = self.window.GetSize()
        matrix = camera.GetCompositeProjectionTransformMatrix(width / max(height, 1), -1.0, 1.0)
        own = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
        return picked(self.points, own, (width, height), (x, y))

    def on_screen(self, place: Array) -> tuple[float, float]:
        """Where a place (3,) of the scan is seen, in pixels from the lower left."""
        self.renderer.SetWorldPoint([*map(float, place), 1.0])
        self.renderer.WorldToDisplay()
        x, y, _ = self.renderer.GetDisplayPoint()
        return float(x), float(y)

    def _coarse(self, moving: bool) -> None:
        for name, shown in (("still", not moving), ("moving", moving)):
            if name in self._actors:
                self._actors[name].SetVisibility(shown)

    def _line(self, name: str, line: Array, colour: tuple[float, float, float], width: float) -> None:
        data = _vertices(line)
        data.SetVerts(vtkCellArray())
        cells = vtkCellArray()
        cells.InsertNextCell(len(line), list(range(len(line))))
        data.SetLines(cells)
        look = self._show(name, data).GetProperty()
        look.SetColor(*colour)
        look.SetLineWidth(width)
        look.LightingOff()

    def _show(self, name: str, data: vtkPolyData) -> vtkActor:
        self.hide(name)
        mapper, actor = vtkPolyDataMapper(), vtkActor()
        mapper.SetInputData(data)
        actor.SetMapper(mapper)
        self.renderer.AddActor(actor)
        self._actors[name] = actor
        return actor


def by_height(points: Array) -> Pixels:
    """Colours (n, 3) by height over the plane of least squares, from the lowest to the highest 1 %."""
    centred = points - points.mean(axis=0)
    normal = np.linalg.eigh(centred.T @ centred)[1][:, 0]
    normal = normal * (np.sign(normal[np.argmax(np.abs(normal))]) or 1.0)
    return ramp(centred @ normal)


def ramp(values: Array) -> Pixels:
    """Colours (n, 3) from violet over green to yellow, from the lowest to the highest 1 %; grey where NaN."""
    out = np.full((len(values), 3), 190, dtype=np.uint8)
    known = np.isfinite(values)
    if known.any():
        low, high = np.quantile(values[known], [0.01, 0.99])
        part = np.clip((values[known] - low) / max(high - low, 1e-300), 0.0, 1.0)
        stops = np.array([[68, 1, 84], [49, 104, 142], [53, 183, 121], [253, 231, 37]], dtype=float)
        at = np.linspace(0.0, 1.0, len(stops))
        out[known] = np.column_stack([np.interp(part, at, c) for c in stops.T]).round().astype(np.uint8)
    return out


def _vertices(points: Array) -> vtkPolyData:
    data, places, cells = vtkPolyData(), vtkPoints(), vtkCellArray()
    places.SetData(numpy_to_vtk(np.ascontiguousarray(points, dtype=float), deep=True))
    data.SetPoints(places)
    cells.SetData(1, numpy_to_vtkIdTypeArray(np.arange(len(points), dtype=np.int64), deep=True))
    data.SetVerts(cells)
    return data


def _quads(grid: Array) -> vtkPolyData:
    nu, nv = grid.shape[:2]
    index = np.arange(nu * nv).reshape(nu, nv)
    corners = [index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]]
    data = _vertices(grid.reshape(-1, 3))
    data.SetVerts(vtkCellArray())
    cells = vtkCellArray()
    ravelled = np.stack([c.ravel() for c in corners], axis=1).ravel()
    cells.SetData(4, numpy_to_vtkIdTypeArray(np.ascontiguousarray(ravelled, dtype=np.int64), deep=True))
    data.SetPolys(cells)
    return data


def _move(actor: Any, points: Array) -> None:
    """Other places for the points of what an actor shows."""
    held = actor.GetMapper().GetInput().GetPoints()
    vtk_to_numpy(held.GetData())[:] = points
    held.Modified()
