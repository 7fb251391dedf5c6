"""The base of a host face: paths, geodesics to both sides, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import cadquery as cq
import numpy as np
import pytest
from made_ridges import made_ridge
from OCP.BRep import BRep_Tool
from OCP.gp import gp_Pnt
from OCP.ShapeAnalysis import ShapeAnalysis_Surface
from scipy.spatial.transform import Rotation

from cad_export.face_base import face_base
from ridgefeature.base import developed, geodesic_curvature
from ridgefeature.section import Section

STRAIGHT, BENT = made_ridge(), made_ridge(bend=0.08)
SMALL = made_ridge(20.0, 41, 0.1, width=3.0, border=3.0, height=1.0)


def spline_face() -> cq.Face:
    points = [
        [cq.Vector(x, y, 8 * np.sin(x / 40) * np.cos(y / 30)) for y in np.linspace(-30, 30, 8)]
        for x in np.linspace(-60, 60, 12)
    ]
    return cq.Face.makeSplineApprox(points, tol=1e-3)


HOSTS = {
    "plane": lambda: cq.Workplane().box(120, 60, 10).faces(">Z").val(),
    "cylinder": lambda: cq.Workplane().circle(20).extrude(120).faces("%CYLINDER").val(),
    "cone": lambda: cq.Solid.makeCone(40, 25, 120).faces("%CONE"),
    "sphere": lambda: cq.Solid.makeSphere(40, angleDegrees1=-90, angleDegrees2=90).Faces()[0],
    "torus": lambda: cq.Solid.makeTorus(60, 25).Faces()[0],
    "spline": spline_face,
    "revolution": lambda: (
        cq.Workplane("XZ")
        .spline([(30, 0), (40, 40), (35, 80), (45, 120)])
        .lineTo(0, 120)
        .lineTo(0, 0)
        .close()
        .revolve()
        .faces("%REVOLUTION")
        .val()
    ),
}


@lru_cache(maxsize=32)
def placed(name: str, bent: bool = True):
    """Face, base and fitted ridge on a kind of face, by default."""
    face = HOSTS[name]()
    return face, *face_base(face, BENT if bent else STRAIGHT)


def top(thickness: float = 10.0) -> cq.Face:
    return cq.Workplane().box(120, 60, thickness).faces(">Z").val()


def tube(radius: float = 20.0, length: float = 120.0) -> cq.Face:
    return cq.Workplane().circle(radius).extrude(length).faces("%CYLINDER").val()


def off(face: cq.Face, points: np.ndarray) -> float:
    """Largest distance of points (..., 3) from the face's surface, by OCCT."""
    surface, gaps = ShapeAnalysis_Surface(BRep_Tool.Surface_s(face.wrapped)), []
    for p in points.reshape(-1, 3).tolist():
        surface.ValueOfUV(gp_Pnt(*p), 1e-9)
        gaps.append(surface.Gap())
    return max(gaps)


def grid(base, n: int = 41, m: int = 9):
    s = np.linspace(0, base.length, n)
    return s, base.breadth(s)[:, None] * np.linspace(-1, 1, m)


