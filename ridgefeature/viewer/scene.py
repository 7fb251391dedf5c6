"""What the page shows, drawn by VTK: scan points, templates, ridges, the place that is pointed at."""

from __future__ import annotations

from typing import Any

import numpy as np
import vtkmodules.vtkInteractionStyle
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  (makes the renderer)
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkCamera,
    vtkCellPicker,
    vtkRenderer,
    vtkRenderWindow,
    vtkRenderWindowInteractor,
)

from ridgefeature.curvilinear import crest
from ridgefeature.plot.marks import outline
from ridgefeature.plot.polydata import actor_in, line, move, paint, quads, smooth, triangles, vertices
from ridgefeature.ridge import Ridge
from ridgefeature.template import Template
from ridgefeature.viewer.colours import Pixels, plane_axes
from ridgefeature.viewer.picking import picked, thinned

Array = NDArray[np.float64]
STILL, MOVING = 400_000, 40_000
"""Most scan points that are drawn at rest, and while something moves: all others are there for the fit."""
_SURFACE, _CHOSEN, _CREST, _TEMPLATE = (
    (0.75, 0.55, 0.25),
    (0.96, 0.62, 0.04),
    (0.86, 0.15, 0.15),
    (0.15, 0.45, 0.95),
)
_PART = (0.72, 0.76, 0.8)
_FAINT = 0.15
_FRONT = -700.0
"""By how much ridges are drawn in front of where they are, in 2^-16 of the depth: points lie in them."""
_ACROSS, _A_STATION = 31, 2
_LIGHT, _DARK = (1.0, 1.0, 1.0), (0.09, 0.1, 0.12)


