"""A ridge over a seam, once round a face, or over several faces on one surface: split, never refitted."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from inset_helpers import Map, box, curved_face, cylinder, cylinder_map, flat_ridge, on_map, sphere_map
from made_ridges import made_ridge
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopoDS import TopoDS, TopoDS_Shape

import cad_export as cx
from cad_export.certificate import certify, free_mesh_edges
from cad_export.check import subshapes, volume
from cad_export.crossings import same_surface
from cad_export.fallbacks import fallback
from cad_export.geometry import surface_of
from cad_export.inset import face_of, face_with, inset
from cad_export.seam import OffFacesError, split_inset
from cad_export.site import Site
from cad_export.step_file import read_step, step
from ridgefeature.bspline import Surface, clamped_knots, greville, interpolate

FULL = {"angleDegrees1": -90, "angleDegrees2": 90, "angleDegrees3": 360}


def carried(h: float, place: Map, **shape) -> tuple[Surface, Surface]:
    """A short ridge along x on the map, and its base."""
    values = {"length": 24.0, "w": 4.0, "bend": 1.0, "rows": 17, **shape}
    return on_map(flat_ridge(h, **values), place), on_map(flat_ridge(0.0, **values), place)


def belt(h: float, place: Map, length: float, w: float = 4.0) -> tuple[Surface, Surface]:
    """A ring along x on the map, which closes after `length`, and its base."""
    knots_u = clamped_knots(np.linspace(0, length, 49), 3)
    knots_v = clamped_knots(np.linspace(-0.9 * w, 0.9 * w, 17), 3)
    x, y = np.meshgrid(greville(knots_u, 3), greville(knots_v, 3), indexing="ij")
    point, normal = place(x, y)
    bump = np.clip(1 - (y / w / 0.8) ** 2, 0, None)[..., None] ** 3
    made = []
    for height in (h, 0.0):
        across = interpolate(knots_u, 3, point + height * bump * normal).swapaxes(0, 1)
        poles = interpolate(knots_v, 3, across).swapaxes(0, 1).copy()
        poles[-1] = poles[0]
        made.append(poles)
    made[0][:, [0, -1]] = made[1][:, [0, -1]]
    return Surface(made[0], knots_u, knots_v, 3, 3), Surface(made[1], knots_u, knots_v, 3, 3)


def _stack(*a: np.ndarray) -> np.ndarray:
    return np.stack(np.broadcast_arrays(*a), axis=-1)


def torus_map(large: float, small: float, start: float = 0.0) -> Map:
    """Along the outer equator of a torus about z; y is arc length round the tube."""

    def place(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a, b = x / (large + small) + start, y / small
        normal = _stack(np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b))
        return _stack(large * np.cos(a), large * np.sin(a), 0 * a) + small * normal, normal

    return place


def tube_map(large: float, small: float, at: float) -> Map:
    """Round the tube of a torus about z, at an angle round z."""

    def place(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a, b = at - y / large, x / small
        normal = _stack(np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b))
        return _stack(large * np.cos(a), large * np.sin(a), 0 * a) + small * normal, normal

    return place


def cone_map(radius: float, z: float, slope: float) -> Map:
    """Round a cone about z, from its x side, at a height; the slope is the normal's."""
    cos, sin = np.cos(slope), np.sin(slope)

    def place(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a, r = x / radius, radius - y * sin
        normal = _stack(cos * np.cos(a), cos * np.sin(a), sin + 0 * a)
        return _stack(r * np.cos(a), r * np.sin(a), z + y * cos), normal

    return place


def turned(place: Map) -> Map:
    """The map with its y axis, up, as the ridge's way."""
    return lambda x, y: place(-y, x)


CONE = cq.Solid.makeCone(30, 15, 40)
SLOPE = float(np.arctan2(15, 40))
TORUS = cq.Solid.makeTorus(40, 12)
SPHERE = cq.Solid.makeSphere(30, **FULL)
UPRIGHT = cq.Workplane().circle(20).extrude(60).val()  # its face is turned against its surface
PLACES: dict[str, tuple[cq.Shape, Map]] = {
    "cylinder": (UPRIGHT, cone_map(20.0, 30.0, 0.0)),
    "along a cylinder": (UPRIGHT, turned(cone_map(20.0, 30.0, 0.0))),
    "cone": (CONE, cone_map(22.5, 20.0, SLOPE)),
    "sphere": (SPHERE, cone_map(30.0, 0.0, 0.0)),
    "torus, both seams": (TORUS, torus_map(40.0, 12.0)),
    "torus, one seam": (TORUS, torus_map(40.0, 12.0, 1.0)),
}


def _on_sphere(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    point, normal = sphere_map(30.0)(x, y)
    return point[..., [2, 0, 1]], normal[..., [2, 0, 1]]


PLACES["sphere"] = (SPHERE, _on_sphere)


def made(host: cq.Shape, pair: tuple[Surface, Surface], face: TopoDS_Shape | None = None, check=False):
    """The solid, and the change; it has passed the certificate."""
    site = Site(face_of(host.wrapped, face or curved_face(host)), *pair)
    change = split_inset(host.wrapped, site, 1.0)
    certify(change, thorough=check)
    assert BRepCheck_Analyzer(change.solid).IsValid() and free_mesh_edges(change.solid) == 0
    return cq.Solid(change.solid), change


def added(solid: cq.Shape, host: cq.Shape) -> float:
    return volume(solid.wrapped, 1e-9) - volume(host.wrapped, 1e-9)


@pytest.mark.parametrize(
    ("name", "h"),
    [*((name, 1.0) for name in PLACES), ("along a cylinder", -0.7), ("torus, both seams", -0.7)],
)
def test_over_a_seam_the_volume_is_the_integral_and_the_surface_its_own(name: str, h: float) -> None:
    host, place = PLACES[name]
    pair = carried(h, place)
    solid, change = made(host, pair)
    assert added(solid, host) == pytest.approx(change.volume_expected, rel=1e-3)
    np.testing.assert_array_equal(surface_of(face_with(solid.wrapped, pair[0])).poles, pair[0].poles)
    assert len(change.remaining) == 1 and len(solid.Faces()) == len(host.Faces()) + 3


def test_over_the_seam_it_is_the_same_as_beside_it() -> None:
    beside, pair = cylinder(), carried(1.5, cylinder_map(20.0))
    over = beside.rotate(cq.Vector(0, 0, 0), cq.Vector(1, 0, 0), 180)
    solid, _ = made(over, pair)
    expected, report = inset(beside.wrapped, curved_face(beside), *pair, check=False)
    assert report.method == "inset"
    assert volume(solid.wrapped, 1e-9) == pytest.approx(volume(expected, 1e-9), rel=1e-8)
    assert added(solid, over) == pytest.approx(added(cq.Solid(expected), beside), rel=1e-5)
    faces = (surface_of(face_with(s, pair[0])) for s in (solid.wrapped, expected))
    one, other = (face.poles for face in faces)
    np.testing.assert_array_equal(one, other)


def test_other_faces_are_the_hosts_own_and_the_host_is_not_altered() -> None:
    host, place = PLACES["cylinder"]
    host.tessellate(0.5)
    edges = [e.wrapped for e in host.Edges()]
    before = [BRep_Tool.Tolerance_s(e) for e in edges], volume(host.wrapped), len(host.Vertices())
    solid, _ = made(host, carried(1.0, place))
    assert before == (
        [BRep_Tool.Tolerance_s(e) for e in edges],
        volume(host.wrapped),
        len(host.Vertices()),
    )
    kept = [f for f in solid.Faces() if any(f.wrapped.IsSame(g.wrapped) for g in host.Faces())]
    assert len(kept) == 2 and all(f.geomType() == "PLANE" for f in kept)


def spline_body() -> tuple[cq.Solid, Map, float]:
    """A closed spline about the z axis, extruded; a map from its seam round it; its length round."""
    a = np.linspace(0, 2 * np.pi, 17)[:-1]
    r = 20 + 0.5 * np.cos(2 * a)
    points = [cq.Vector(*p) for p in np.stack([r * np.cos(a), r * np.sin(a), 0 * a], axis=1).tolist()]
    edge = cq.Edge.makeSpline(points, periodic=True)
    body = cq.Solid.extrudeLinear(cq.Wire.assembleEdges([edge]), [], cq.Vector(0, 0, 60))
    body = cq.Shape.cast(BRepBuilderAPI_NurbsConvert(body.wrapped).Shape())
    curve = BRepAdaptor_Curve(edge.wrapped)
    t = np.linspace(curve.FirstParameter(), curve.LastParameter(), 4001)
    rough = np.array([(p.X(), p.Y()) for p in map(curve.Value, t.tolist())])
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rough, axis=0), axis=1))])

    def place(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        at, point, rate = np.interp(np.mod(x, way[-1]), way, t), gp_Pnt(), gp_Vec()
        found = []
        for s in at.ravel().tolist():
            curve.D1(s, point, rate)
            found.append((point.X(), point.Y(), rate.X(), rate.Y()))
        px, py, dx, dy = np.array(found).reshape(*x.shape, 4).transpose(2, 0, 1)
        normal = _stack(dy, -dx, 0 * dx) / np.hypot(dx, dy)[..., None]
        return _stack(px, py, 30 + y), normal

    return body, place, float(way[-1])


@pytest.mark.parametrize("kind", ["circle", "spline"])
def test_a_belt_round_a_cylinder_leaves_two_faces(kind: str) -> None:
    host, place, length = UPRIGHT, cone_map(20.0, 30.0, 0.0), 2 * np.pi * 20
    if kind == "spline":
        host, place, length = spline_body()
    face = max(host.Faces(), key=lambda f: f.Area()).wrapped
    solid, change = made(host, belt(1.0, place, length), face)
    assert len(change.remaining) == 2 and len(solid.Faces()) == 5
    assert added(solid, host) == pytest.approx(change.volume_expected, rel=1e-3)


def test_over_the_seam_of_a_closed_spline() -> None:
    host, place, _ = spline_body()
    face = max(host.Faces(), key=lambda f: f.Area()).wrapped
    solid, change = made(host, carried(1.0, place), face)
    assert added(solid, host) == pytest.approx(change.volume_expected, rel=1e-3)


def test_over_the_seam_of_a_spline_face() -> None:
    plain, place = PLACES["cylinder"]
    pair = carried(1.0, place)
    host = cq.Shape.cast(BRepBuilderAPI_NurbsConvert(plain.wrapped, True).Shape())
    face = max(host.Faces(), key=lambda f: f.Area())
    assert face.geomType() == "BSPLINE"
    solid, _ = made(host, pair, face.wrapped)
    assert added(solid, host) == pytest.approx(added(made(plain, pair)[0], plain), rel=1e-4)


@pytest.mark.parametrize("at", [0.0, 1.0], ids=["along a seam", "beside it"])
def test_a_belt_round_the_tube_of_a_torus(at: float) -> None:
    pair = belt(1.0, tube_map(40.0, 12.0, at), 2 * np.pi * 12)
    solid, change = made(TORUS, pair)
    assert added(solid, TORUS) == pytest.approx(change.volume_expected, rel=1e-3)
    assert len(change.remaining) == (1 if at == 0 else 2)


def test_a_belt_round_the_axis_of_a_torus_a_cone_and_a_sphere() -> None:
    slanted = np.pi * 2 * 22.5
    for host, place, length in (
        (TORUS, torus_map(40.0, 12.0), 2 * np.pi * 52),
        (CONE, cone_map(22.5, 20.0, SLOPE), slanted),
        (SPHERE, _on_sphere, 2 * np.pi * 30),
    ):
        solid, change = made(host, belt(1.0, place, length))
        assert added(solid, host) == pytest.approx(change.volume_expected, rel=1e-3)


def test_a_spiral_of_several_turns() -> None:
    def place(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        c, s = np.cos(0.08), np.sin(0.08)
        return cone_map(20.0, 30.0, 0.0)(c * x - s * y + 70.0, s * x + c * y)

    pair = carried(0.8, place, length=160.0, w=2.0, bend=0.0, rows=33)
    solid, change = made(UPRIGHT, pair)
    assert added(solid, UPRIGHT) == pytest.approx(change.volume_expected, rel=1e-3)
    assert len(change.remaining) > 1


def test_next_to_a_hole_and_a_ridge_that_is_there() -> None:
    drilled = (
        cq.Workplane(UPRIGHT)
        .cut(cq.Workplane("YZ", origin=(0, 0, 45)).center(6, 0).circle(1.5).extrude(30))
        .val()
    )
    solid, total = drilled, 0.0
    for z in (12.0, 30.0):
        face = max((f for f in solid.Faces() if f.geomType() == "CYLINDER"), key=lambda f: f.Area()).wrapped
        solid, change = made(solid, carried(1.0, cone_map(20.0, z, 0.0)), face)
        total += change.volume_expected
    assert added(solid, drilled) == pytest.approx(total, rel=1e-3)
    face = max((f for f in solid.Faces() if f.geomType() == "CYLINDER"), key=lambda f: f.Area()).wrapped
    with pytest.raises(ValueError, match="overlaps one"):
        made(solid, carried(1.0, cone_map(20.0, 41.0, 0.0)), face)
    with pytest.raises(ValueError, match="covers"):
        made(solid, carried(1.0, cone_map(20.0, 45.0, 0.0), w=8.0, bend=0.0), face)


def test_a_belt_over_an_earlier_ridge_is_an_error_and_beside_it_is_not() -> None:
    solid, _ = made(UPRIGHT, carried(1.0, cone_map(20.0, 20.0, 0.0)))
    face = max((f for f in solid.Faces() if f.geomType() == "CYLINDER"), key=lambda f: f.Area()).wrapped
    with pytest.raises(ValueError, match=r"overlaps one|covers|leaves"):
        made(solid, belt(1.0, cone_map(20.0, 20.0, 0.0), 2 * np.pi * 20), face)
    both, change = made(solid, belt(1.0, cone_map(20.0, 45.0, 0.0), 2 * np.pi * 20), face)
    assert added(both, solid) == pytest.approx(change.volume_expected, rel=1e-3)


# Several faces on one surface


def in_two(solid: cq.Shape, normal: tuple[float, float, float]) -> cq.Solid:
    """The solid with each face in two where a plane through the origin cuts it."""
    parts = solid.split(cq.Face.makePlane(300, 300, cq.Vector(0, 0, 0), cq.Vector(*normal))).Solids()
    return parts[0].fuse(parts[1]).Solids()[0]


def test_over_two_coplanar_faces() -> None:
    host = in_two(box(), (1, 0.2, 0))
    tops = [f for f in host.Faces() if f.normalAt().z > 0.99]
    assert len(tops) == 2
    assert len(same_surface(host.wrapped, tops[0].wrapped, 1e-6)) == 2
    pair = flat_ridge(1.0, z=5.0), flat_ridge(0.0, z=5.0)
    solid, change = made(host, pair, tops[0].wrapped, check=True)
    assert added(solid, host) == pytest.approx(change.volume_expected, rel=1e-5)
    assert len(change.old) == 2 and len(change.remaining) == 2


def test_over_two_halves_of_a_cylinder() -> None:
    host = in_two(UPRIGHT, (0.1, 1, 0))
    sides = [f for f in host.Faces() if f.geomType() == "CYLINDER"]
    solid, change = made(host, carried(1.0, cone_map(20.0, 30.0, 0.0)), sides[0].wrapped)
    assert added(solid, host) == pytest.approx(change.volume_expected, rel=1e-3)
    assert len(sides) == len(change.old) == 3  # the plane runs beside the seam, which is an edge now
    whole, _ = made(UPRIGHT, carried(1.0, cone_map(20.0, 30.0, 0.0)))
    assert added(solid, host) == pytest.approx(added(whole, UPRIGHT), rel=1e-5)


# What cannot be


def test_off_the_faces_is_an_error_in_words() -> None:
    with pytest.raises(OffFacesError, match="leaves the face's outline"):
        made(UPRIGHT, carried(1.0, cone_map(20.0, 58.0, 0.0)))
    with pytest.raises(ValueError, match=r"it is .* off"):
        made(UPRIGHT, carried(1.0, cone_map(20.5, 30.0, 0.0)))
    host = box()
    site = Site(
        face_of(host.wrapped, cq.Workplane(obj=host).faces(">Z").val().wrapped),
        *[flat_ridge(h, z=5.0, at=(25.0, 0.0)) for h in (1.0, 0.0)],
    )
    with pytest.raises(ValueError, match=r"leaves the face's outline.*the host is .* off"):
        fallback(host.wrapped, site, 1.0)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"h": -50}, "h: expected at least .* another part of the host"),
        ({"w": 50}, "w: expected at most"),
        ({"at": (36, 0, 5)}, "leaves the face"),
    ],
)
def test_over_two_faces_it_is_said_what_is_wrong(options, says) -> None:
    host = in_two(box(), (1, 0.2, 0))
    where = {"at": (0, 0, 5), "direction": (1, 0, 0)} | options
    with pytest.raises(ValueError, match=says):
        cx.paste(made_ridge(30.0), host, **where)


def test_a_surface_that_points_inwards_is_an_error_in_words() -> None:
    place = cone_map(20.0, 30.0, 0.0)
    with pytest.raises(ValueError, match="points inwards"):
        made(UPRIGHT, carried(1.0, lambda x, y: place(-x, y)))


def test_the_poles_of_a_sphere_are_an_error_in_words() -> None:
    place = sphere_map(30.0)
    with pytest.raises(ValueError, match=r"covers|pole"):
        made(SPHERE, carried(1.0, place))


def test_the_solid_comes_back_from_step(tmp_path) -> None:
    solid, _ = made(TORUS, carried(1.0, torus_map(40.0, 12.0)))
    step(solid, tmp_path / "part.step")
    back = read_step(tmp_path / "part.step")
    assert free_mesh_edges(back) == 0 and BRepCheck_Analyzer(back).IsValid()
    assert volume(back, 1e-8) == pytest.approx(volume(solid.wrapped, 1e-8), rel=1e-6)
    assert len(subshapes(back, TopAbs_FACE)) == len(solid.Faces())
    assert all(not BRep_Tool.Tolerance_s(TopoDS.Edge_s(e)) > 1e-2 for e in subshapes(back, TopAbs_EDGE))