def path_points(base, n: int = 401) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Arc lengths, points and normals of the path."""
    s = np.linspace(0, base.length, n)
    points, normals = base(s, np.zeros((n, 1)))
    return s, points[:, 0], normals[:, 0]


# On every kind of face


@pytest.mark.parametrize("name", HOSTS)
@pytest.mark.parametrize("bent", [False, True], ids=["straight", "bent"])
def test_a_ridge_stands_on_every_kind_of_face(name, bent):
    face, base, fitted = placed(name, bent)
    ridge = BENT if bent else STRAIGHT
    assert base.length == pytest.approx(ridge.length) and not base.closed
    s, y = grid(base)
    points, normals = base(s, y)
    assert off(face, points) < 1e-9 * 120
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, rtol=1e-12)
    surface = fitted.surface(base)
    (u0, u1), (v0, v1) = surface.domain
    u = np.linspace(u0, u1, 201)
    rim = np.concatenate([surface(u, v0), surface(u, v1)])
    assert off(face, rim) < 1e-5 * ridge.width.min()
    flat = fitted.resized(h=0).surface(base)
    across = np.linspace(v0, v1, 41)
    assert off(face, np.concatenate([flat(u0, across), flat(u1, across), flat(u, 0.0)])) < 1e-5 * 6
    i = np.arange(5, 56, 10)
    apex = surface(ridge.arc_length[i], 0.0)
    at, normal = base(ridge.arc_length[i], np.zeros((6, 1)))
    np.testing.assert_allclose(apex, at[:, 0] + ridge.height[i, None] * normal[:, 0], atol=1e-3)


@pytest.mark.parametrize("name", HOSTS)
def test_parameters_tell_the_places(name):
    face, base, _ = placed(name)
    s, y = grid(base, 11, 5)
    x, points = base.parameters(s, y), base(s, y)[0]
    surface = BRep_Tool.Surface_s(face.wrapped)
    for (u, v), point in zip(x.reshape(-1, 2).tolist(), points.reshape(-1, 3), strict=True):
        p = surface.Value(u, v)
        np.testing.assert_allclose((p.X(), p.Y(), p.Z()), point, atol=1e-9 * 120)


@pytest.mark.parametrize("name", HOSTS)
def test_the_path_keeps_its_bends_and_its_arc_length(name):
    _, base, _ = placed(name)
    s, points, normals = path_points(base)
    tangent = np.gradient(points, s, axis=0, edge_order=2)
    np.testing.assert_allclose(np.linalg.norm(tangent, axis=1)[2:-2], 1, atol=1e-4)
    turn = np.gradient(tangent, s, axis=0, edge_order=2)
    found = (np.cross(normals, tangent) * turn).sum(axis=1)
    np.testing.assert_allclose(found[8:-8], geodesic_curvature(BENT, s)[8:-8], atol=2e-3)


@pytest.mark.parametrize("name", HOSTS)
def test_across_y_is_length_of_a_geodesic_to_the_left(name):
    _, base, _ = placed(name)
    s, y = np.array([13.0, 40.0]), np.tile(np.linspace(-6, 6, 2401), (2, 1))
    points, normals = base(s, y)
    steps = np.diff(points, axis=1)
    np.testing.assert_allclose(np.linalg.norm(steps, axis=2), 12 / 2400, rtol=1e-5)
    bend = np.diff(steps, axis=1) / (12 / 2400) ** 2
    sideways = np.cross(normals[:, 1:-1], steps[:, 1:] / (12 / 2400))
    assert np.abs((bend * sideways).sum(axis=2)).max() < 2e-4  # no geodesic curvature
    ahead = base(s + 1e-4, np.zeros((2, 1)))[0][:, 0] - base(s - 1e-4, np.zeros((2, 1)))[0][:, 0]
    left = steps[:, 1200] / (12 / 2400)
    np.testing.assert_allclose((np.cross(normals[:, 1200], ahead / 2e-4) * left).sum(axis=1), 1, atol=1e-4)


# Oracles


def test_on_a_plane_the_path_is_the_plane_development():
    base, _ = face_base(top(), BENT, at=(3, -2, 5), direction=(1, 0.2, 0))
    points, _ = developed(BENT)
    found = base(BENT.arc_length, np.zeros((61, 1)))[0][:, 0]
    np.testing.assert_allclose(found[30], (3, -2, 5), atol=1e-9)
    chord, wanted = found[-1] - found[0], points[-1] - points[0]
    assert np.linalg.norm(chord) == pytest.approx(np.linalg.norm(wanted), abs=1e-6)
    np.testing.assert_allclose(chord / np.linalg.norm(chord), np.array([1, 0.2, 0]) / 1.04**0.5, atol=1e-6)
    angle = np.arctan2(0.2, 1) - np.arctan2(wanted[1], wanted[0])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    np.testing.assert_allclose(found[:, :2] - found[30, :2], (points - points[30]) @ turn.T, atol=1e-5)


def test_a_cylinder_unrolls_to_the_plane():
    base, _ = face_base(tube(), BENT, at=(20, 0, 60), direction=(0, 1, 1))
    flat, _ = face_base(cq.Face.makePlane(200, 200), BENT, at=(0, 0, 0), direction=(1, 1, 0))
    s, y = grid(base)
    points, wanted = base(s, y)[0], flat(s, y)[0]
    angle = np.unwrap(np.arctan2(points[..., 1], points[..., 0]), axis=0)
    np.testing.assert_allclose(20 * angle, wanted[..., 0], atol=1e-6)
    np.testing.assert_allclose(points[..., 2] - 60, wanted[..., 1], atol=1e-6)


def test_a_straight_path_on_a_sphere_is_a_great_circle():
    base, _ = face_base(HOSTS["sphere"](), STRAIGHT, at=(40, 0, 0), direction=(0, 1, 1))
    s, y = grid(base)
    a, b = (s[:, None] - 30) / 40, y / 40
    ahead, left = np.array([0, 1, 1]) / 2**0.5, np.array([0, -1, 1]) / 2**0.5
    parts = (np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b))
    wanted = sum(
        40 * p[..., None] * axis for p, axis in zip(parts, (np.array([1.0, 0, 0]), ahead, left), strict=True)
    )
    np.testing.assert_allclose(base(s, y)[0], wanted, atol=1e-6)


def test_a_path_of_even_curvature_on_a_sphere_is_a_small_circle():
    base, _ = face_base(HOSTS["sphere"](), made_ridge(bend=0.05, waves=0), at=(40, 0, 0))
    _, points, _ = path_points(base)
    axis = np.linalg.svd(points - points.mean(axis=0))[2][2]
    heights = points @ axis
    np.testing.assert_allclose(heights, heights[0], atol=2e-4)
    radius = np.sqrt(40**2 - heights[0] ** 2)
    assert radius == pytest.approx(1 / np.hypot(0.05, 1 / 40), rel=1e-4)


# Placement


def test_by_default_the_middle_is_the_faces_centre_and_the_chord_its_own():
    base, _ = face_base(top(), replace(BENT, **turned_about_z(0.4)))
    found = base(BENT.arc_length, np.zeros((61, 1)))[0][:, 0]
    np.testing.assert_allclose(found[30], (0, 0, 5), atol=1e-6)
    wanted = turned_about_z(0.4)["spine"]
    np.testing.assert_allclose(found - found[30], wanted - wanted[30], atol=1e-4)


def turned_about_z(angle: float) -> dict[str, np.ndarray]:
    turn = Rotation.from_rotvec([0, 0, angle]).as_matrix()
    return {"spine": BENT.spine @ turn.T, "tangent": BENT.tangent @ turn.T}


def test_a_ridge_that_stands_across_the_face_takes_the_faces_longer_direction():
    upright = Rotation.from_rotvec([0, -np.pi / 2, 0]).as_matrix()
    turned = replace(
        STRAIGHT, **{n: getattr(STRAIGHT, n) @ upright.T for n in ("spine", "tangent", "normal")}
    )
    _, points, _ = path_points(face_base(top(), turned)[0], 2)
    np.testing.assert_allclose(np.abs(points[1] - points[0]), (60, 0, 0), atol=1e-6)


@pytest.mark.parametrize("name", ["plane", "cylinder", "sphere", "spline"])
def test_a_rigid_motion_of_the_host_moves_everything_alike(name):
    face, at = HOSTS[name](), None
    centre = face.Center() if name in ("plane", "spline") else cq.Vector(0, 20, 60)
    at = {"sphere": cq.Vector(0, 40, 0)}.get(name, centre)
    place = cq.Location(cq.Vector(30, -20, 11), cq.Vector(1, 2, 0.5), 70)
    direction = cq.Vector(1, 0.3, 0.1)
    base, fitted = face_base(face, BENT, at=at, direction=direction)
    tip = cq.Vertex.makeVertex(*(at + direction).toTuple()).moved(place)
    root = cq.Vertex.makeVertex(*at.toTuple()).moved(place)
    moved, _ = face_base(
        face.moved(place),
        BENT,
        at=root.toTuple(),
        direction=np.subtract(tip.toTuple(), root.toTuple()),
    )
    poles = fitted.surface(base).poles
    wanted = [cq.Vertex.makeVertex(*p).moved(place).toTuple() for p in poles.reshape(-1, 3).tolist()]
    np.testing.assert_allclose(fitted.surface(moved).poles.reshape(-1, 3), wanted, atol=1e-6)


def test_normals_point_out_of_the_solid():
    box = cq.Workplane().box(120, 120, 120)
    for selector, axis in ((">Z", 2), ("<Z", 2), (">X", 0), ("<X", 0)):
        face = box.faces(selector).val()
        normals = face_base(face, STRAIGHT)[0](np.array([30.0]), np.zeros((1, 1)))[1]
        assert normals[0, 0, axis] == pytest.approx(1.0 if selector[0] == ">" else -1.0)
    hole = cq.Workplane().circle(60).circle(25).extrude(120).faces("%CYLINDER")
    for face in hole.vals():
        points, normals = face_base(face, STRAIGHT)[0](np.array([30.0]), np.zeros((1, 1)))
        inner = np.hypot(*points[0, 0, :2]) < 30
        assert (points[0, 0, :2] @ normals[0, 0, :2] < 0) == inner


@pytest.mark.parametrize("name", ["plane", "cylinder"])
def test_reversed_it_runs_the_other_way_and_mirrored_it_bends_the_other_way(name):
    places = {"at": (0, 20, 60), "direction": (0, 0.1, 1)} if name == "cylinder" else {}
    face = HOSTS[name]()
    plain, back, mirror = (
        face_base(face, BENT, **places, **options)[0] for options in ({}, {"reverse": True}, {"mirror": True})
    )
    (_, a, n), (_, b, _), (_, c, m) = (path_points(base, 61) for base in (plain, back, mirror))
    np.testing.assert_allclose(a[30], b[30], atol=1e-9)
    assert (a[-1] - a[0]) @ (b[-1] - b[0]) < 0 < (a[-1] - a[0]) @ (c[-1] - c[0])
    bends = [bend_of(p, n) for p, n in ((a, n), (c, m))]
    np.testing.assert_allclose(bends[0], -bends[1], atol=2e-3)
    assert np.abs(bends[0]).max() > 0.07


def bend_of(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Geodesic curvature at inner points a unit of length apart."""
    tangent, turn = 0.5 * (points[2:] - points[:-2]), np.diff(points, 2, axis=0)
    return (np.cross(normals[1:-1], tangent) * turn).sum(axis=1)