class Scene:
    """Actors by name in one renderer; the camera is VTK's, without perspective."""

    def __init__(self) -> None:
        vtkObject.GlobalWarningDisplayOff()  # without a display it says so, and goes on
        self.renderer, self.window = vtkRenderer(), vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(0)  # without a graphics card, points take thrice the time with them
        self.window.SetSize(900, 500)
        self.window.AddRenderer(self.renderer)
        self.interactor = vtkRenderWindowInteractor()
        self.interactor.SetRenderWindow(self.window)
        self.interactor.GetInteractorStyle().SetCurrentStyleToTrackballCamera()
        self.renderer.GetActiveCamera().ParallelProjectionOn()
        self.still: Array = np.empty((0, 3))
        """(m, 3) those points of the scan that are drawn at rest."""
        self._actors: dict[str, vtkActor] = {}
        self._camera: vtkCamera | None = None
        self._only_part = False
        self.faint = False
        """Whether ridges let the points' colours through."""
        self.interactor.AddObserver("StartInteractionEvent", lambda *_: self.coarse(True))
        self.interactor.AddObserver("EndInteractionEvent", lambda *_: self.coarse(False))
        self.dark(False)

    def dark(self, dark: bool) -> None:
        """A dark background, or a light one."""
        self.renderer.SetBackground(*(_DARK if dark else _LIGHT))

    def show_points(self, points: Array) -> None:
        """The scan (n, 3); nothing else is shown any more, and the camera looks at all of it."""
        self._only_part = False
        self.renderer.RemoveAllViewProps()
        self._actors.clear()
        self.still = points[thinned(len(points), STILL)]
        for name, own in (("still", self.still), ("moving", self._few(self.still))):
            look = self._show(name, vertices(own)).GetProperty()
            look.LightingOff()
            look.SetPointSize(2.0 if len(self.still) > 50_000 else 3.0)
        self.coarse(False)
        self.from_above()

    def paint(self, colours: Pixels) -> None:
        """Other colours (m, 3) for the points that are drawn."""
        for name, own in (("still", colours), ("moving", self._few(colours))):
            if name in self._actors:
                paint(self._actors[name].GetMapper().GetInput(), own)

    def _few(self, rows: NDArray[Any]) -> NDArray[Any]:
        return rows[thinned(len(rows), MOVING)]

    def show_ridge(self, name: str, ridge: Ridge, chosen: bool) -> None:
        """Its surface and crest; a surface of the same size only gets other points."""
        grid = ridge.surface().grid(_A_STATION * len(ridge.arc_length), _ACROSS)
        surface = f"surface {name}"
        known = self._actors.get(surface)
        if known is not None and known.GetMapper().GetInput().GetNumberOfPoints() == grid[..., 0].size:
            move(known, grid.reshape(-1, 3))
        else:
            self._show(surface, quads(grid))
        look = self._actors[surface].GetProperty()
        look.SetColor(*(_CHOSEN if chosen else _SURFACE))
        look.SetOpacity(_FAINT if self.faint else 0.9)
        look.SetAmbient(0.35)
        look.SetDiffuse(0.65)
        self._line(f"crest {name}", crest(ridge), _CREST, 3.0)
        self._forward(surface, _FRONT)
        self._forward(f"crest {name}", 2.0 * _FRONT)

    def _forward(self, name: str, shift: float) -> None:
        mapper = self._actors[name].GetMapper()
        mapper.SetResolveCoincidentTopologyToPolygonOffset()
        mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(0.0, shift)
        mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, shift)
        mapper.SetRelativeCoincidentTopologyPointOffsetParameter(shift)

    def hide_ridge(self, name: str) -> None:
        for own in (f"surface {name}", f"crest {name}"):
            self._drop(own)

    def show_part(self, points: Array, corners: NDArray[np.int64], grown: NDArray[np.int64]) -> None:
        """A solid: triangles (m, 3) of its own, and of a ridge on it (k, 3). All else is hidden."""
        for name, own, colour in (("part", corners, _PART), ("part ridge", grown, _CHOSEN)):
            look = self._show(name, smooth(triangles(points, own))).GetProperty()
            look.SetColor(*colour)
            look.SetAmbient(0.35)
            look.SetDiffuse(0.65)
        self.only_part(True)

    def look_at_part(self, points: Array, grown: NDArray[np.int64]) -> None:
        """Look at a solid from where its ridge (triangles) is seen."""
        a, b, c = (points[grown[:, k]] for k in range(3))
        outwards = np.cross(b - a, c - a).sum(axis=0)
        eye = outwards / max(float(np.linalg.norm(outwards)), 1e-300)
        up = np.eye(3)[2 if abs(eye[2]) < 0.9 else 1]
        eye = eye - 0.45 * np.eye(3)[1] if abs(eye[2]) >= 0.9 else eye + 0.3 * up
        camera, middle = self.renderer.GetActiveCamera(), points.mean(axis=0)
        camera.SetFocalPoint(*middle)
        camera.SetPosition(*(middle + eye))
        camera.SetViewUp(*up)
        self.fit()

    def pick_part(self, across: float, down: float) -> Array | None:
        """The place (3,) on the solid under a place on the screen, as for `pick`."""
        picker = vtkCellPicker()
        picker.PickFromListOn()
        for name in ("part", "part ridge"):
            if name in self._actors:
                picker.AddPickList(self._actors[name])
        width, height = self.window.GetSize()
        hit = picker.Pick(across * width, (1.0 - down) * height, 0.0, self.renderer)
        return np.array(picker.GetPickPosition()) if hit else None

    def keep_camera(self) -> None:
        """Remember where the camera is."""
        self._camera = vtkCamera()
        self._camera.DeepCopy(self.renderer.GetActiveCamera())

    def restore_camera(self) -> None:
        """Put it back there."""
        if self._camera is not None:
            self.renderer.GetActiveCamera().DeepCopy(self._camera)
            self.renderer.GetActiveCamera().Modified()  # which a copy does not tell
            self.renderer.ResetCameraClippingRange()

    def only_part(self, only: bool) -> None:
        """Show nothing but the solid, or all but it."""
        self._only_part = only
        for name, actor in self._actors.items():
            actor.SetVisibility(name.startswith("part") == only)
        if not only:
            self.coarse(False)

    def show_template(self, template: Template, number: int) -> None:
        self._line(f"template {number}", outline(template), _TEMPLATE, 2.0)
        self._forward(f"template {number}", 2.0 * _FRONT)

    def mark(self, place: Array | None, name: str = "mark", size: float = 10.0) -> None:
        """A dot at a place (3,); None: no dot."""
        if place is None:
            self._drop(name)
            return
        look = self._show(name, vertices(np.asarray(place, dtype=float)[None])).GetProperty()
        look.SetPointSize(size)
        look.SetColor(*_CREST)
        look.LightingOff()
        look.RenderPointsAsSpheresOn()
        self._forward(name, 3.0 * _FRONT)

    def hide(self, prefix: str) -> None:
        """All whose names begin so."""
        for name in [n for n in self._actors if n.startswith(prefix)]:
            self._drop(name)

    def _drop(self, name: str) -> None:
        if name in self._actors:
            self.renderer.RemoveActor(self._actors.pop(name))

    def names(self) -> list[str]:
        return sorted(self._actors)

    def fit(self) -> None:
        """Look at all that is there, from where the camera is."""
        self.renderer.ResetCamera()

    def from_above(self) -> None:
        """Look down on the scan's best plane, a little from the side; its longer way is across."""
        if not len(self.still):
            return
        axes = plane_axes(self.still)
        eye = 0.9 * axes[2] - 0.45 * axes[1]
        camera, middle = self.renderer.GetActiveCamera(), self.still.mean(axis=0)
        camera.SetFocalPoint(*middle)
        camera.SetPosition(*(middle + eye))
        camera.SetViewUp(*axes[1])
        self.fit()

    def turn(self, azimuth: float, elevation: float) -> None:
        """Orbit by so many degrees."""
        camera = self.renderer.GetActiveCamera()
        camera.Azimuth(azimuth)
        camera.Elevation(elevation)
        camera.OrthogonalizeViewUp()
        self.renderer.ResetCameraClippingRange()

    def zoom(self, factor: float) -> None:
        self.renderer.GetActiveCamera().Zoom(factor)

    def pan(self, right: float, up: float) -> None:
        """Move the view by parts of the picture's height."""
        camera = self.renderer.GetActiveCamera()
        above, away = np.array(camera.GetViewUp()), np.array(camera.GetDirectionOfProjection())
        aside = np.cross(away, above)
        shift = 2.0 * camera.GetParallelScale() * (right * aside / np.linalg.norm(aside) + up * above)
        camera.SetFocalPoint(*(np.array(camera.GetFocalPoint()) + shift))
        camera.SetPosition(*(np.array(camera.GetPosition()) + shift))
        self.renderer.ResetCameraClippingRange()

    def length_of_pixel(self) -> float:
        """In the scan's unit: the same all over the picture."""
        return float(
            2.0 * self.renderer.GetActiveCamera().GetParallelScale() / max(self.window.GetSize()[1], 1)
        )

    def pick(self, across: float, down: float, coarsely: bool = False) -> Array | None:
        """The scan point (3,) under a place on the screen, in parts of the picture from its upper left.

        coarsely: only points that are drawn while something moves are looked at.
        """
        camera = self.renderer.GetActiveCamera()
        self.renderer.ResetCameraClippingRange()
        width, height = self.window.GetSize()
        matrix = camera.GetCompositeProjectionTransformMatrix(width / max(height, 1), -1.0, 1.0)
        own = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
        points = self._few(self.still) if coarsely else self.still
        found = picked(points, own, (width, height), (across * width, (1.0 - down) * height))
        return None if found is None else points[found]

    def on_screen(self, place: Array) -> tuple[float, float]:
        """Where a place (3,) of the scan is seen, in parts of the picture from its upper left."""
        self.renderer.SetWorldPoint([*map(float, place), 1.0])
        self.renderer.WorldToDisplay()
        x, y, _ = self.renderer.GetDisplayPoint()
        width, height = self.window.GetSize()
        return float(x) / width, 1.0 - float(y) / height

    def coarse(self, moving: bool) -> None:
        """Draw few points, as long as something moves, or all."""
        for name, shown in (("still", not moving), ("moving", moving)):
            if name in self._actors:
                self._actors[name].SetVisibility(shown and not self._only_part)

    def _line(self, name: str, places: Array, colour: tuple[float, float, float], width: float) -> None:
        look = self._show(name, line(places)).GetProperty()
        look.SetColor(*colour)
        look.SetLineWidth(width)
        look.LightingOff()

    def _show(self, name: str, data: vtkPolyData) -> vtkActor:
        self._drop(name)
        self._actors[name] = actor_in(self.renderer, data)
        return self._actors[name]
