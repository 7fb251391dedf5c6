"""Pasting: a ridge grown out of a host's face, with h and w still its parameters."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from oracles import spiral_ridge

import cad_export as cx
import ridgefeature as rf


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge()


@pytest.fixture(scope="module")
def box() -> cq.Solid:
    return cq.Workplane().box(170, 170, 20).val()


@pytest.fixture(scope="module")
def top(box) -> cq.Face:
    return cq.Workplane(box).faces(">Z").val()


def added(ridge: rf.Ridge) -> float:
    """Volume between the ridge and a plane, by its own h and w: the area of each section along the path."""
    eta = np.linspace(-0.5, 0.5, 2001)
    share = np.trapezoid(ridge.section(eta), eta)
    return float(np.trapezoid(ridge.height * ridge.width * share, ridge.arc_length))


def test_the_volume_added_is_that_of_the_ridge(ridge, box, top):
    report: dict = {}
    part = cx.paste(ridge, box, face=top, report=report)
    assert isinstance(part, cq.Solid) and part.isValid()
    assert report["volume_added"] == pytest.approx(report["volume_expected"], rel=1e-3)
    assert part.Volume(1e-4) - box.Volume() == pytest.approx(added(ridge), rel=0.01)
    assert report["method"] == "inset" and report["largest_tolerance"] < 1e-3 and report["seconds"] > 0


def test_the_host_is_not_changed(ridge, box, top):
    before = box.Volume(), len(box.Faces()), len(box.Edges()), box.wrapped.TShape()
    cx.paste(ridge, box, face=top, check=False)
    assert (box.Volume(), len(box.Faces()), len(box.Edges()), box.wrapped.TShape()) == before


def test_a_negative_height_engraves(ridge, box, top):
    up, down = (cx.paste(ridge, box, face=top, h=h, check=False).Volume(1e-4) for h in (0.5, -0.5))
    assert up - box.Volume() == pytest.approx(box.Volume() - down, rel=1e-3)


def test_the_place_is_the_middle_of_the_ridge_and_the_direction_its_own(ridge, box, top):
    short = ridge.stretched(40.0, "trim")
    part = cx.paste(short, box, face=top, at=(20, 10, 10), direction=(0, 1, 0), check=False)
    [(face, _)] = cx.carried_by(part)
    spine = cx.surface_of(cq.Face(face))(np.linspace(0, 40, 9), 0)
    assert spine[4, :2] == pytest.approx([20, 10], abs=0.1)
    along = spine[-1] - spine[0]
    assert along[1] > 0.9 * np.linalg.norm(along)


def test_without_a_face_the_one_nearest_to_the_place_is_taken(ridge, box):
    part = cx.paste(ridge, box, at=(0, 0, -10), check=False)
    assert part.BoundingBox().zmin == pytest.approx(-10 - ridge.height.max(), abs=0.2)


def test_several_pastes_one_after_another(ridge, box):
    short = ridge.stretched(40.0, "trim")
    part = box
    for x in (-40, 0, 40):
        part = cx.paste(short, part, at=(x, 0, 10), direction=(0, 1, 0), check=False)
    assert len(cx.carried_by(part)) == 3
    once = cx.paste(short, box, at=(0, 0, 10), direction=(0, 1, 0), check=False).Volume(1e-5) - box.Volume()
    assert part.Volume(1e-5) - box.Volume() == pytest.approx(3 * once, rel=1e-3)


def test_a_path_is_followed(ridge, box, top):
    path = cq.Edge.makeSpline([cq.Vector(x, y, 10) for x, y in ((-50, -20), (-10, 15), (20, -10), (50, 20))])
    part = cx.paste(ridge, box, face=top, path=path, w=0.8, check=False)
    [(face, _)] = cx.carried_by(part)
    surface = cx.surface_of(cq.Face(face))
    spine = surface(np.linspace(*surface.domain[0], 50), 0)
    for x, y, _ in spine:
        assert cq.Vertex.makeVertex(x, y, 10).distance(path) < 1e-4


def test_a_ring_encloses_what_stays(ridge, box, top):
    part = cx.paste(
        ridge, box, face=top, path=cq.Edge.makeCircle(35, cq.Vector(0, 0, 10)), h=0.5, check=False
    )
    assert part.isValid() and len(part.Faces()) == len(box.Faces()) + 2


@pytest.mark.parametrize("unit", ["m", "in"])
def test_a_ridge_in_another_unit_is_pasted_in_millimetres(ridge, unit, box, top):
    factor = rf.scan.millimetres_per(unit)
    names = ("arc_length", "spine", "height", "width", "height_std", "width_std", "border")
    from dataclasses import replace

    other = replace(ridge, unit=unit, **{name: getattr(ridge, name) / factor for name in names})
    own, scaled = (cx.paste(r, box, face=top, check=False).Volume(1e-5) for r in (ridge, other))
    assert scaled == pytest.approx(own, rel=1e-9)


def test_scale_is_that_of_the_whole_ridge(ridge, box, top):
    half = cx.paste(ridge, box, face=top, scale=0.5, check=False).Volume(1e-6) - box.Volume()
    whole = cx.paste(ridge, box, face=top, check=False).Volume(1e-6) - box.Volume()
    assert half == pytest.approx(whole / 8, rel=1e-3)


# What the pasted part can still do


def test_the_part_can_be_worked_on(ridge, box, top):
    part = cq.Workplane(cx.paste(ridge, box, face=top, h=0.5, check=False))
    drilled = part.faces("<Z").workplane().center(30, 0).hole(4)
    assert drilled.val().isValid() and drilled.val().Volume() < part.val().Volume()
    assert len(cx.carried_by(drilled.val())) == 1
    assert part.edges("|Z").fillet(3).val().isValid()
    assert part.mirror("YZ").val().isValid()
    joined = part.union(cq.Workplane().box(20, 20, 60).translate((60, 60, 0)))
    assert joined.val().isValid() and joined.val().Volume() > part.val().Volume()


# Bad input


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"h": np.nan}, "h: expected"),
        ({"w": 0}, "w: expected a rate above 0"),
        ({"w": 9}, "w: expected at most 1"),
        ({"at": (0, 0)}, "at: expected three"),
        ({"at": (np.nan, 0, 0)}, "at"),
        ({"scale": 0}, "scale: expected"),
        ({"scale": 9}, "too small"),
        ({"fit": "no"}, "fit"),
        ({"direction": (0, 0, 0)}, "direction"),
        ({"direction": (0, 0, 1)}, "direction"),
        ({"at": (75, 75, 10)}, "leaves"),
    ],
)
def test_what_cannot_be_pasted_says_why(ridge, box, top, options, says):
    with pytest.raises(ValueError, match=says):
        cx.paste(ridge, box, face=top, **options)


def test_hosts_and_faces_that_are_none(ridge, box, top):
    with pytest.raises(ValueError, match="host: expected one solid, got 0"):
        cx.paste(ridge, cq.Workplane().rect(1, 1), face=top)
    with pytest.raises(ValueError, match="expected a CAD shape"):
        cx.paste(ridge, None, face=top)
    with pytest.raises(ValueError, match="face: expected a face"):
        cx.paste(ridge, box, face=box.Edges()[0])
    with pytest.raises(ValueError, match="several largest faces"):
        cx.paste(ridge, box)
    other = cq.Workplane().box(300, 300, 300).faces(">Z").val()
    with pytest.raises(ValueError, match="face"):
        cx.paste(ridge, box, face=other)
    with pytest.raises(ValueError, match="ridge: expected a Ridge"):
        cx.paste(ridge.surface(), box, face=top)


def test_a_ridge_over_an_earlier_one_is_refused(ridge, box):
    part = cx.paste(ridge, box, at=(0, 0, 10), check=False)
    with pytest.raises(ValueError):
        cx.paste(ridge, part, at=(0, 0, 10), direction=(1, 1, 0), check=False)


def test_a_ridge_may_run_on_over_faces_that_go_on_from_the_face(ridge):
    left, right = (cq.Workplane().box(60, 80, 20).translate((x, 0, 0)) for x in (-30, 30))
    host = left.union(right, clean=False).val()
    face = cq.Workplane(host).faces(">Z").vals()[0]
    short, report = ridge.stretched(60.0, "scale"), {}
    part = cx.paste(short, host, face=face, at=(-10, 0, 10), direction=(1, 0, 0), report=report)
    one = cq.Solid.makeBox(120, 80, 20, (-60, -40, -10))
    whole = cx.paste(short, one, at=(-10, 0, 10), direction=(1, 0, 0), check=False)
    assert report["method"] == "split seam"
    assert part.Volume(1e-6) == pytest.approx(whole.Volume(1e-6), rel=1e-6)
    [(grown, _)], [(same, _)] = cx.carried_by(part), cx.carried_by(whole)
    np.testing.assert_allclose(cx.surface_of(grown).poles, cx.surface_of(same).poles, atol=1e-9)


def test_a_ridge_over_an_edge_is_refused(ridge, box, top):
    with pytest.raises(ValueError, match="leaves the face near"):
        cx.paste(ridge.stretched(60.0, "scale"), box, face=top, at=(80, 0, 10), direction=(1, 0, 0))


def test_a_groove_through_a_plate_is_refused_by_its_depth(ridge):
    plate = cq.Workplane().box(170, 170, 2).val()
    with pytest.raises(ValueError, match=r"h: expected at least .* another part of the host"):
        cx.paste(ridge, plate, face=cq.Workplane(plate).faces(">Z").val(), h=-1, check=False)


def test_flanks_are_narrowed_where_a_path_bends_and_the_feet_fit(ridge, box, top):
    small = ridge.stretched(40.0, "scale")
    radius = 0.8 * float(small.border.max())
    circle = cq.Edge.makeCircle(radius, cq.Vector(0, 0, 10))
    part = cx.paste(small.resized(w=0.5), box, face=top, path=circle, fit="trim", check=False)
    assert part.isValid() and part.Volume(1e-6) > box.Volume()


@pytest.mark.parametrize(("name", "value"), [("h", "2"), ("h", None), ("w", "wide"), ("w", True)])
def test_rates_are_numbers(ridge, box, top, name, value):
    with pytest.raises(ValueError, match=f"^{name}: expected a number, a rate, got "):
        cx.paste(ridge, box, face=top, **{name: value})


@pytest.mark.parametrize("place", [{"at": (20, 10, 10)}, {"at": (22, 12, 10)}])
def test_a_second_ridge_at_the_same_place_is_told_of_the_first(place, ridge, box, top):
    short = ridge.stretched(40.0, "trim")
    part = cx.paste(short, box, face=top, at=(20, 10, 10), direction=(0, 1, 0), check=False, name="first")
    rest = max(part.Faces(), key=lambda face: face.Area() if abs(face.Center().z - 10) < 0.5 else 0)
    with pytest.raises(
        ValueError, match="at: expected a place clear of ridges pasted before, 'first' is there"
    ):
        cx.paste(short, part, **place, check=False)
    with pytest.raises(ValueError, match="clear of the face's holes and of ridges pasted before"):
        cx.paste(short, part, face=rest, **place, check=False)
    beside = cx.paste(short, part, at=(-50, 10, 10), direction=(0, 1, 0), check=False)
    assert len(cx.carried_by(beside)) == 2