def test_mirrored_the_section_is_turned_over():
    leaning = made_ridge(section=Section(np.array([0.2, 1.0, 0.4])))
    plain, mirror = (face_base(top(), leaning, mirror=m) for m in (False, True))
    a, b = (fitted.surface(base).grid(20, 30) for base, fitted in (plain, mirror))
    np.testing.assert_allclose(b[:, ::-1] * [1, -1, 1], a, atol=1e-6)


# Paths


def arc(radius: float = 40.0) -> cq.Edge:
    return cq.Edge.makeThreePointArc(
        cq.Vector(-radius, 0, 5), cq.Vector(0, 0.4 * radius, 5), cq.Vector(radius, 0, 5)
    )


@pytest.mark.parametrize("lift", [0.0, 1.0])
def test_a_path_is_followed_from_end_to_end(lift):
    edge = arc().moved(cq.Location(cq.Vector(0, 0, lift)))
    base, fitted = face_base(top(), STRAIGHT, path=edge)
    assert base.length == pytest.approx(arc().Length(), rel=1e-8) and fitted.length == base.length
    _, points, _ = path_points(base, 101)
    wanted = [edge.positionAt(t).toTuple() for t in np.linspace(0, 1, 101)]
    np.testing.assert_allclose(points, np.array(wanted) - [0, 0, lift], atol=1e-6)
    np.testing.assert_array_equal(fitted.height, STRAIGHT.height)


