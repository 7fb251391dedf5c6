"""What a view shows, as arrays; and its picture, drawn by VTK without a display."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ridgefeature.curvilinear import crest, local_coordinates, over_base, templates_on, thinned
from ridgefeature.plot.camera import Camera
from ridgefeature.plot.marks import outline
from ridgefeature.ridge import Ridge

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

SURFACE, SPINE, TEMPLATE = "#f59e0b", "#dc2626", "#111827"
_CREST = "#ffc65c"
MOST = 200_000
OVERSAMPLING = 2
_ACROSS = 61


@dataclass(frozen=True)
class Scene:
    """points (n, 3) of the scan near the ridge, their heights (n,) over the base and whether (n,) they lie on
    the ridge's surface; the surface as a grid (nu, nv, 3) with its normals and,
    across it, its height (nv,) in apex heights; the crest and the outlines of
    templates as lines (m, 3); noise: how far points usually lie off the surface."""

    points: Array
    heights: Array
    on_ridge: NDArray[np.bool_]
    surface: Array
    normals: Array
    rise: Array
    crest: Array
    outlines: list[Array]
    noise: float


def build(ridge: Ridge, points: Array) -> Scene:
    """The scene of a ridge in scan points (n, 3); far points are left out, at most MOST are kept."""
    surface = ridge.surface()
    grid = surface.grid(8 * len(ridge.arc_length), _ACROSS)
    u, v = np.gradient(grid, axis=0), np.gradient(grid, axis=1)
    normals = np.cross(u, v)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-300)
    near = thinned(_around(points, grid), MOST)
    s, y, z = local_coordinates(ridge, near)
    on_ridge = (s >= 0) & (s <= ridge.length) & (np.abs(y) <= np.interp(s, ridge.arc_length, ridge.border))
    return Scene(
        near,
        over_base(ridge, s, y, z),
        on_ridge,
        grid,
        normals,
        ridge.section(np.linspace(*surface.domain[1], _ACROSS)),
        crest(ridge),
        _outlines(ridge),
        float(np.median([t.scale for t in ridge.templates])),
    )


def _outlines(ridge: Ridge) -> list[Array]:
    """Of the templates that are part of the finished ridge, cut off at its ends."""
    templates, places = templates_on(ridge)
    if ridge.closed:
        return [outline(t) for t in templates]
    return [outline(t, s, ridge.length - s) for t, s in zip(templates, places, strict=True)]


def _around(points: Array, grid: Array) -> Array:
    """The points in a box about the ridge, large enough to fill a picture of it."""
    low, high = grid.min(axis=(0, 1)), grid.max(axis=(0, 1))
    room = 0.6 * (high - low).max()
    return points[((points >= low - room) & (points <= high + room)).all(axis=1)]


def render(scene: Scene, camera: Camera, colours: Pixels, size: tuple[int, int], solid: bool) -> Pixels:
    """Pixels (height, width, 3) of the scene. size: width, height.

    colours (n, 3): of the points. solid: with the ridge's surface, and hidden parts hidden; else scan and
    lines alone, the lines in front. Raises ImportError where VTK is not installed.
    """
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  (makes the renderer)
    from vtkmodules.vtkCommonCore import vtkObject
    from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow

    vtkObject.GlobalWarningDisplayOff()
    renderer = vtkRenderer()
    renderer.SetBackground(1.0, 1.0, 1.0)
    depth = max(camera.half_width, camera.half_height)
    dot = _dot(scene, camera, size)
    _add_points(renderer, scene, colours, dot)
    # Moved towards the eye nothing changes its place in a parallel picture, but neither noise nor the breadth
    # of a dot hides it any more.
    lift = camera.toward * (min(5 * scene.noise, 0.05 * depth) + 1.4 * dot * camera.half_width / size[0])
    if solid:
        _add_surface(renderer, scene, lift)
    lift = lift + camera.toward * (0.006 if solid else 2.0) * depth
    for line in scene.outlines:
        _add_line(renderer, line + lift, TEMPLATE, 1.6 * OVERSAMPLING)
    _add_line(renderer, scene.crest + lift + camera.toward * 0.002 * depth, SPINE, 4.0 * OVERSAMPLING)
    _aim(renderer, camera)
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(4)
    window.SetSize(OVERSAMPLING * size[0], OVERSAMPLING * size[1])
    window.AddRenderer(renderer)
    return _pixels(window)


def _aim(renderer: Any, camera: Camera) -> None:
    from vtkmodules.vtkRenderingCore import vtkLight

    eye = renderer.GetActiveCamera()
    eye.ParallelProjectionOn()
    eye.SetFocalPoint(*camera.centre)
    eye.SetPosition(*(camera.centre + 10 * camera.half_width * camera.toward))
    eye.SetViewUp(*camera.up)
    eye.SetParallelScale(camera.half_height)
    renderer.ResetCameraClippingRange()
    light = vtkLight()
    light.SetLightTypeToCameraLight()
    light.SetPosition(-0.9, 0.8, 0.7)
    renderer.AddLight(light)


def surface_colours(scene: Scene) -> Array:
    """(nv, 3), 0 to 1: paler towards the crest, so that a ridge too low for shades is seen."""
    part = scene.rise[:, None]
    return (1 - part) * 0.86 * np.array(_rgb(SURFACE)) + part * np.array(_rgb(_CREST))


def _dot(scene: Scene, camera: Camera, size: tuple[int, int]) -> float:
    """Breadth of a scan point in pixels: most of the picture is covered, however dense the scan is."""
    seen = np.abs(camera.project(scene.points)) <= [camera.half_width, camera.half_height]
    share = 1.15 * np.sqrt(size[0] * size[1] / max(int(seen.all(axis=1).sum()), 1))
    return float(np.clip(share, 1.0, 9.0))


def _add_points(renderer: Any, scene: Scene, colours: Pixels, dot: float) -> None:
    from ridgefeature.plot.polydata import actor_in, paint, vertices

    data = vertices(scene.points)
    paint(data, colours)
    look = actor_in(renderer, data).GetProperty()
    look.LightingOff()
    look.SetPointSize(OVERSAMPLING * dot)


def _add_surface(renderer: Any, scene: Scene, shift: Array) -> None:
    from vtkmodules.util.numpy_support import numpy_to_vtk

    from ridgefeature.plot.polydata import actor_in, paint, quads

    data = quads(scene.surface + shift)
    data.GetPointData().SetNormals(numpy_to_vtk(scene.normals.reshape(-1, 3).copy(), deep=True))
    colours = np.broadcast_to(255 * surface_colours(scene), scene.surface.shape)
    paint(data, colours.reshape(-1, 3).astype(np.uint8))
    look = actor_in(renderer, data).GetProperty()
    look.SetAmbient(0.38)
    look.SetDiffuse(0.72)
    look.SetSpecular(0.15)
    look.SetSpecularPower(20)


def _add_line(renderer: Any, points: Array, colour: str, width: float) -> None:
    from ridgefeature.plot.polydata import actor_in, line

    look = actor_in(renderer, line(points)).GetProperty()
    look.LightingOff()
    look.SetColor(*_rgb(colour))
    look.SetLineWidth(width)


def _rgb(colour: str) -> tuple[float, ...]:
    return tuple(int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))


def _pixels(window: Any) -> Pixels:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

    window.Render()
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    grab.ShouldRerenderOff()
    grab.Update()
    width, height = window.GetSize()
    image = vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars()).reshape(height, width, -1)[::-1, :, :3]
    window.Finalize()
    n = OVERSAMPLING
    fine = image.reshape(height // n, n, width // n, n, 3).astype(np.uint16)
    return ((fine.sum(axis=(1, 3)) + n * n // 2) // (n * n)).astype(np.uint8)
