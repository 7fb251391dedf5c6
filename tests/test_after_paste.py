"""A pasted part is worked on like any other solid: every result passes the check that a paste passes.

And its volume is what it must be: booleans take and give what the tools share with the part, a fillet takes
what it takes from the host alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_OffsetSurface
from OCP.ShapeCustom import ShapeCustom
from oracles import spiral_ridge

import cad_export as cx
import ridgefeature as rf
from cad_export.certificate import check_shape
from cad_export.check import volume
from cad_export.geometry import from_occt
from cad_export.inset import face_with
from ridgefeature.bspline import Surface

THICKNESS = 0.25
"""Of walls: below the least radius of curvature of the ridge's crest, 0.4 mm."""


@dataclass(frozen=True)
class Host:
    """A solid, the face to paste on with a place, a direction and the normal there, an edge far from it."""

    solid: cq.Solid
    face: str
    at: tuple[float, float, float]
    direction: tuple[float, float, float]
    normal: tuple[float, float, float]
    edge: str

    def along(self, ahead: float, up: float) -> cq.Vector:
        """The point so far from the place along the ridge's direction and above the face."""
        return cq.Vector(*self.at) + cq.Vector(*self.direction) * ahead + cq.Vector(*self.normal) * up


def box() -> Host:
    return Host(cq.Solid.makeBox(70, 40, 16), ">Z", (35, 20, 16), (1, 0, 0), (0, 0, 1), "|Z and >X and >Y")


def cylinder() -> Host:
    made = cq.Workplane().cylinder(60, 30).val()
    return Host(made, "%CYLINDER", (0, -30, 0), (0, 0, 1), (0, -1, 0), ">Z")


def spline() -> Host:
    grid = [[cq.Vector(x, y, 3 * np.sin(x / 30) * np.cos(y / 35)) for y in np.linspace(-25, 25, 8)]
            for x in np.linspace(-30, 30, 10)]  # fmt: skip
    made = cq.Solid.extrudeLinear(cq.Face.makeSplineApprox(grid, tol=1e-3), cq.Vector(0, 0, -20))
    return Host(made, ">Z", (0, 0, 0), (1, 0, 0), (0, 0, 1), "|Z and >X and >Y")


HOSTS = {"box": box, "cylinder": cylinder, "spline": spline}


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge().stretched(30.0, "trim")


@pytest.fixture(scope="module", params=HOSTS)
def host(request) -> Host:
    return HOSTS[request.param]()


def pasted(ridge: rf.Ridge, host: Host) -> cq.Solid:
    face = cq.Workplane(host.solid).faces(host.face).val()
    place = {"face": face, "at": host.at, "direction": host.direction}
    return cx.paste(ridge, host.solid, h=0.5, scale=0.5, check=False, **place)


@pytest.fixture(scope="module")
def part(ridge, host) -> cq.Solid:
    return pasted(ridge, host)


def measured(shape: cq.Shape, tolerance: float = 1e-6) -> float:
    return sum(volume(solid.wrapped, tolerance) for solid in shape.Solids())


def checked(shape: cq.Shape, pieces: int = 1) -> float:
    """The volume of a shape of so many solids, each of which passes the thorough check."""
    solids = shape.Solids()
    assert len(solids) == pieces
    for solid in solids:
        check_shape(solid.wrapped)
    return measured(shape)


def ridge_surface(part: cq.Solid) -> Surface:
    [(face, _)] = cx.carried_by(part)
    return cx.surface_of(cq.Face(face))


def test_a_hole_through_the_ridge(host, part):
    drill = cq.Solid.makeCylinder(1.5, 200, host.along(0, -100), cq.Vector(*host.normal))
    taken = measured(part.intersect(drill))
    assert checked(part.cut(drill)) == pytest.approx(measured(part) - taken, rel=1e-6)
    # it goes through the ridge: more is taken than from the host
    crest = ridge_surface(part)
    u, v = (np.linspace(*crest.domain[k], 201) for k in (0, 1))
    from_axis = np.cross(crest.on_grid(u, v) - np.array(host.at), host.normal)
    rise = (crest.on_grid(u, v) - np.array(host.at)) @ host.normal
    near = np.linalg.norm(from_axis, axis=-1) < 1.5
    base = measured(host.solid.intersect(drill))
    assert np.pi * 1.5**2 * rise[near].min() < taken - base < np.pi * 1.5**2 * (rise[near].max() + 0.05)