def test_a_path_reversed_starts_at_its_end():
    there, back = (face_base(top(), STRAIGHT, path=arc(), reverse=r)[0] for r in (False, True))
    np.testing.assert_allclose(path_points(there, 51)[1], path_points(back, 51)[1][::-1], atol=1e-8)
    assert back(np.array([10.0]), np.array([[2.0]]))[0].shape == (1, 1, 3)


def test_a_wire_of_lines_and_arcs_is_one_path():
    lines = [
        cq.Edge.makeLine(cq.Vector(-40, -15, 5), cq.Vector(0, -15, 5)),
        cq.Edge.makeThreePointArc(cq.Vector(0, -15, 5), cq.Vector(15, 0, 5), cq.Vector(0, 15, 5)),
        cq.Edge.makeLine(cq.Vector(0, 15, 5), cq.Vector(-40, 15, 5)),
    ]
    base, fitted = face_base(top(), STRAIGHT, path=cq.Wire.assembleEdges(lines))
    assert base.length == pytest.approx(80 + 15 * np.pi, rel=1e-9)
    s, points, _ = path_points(base)
    on_arc = (s > 40) & (s < base.length - 40)
    np.testing.assert_allclose(np.hypot(points[on_arc, 0], points[on_arc, 1]), 15, atol=1e-6)
    assert off(top(), fitted.resized(h=0).surface(base).grid(200, 9)) < 1e-9


@pytest.mark.parametrize(("fit", "length"), [("length", 82.0), ("scale", 82.0), ("trim", 60.0)])
def test_the_ridge_is_fitted_to_the_path(fit, length):
    edge = cq.Edge.makeLine(cq.Vector(-41, 0, 5), cq.Vector(41, 0, 5))
    base, fitted = face_base(top(), STRAIGHT, path=edge, fit=fit)
    assert base.length == pytest.approx(length) and fitted.length == pytest.approx(length)
    rate = 82 / 60 if fit == "scale" else 1.0
    np.testing.assert_allclose(fitted.width, rate * STRAIGHT.width, rtol=1e-6)


def test_a_short_path_trims_the_ridge():
    edge = cq.Edge.makeLine(cq.Vector(-10, 0, 5), cq.Vector(15, 0, 5))
    base, fitted = face_base(top(), STRAIGHT, path=edge, fit="trim")
    assert base.length == pytest.approx(25)
    assert fitted.height[0] == pytest.approx(STRAIGHT.height[0])
    assert fitted.height[-1] == pytest.approx(np.interp(25, STRAIGHT.arc_length, STRAIGHT.height), rel=1e-3)


def test_a_closed_edge_gives_a_ring():
    circle = cq.Edge.makeCircle(20, cq.Vector(0, 0, 5))
    base, fitted = face_base(top(), STRAIGHT, path=circle)
    assert base.closed and fitted.closed and base.length == pytest.approx(40 * np.pi, rel=1e-8)
    surface = fitted.surface(base)
    np.testing.assert_array_equal(surface.poles[0], surface.poles[-1])
    first, last = surface.on_grid(surface.domain[0], np.linspace(*surface.domain[1], 9), (2, 0))
    np.testing.assert_allclose(first, last, atol=1e-8)
    outer = np.hypot(*surface(np.linspace(0, base.length, 200), surface.domain[1][0])[:, :2].T)
    np.testing.assert_allclose(outer, 26, atol=1e-4)


def test_a_ring_around_a_cylinder_runs_on_over_its_seam():
    base, fitted = face_base(tube(), SMALL, path=cq.Edge.makeCircle(20, cq.Vector(0, 0, 60)))
    u = base.parameters(np.linspace(0, base.length, 200), np.zeros((200, 1)))[:, 0, 0]
    assert base.closed and np.abs(u[-1] - u[0]) == pytest.approx(2 * np.pi)
    assert (np.diff(u) * np.sign(u[-1] - u[0]) > 0).all()
    assert off(tube(), fitted.resized(h=0).surface(base).grid(200, 9)) < 1e-5 * SMALL.width.min()