def test_a_fillet_of_another_edge(host, part):
    rounded = [s.fillet(3, cq.Workplane(s).edges(host.edge).vals()) for s in (part, host.solid)]
    taken = measured(host.solid) - measured(rounded[1])
    assert taken > 10
    assert checked(rounded[0]) == pytest.approx(measured(part) - taken, rel=1e-6)


def test_a_split_across_the_ridge(host, part):
    size = cq.Vector(host.along(1, 0)).Length + 200
    ahead = cq.Vector(*host.direction)
    knife = cq.Face.makePlane(size, size, host.along(1, 0), ahead)
    halves = cq.Workplane(part).split(knife).solids()
    assert checked(cq.Compound.makeCompound(halves.vals()), 2) == pytest.approx(measured(part), rel=1e-5)
    sides = [(solid.Center() - host.along(1, 0)).dot(ahead) > 0 for solid in halves.vals()]
    assert sorted(sides) == [False, True]


def test_a_mirror_image(host, part):
    image = part.mirror("XZ", cq.Vector(*host.at))
    assert checked(image) == pytest.approx(measured(part), rel=1e-7)
    poles = ridge_surface(part).poles * (1, -1, 1) + (0, 2 * host.at[1], 0)
    found = [cx.surface_of(f).poles for f in image.Faces() if f.geomType() == "BSPLINE"]
    assert any(p.shape == poles.shape and np.abs(p - poles).max() < 1e-9 for p in found)


def test_a_union_with_a_box_over_an_end_of_the_ridge(host, part):
    block = cq.Solid.makeBox(10, 10, 10).moved(cq.Location(host.along(9, 1) - cq.Vector(5, 5, 5)))
    shared = measured(part.intersect(block))
    assert 0 < shared < 1000
    assert checked(part.fuse(block)) == pytest.approx(measured(part) + 1000 - shared, rel=1e-6)


def test_out_to_step_and_in(part, tmp_path: Path):
    read = cq.Shape.cast(cx.read_step(cx.step(part, tmp_path / "part.step")))
    assert checked(read) == pytest.approx(measured(part), rel=1e-6)
    surface = ridge_surface(part)
    again = cx.surface_of(cq.Face(face_with(read.wrapped, surface, 1e-9)))
    np.testing.assert_allclose(again.poles, surface.poles, rtol=0, atol=1e-9)


def running_out(ridge: rf.Ridge, share: float = 0.3) -> Callable[[np.ndarray], np.ndarray]:
    """The ridge's height, brought to 0 at both ends over a share of its length, with slope 0."""

    def height(s: np.ndarray) -> np.ndarray:
        x = np.clip(np.minimum(s, ridge.length - s) / (share * ridge.length), 0.0, 1.0)
        return np.interp(s, ridge.arc_length, ridge.height) * x**3 * (10 - 15 * x + 6 * x**2)

    return height


def without_offsets(shape: cq.Shape) -> float:
    """The volume, offset surfaces made splines first: OCCT integrates them as if they had no knots."""
    return volume(ShapeCustom.ConvertToBSpline_s(shape.wrapped, False, False, True, False), 1e-6)


def shelled(ridge: rf.Ridge, host: Host, thickness: float) -> None:
    """Shell a part whose ridge runs out, open on the side away from the ridge; hold volume and shape.

    On ends that are cut off OCCT mostly fails: cap and ridge meet in a cusp at the feet.
    """
    part = pasted(ridge.resized(height=running_out(ridge)), host)
    hollow, plain = (
        cq.Workplane(s).faces("<Z").shell(thickness, kind="intersection").val() for s in (part, host.solid)
    )
    checked(hollow)
    walls = without_offsets(plain) + THICKNESS * (part.Area() - host.solid.Area())
    assert without_offsets(hollow) == pytest.approx(walls, rel=2e-4)
    # the other side of the wall follows the ridge's own surface
    poles, followed = ridge_surface(part).poles, []
    for face in hollow.Faces():
        geometry = BRep_Tool.Surface_s(face.wrapped)
        if isinstance(geometry, Geom_OffsetSurface):
            own = from_occt(geometry.BasisSurface()).poles
            if own.shape == poles.shape and np.array_equal(own, poles):
                followed.append(geometry.Offset())
    assert followed == [thickness]


def test_a_shell_inwards(host, ridge):
    shelled(ridge, host, -THICKNESS)


@pytest.mark.parametrize("make", [box, cylinder])  # OCCT cannot shell the spline host outwards by itself
def test_a_shell_outwards(make, ridge):
    shelled(ridge, make(), THICKNESS)