def test_over_a_seam_parameters_run_on():
    base, _ = face_base(tube(), STRAIGHT, at=(20, 0, 60), direction=(0, 1, 0))
    u = base.parameters(np.linspace(0, 60, 100), np.zeros((100, 1)))[:, 0, 0]
    np.testing.assert_allclose(np.abs(np.diff(u)), 60 / 99 / 20, rtol=1e-6)


# What is refused


def plate_with_hole(radius: float, x: float = 0.0, y: float = 0.0) -> cq.Face:
    return (
        cq.Workplane()
        .box(120, 60, 10)
        .faces(">Z")
        .workplane()
        .center(x, y)
        .hole(2 * radius)
        .faces(">Z")
        .val()
    )


def line(*points: tuple[float, float, float]) -> cq.Wire:
    return cq.Wire.makePolygon([cq.Vector(*p) for p in points])


def lofted() -> cq.Face:
    """A face that closes on itself along u, but whose B-spline surface is not periodic."""
    body = cq.Workplane().ellipse(20, 15).workplane(offset=60).ellipse(26, 18).loft()
    return body.faces("not %PLANE").val()


def seam_of(face: cq.Face) -> cq.Edge:
    return next(edge for edge in face.Edges() if BRep_Tool.IsClosed_s(edge.wrapped, face.wrapped))


REFUSED = {
    "longer than the face": (lambda: face_base(top(), made_ridge(140.0)), "leaves the face"),
    "over the border": (lambda: face_base(top(), STRAIGHT, at=(0, 26, 5)), "leaves the face"),
    "over the end": (lambda: face_base(top(), STRAIGHT, at=(32, 0, 5)), "leaves the face"),
    "over a hole": (lambda: face_base(plate_with_hole(8), STRAIGHT, at=(0, 6, 5)), "hole"),
    "around a hole": (lambda: face_base(plate_with_hole(0.5), STRAIGHT, at=(0, 2, 5)), "hole"),
    "off the end of a tube": (
        lambda: face_base(tube(20, 50), STRAIGHT, direction=(0, 0, 1)),
        "leaves the face",
    ),
    "over a pole": (
        lambda: face_base(HOSTS["sphere"](), STRAIGHT, at=(0.5, 0, np.sqrt(1600 - 0.25))),
        "pole",
    ),
    "tight bend": (lambda: face_base(top(), made_ridge(bend=0.3, waves=3)), "bends wider"),
    "tight arc": (
        lambda: face_base(top(), STRAIGHT, path=cq.Edge.makeCircle(5, cq.Vector(0, 0, 5))),
        "bends wider",
    ),
    "a loop over itself": (
        lambda: face_base(cq.Face.makePlane(300, 300), made_ridge(90.0, 91, 0.1, 0)),
        "overlaps",
    ),
    "around a thin tube": (
        lambda: face_base(tube(8), STRAIGHT, at=(8, 0, 60), direction=(0, 1, 0.01)),
        "overlaps",
    ),
    "along the seam of a loft": (
        lambda: face_base(lofted(), STRAIGHT, path=seam_of(lofted())),
        "clear of the seam at which the face closes",
    ),
    "across the seam of a loft": (
        lambda: face_base(lofted(), SMALL, at=seam_of(lofted()).positionAt(0.5), direction=(0, 1, 0)),
        "clear of the seam at which the face closes",
    ),
    "at off the face": (lambda: face_base(top(), STRAIGHT, at=(0, 0, 9)), "at: expected a point within"),
    "at NaN": (lambda: face_base(top(), STRAIGHT, at=(0, np.nan, 5)), "at: expected three finite"),
    "at text": (lambda: face_base(top(), STRAIGHT, at="here"), "at: expected three finite"),
    "direction zero": (lambda: face_base(top(), STRAIGHT, direction=(0, 0, 0)), "a zero vector"),
    "direction up": (lambda: face_base(top(), STRAIGHT, direction=(0, 0, 1)), "along the face's normal"),
    "direction infinite": (
        lambda: face_base(top(), STRAIGHT, direction=(np.inf, 0, 0)),
        "direction: expected three",
    ),
    "path off the face": (
        lambda: face_base(top(), STRAIGHT, path=line((-30, 0, 9), (30, 0, 9))),
        "path: expected one within 1.5",
    ),
    "path over the border": (
        lambda: face_base(top(), STRAIGHT, path=line((-30, 0, 5), (70, 0, 5))),
        "leaves the face",
    ),
    "path with a corner": (
        lambda: face_base(top(), STRAIGHT, path=line((-30, 0, 5), (0, 0, 5), (20, 10, 5))),
        r"corner of 26.6 degrees at \[0.0, 0.0, 5.0\]",
    ),
    "closed path with a corner": (
        lambda: face_base(top(), SMALL, path=line((-30, -15, 5), (30, -15, 5), (0, 15, 5), (-30, -15, 5))),
        "corner",
    ),
    "path without length": (
        lambda: face_base(top(), STRAIGHT, path=cq.Edge.makeLine(cq.Vector(0, 0, 5), cq.Vector(1e-6, 0, 5))),
        "path: expected",
    ),
    "path a face": (lambda: face_base(top(), STRAIGHT, path=top()), "path: expected an edge or a wire"),
    "path a number": (lambda: face_base(top(), STRAIGHT, path=3), "expected a CAD shape"),
    "path and at": (lambda: face_base(top(), STRAIGHT, path=arc(), at=(0, 0, 5)), "either a path, or at"),
    "unknown fit": (lambda: face_base(top(), STRAIGHT, path=arc(), fit="cut"), "fit: expected"),
    "no face": (lambda: face_base(cq.Workplane().box(1, 1, 1).val(), STRAIGHT), "expected one face"),
    "no shape": (lambda: face_base(None, STRAIGHT), "expected a CAD shape"),
    "no ridge": (lambda: face_base(top(), "ridge"), "ridge: expected a Ridge"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_is_refused_in_words(name):
    make, message = REFUSED[name]
    with pytest.raises(ValueError, match=message):
        make()


def test_beside_a_hole_there_is_room():
    base, _ = face_base(plate_with_hole(8, 0, 10), STRAIGHT, at=(0, -10, 5))
    assert base.length == pytest.approx(60)


@pytest.mark.parametrize(
    ("s", "y"),
    [
        (np.array([70.0]), np.zeros((1, 1))),
        (np.array([-1.0]), np.zeros((1, 1))),
        (np.array([np.nan]), np.zeros((1, 1))),
        (np.array([1.0]), np.full((1, 1), np.nan)),
        (np.array([1.0]), np.zeros((2, 1))),
        (np.array([1.0]), np.zeros((1, 0))),
        (np.array(1.0), np.zeros((1, 1))),
    ],
)
def test_a_base_refuses_places_that_are_none(s, y):
    base, _ = face_base(top(), STRAIGHT)
    with pytest.raises(ValueError, match="expected"):
        base(s, y)


def test_what_is_kept_changes_nothing():
    face = HOSTS["sphere"]()
    fresh, used = (face_base(face, BENT)[0] for _ in range(2))
    s, y = grid(used)
    for part in (0.3, 1.0, 0.5):
        used(s, part * y)
    np.testing.assert_array_equal(used(s, y)[0], fresh(s, y)[0])


def test_beyond_the_strip_the_base_goes_on():
    base, _ = face_base(HOSTS["sphere"](), STRAIGHT, at=(40, 0, 0), direction=(0, 1, 0))
    s = np.array([30.0])
    points, _ = base(s, np.array([[0.0, 6.0, 20.0]]))
    angles = np.arccos(points[0] @ points[0, 0] / 1600)
    np.testing.assert_allclose(40 * angles[1:], [6.0, 20.0], atol=1e-6)
