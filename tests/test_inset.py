"""A ridge set into a face: the volume of its integral, the host's other faces kept, the host untouched."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from inset_helpers import (
    bore_map,
    box,
    curved_face,
    cylinder,
    cylinder_map,
    flat_ridge,
    on_map,
    ring_ridge,
    sphere,
    sphere_map,
    top,
)
from OCP.BRep import BRep_Tool

from cad_export.certificate import free_mesh_edges
from cad_export.check import volume
from cad_export.geometry import surface_of
from cad_export.inset import face_with, inset


def flat(h: float, **where):
    return flat_ridge(h, **where), flat_ridge(0.0, **where)


def carried(h: float, place):
    return on_map(flat_ridge(h), place), on_map(flat_ridge(0.0), place)


def solid_of(host, face, pair, check=True) -> cq.Solid:
    return cq.Solid(inset(host.wrapped, face, *pair, check=check)[0])


@pytest.mark.parametrize("h", [2.0, -1.0])
@pytest.mark.parametrize(
    ("host", "place"),
    [(cylinder(), cylinder_map(20.0)), (sphere(), sphere_map(30.0))],
    ids=["cylinder", "sphere"],
)
def test_on_curved_faces_the_volume_is_the_integral(host, place, h: float) -> None:
    pair = carried(h, place)
    solid, report = inset(host.wrapped, curved_face(host), *pair, check=h > 0)
    added = volume(solid, 1e-7) - volume(host.wrapped, 1e-7)
    assert added == pytest.approx(report.volume_expected, rel=1e-3)
    assert report.volume_added == pytest.approx(report.volume_expected, rel=1e-3)
    assert np.sign(added) == np.sign(h) and report.method == "inset" and report.seconds > 0
    np.testing.assert_array_equal(surface_of(face_with(solid, pair[0])).poles, pair[0].poles)


def test_on_a_plane_the_volume_is_affine_in_the_height() -> None:
    host = box()
    face, before = top(host), volume(host.wrapped)
    heights = np.linspace(-2.0, 3.0, 50)
    pairs = [flat(h, z=5.0) for h in heights]
    made = [inset(host.wrapped, face, *pair, check=False) for pair in pairs]
    expected = np.array([report.volume_expected for _, report in made])
    np.testing.assert_allclose(expected, heights * expected[-1] / 3.0, rtol=0, atol=1e-6 * np.ptp(expected))
    added = np.array([volume(solid, 1e-8) - before for solid, _ in made[::7]])
    np.testing.assert_allclose(added, expected[::7], rtol=0, atol=1e-6 * np.ptp(expected))
    solid, report = inset(host.wrapped, face, *flat(0.0, z=5.0))
    assert volume(solid) == pytest.approx(before, rel=1e-7) and report.volume_expected == pytest.approx(0)


def test_the_volume_of_a_straight_ridge_is_known() -> None:
    """The bell on four spans of w / 4 has the integral 3 w / 8 across."""
    host = box()
    _, report = inset(host.wrapped, top(host), *flat(2.0, z=5.0, bend=0.0))
    assert report.volume_expected == pytest.approx(2.0 * 40.0 * 6.0 * 3 / 8, rel=1e-9)


def test_other_faces_are_the_hosts_own_and_the_host_is_not_altered() -> None:
    host = cylinder()
    edges = [e.wrapped for e in host.Edges()]
    before = [BRep_Tool.Tolerance_s(e) for e in edges], volume(host.wrapped), len(host.Faces())
    face = curved_face(host)
    solid = solid_of(host, face, carried(2.0, cylinder_map(20.0)), check=False)
    assert before == ([BRep_Tool.Tolerance_s(e) for e in edges], volume(host.wrapped), len(host.Faces()))
    kept = [f for f in solid.Faces() if any(f.wrapped.IsSame(g.wrapped) for g in host.Faces())]
    assert len(kept) == len(host.Faces()) - 1 and not any(f.wrapped.IsSame(face) for f in solid.Faces())
    assert len(solid.Faces()) == len(host.Faces()) + 3  # the ridge and a cap at either end
    assert all(BRep_Tool.Triangulation_s(f.wrapped, f.wrapped.Location()) is None for f in host.Faces())


def test_a_ring_keeps_what_it_encloses() -> None:
    host = cq.Workplane().box(60, 60, 10).faces(">Z").workplane().hole(6).val()
    pair = ring_ridge(1.5, 5.0), ring_ridge(0.0, 5.0)
    solid, report = inset(host.wrapped, top(host), *pair)
    assert volume(solid, 1e-7) - volume(host.wrapped) == pytest.approx(report.volume_expected, rel=1e-3)
    made = cq.Solid(solid)
    assert len(made.Faces()) == len(host.Faces()) + 2  # the ring and the island with the hole in it
    groove = inset(host.wrapped, top(host), ring_ridge(-1.5, 5.0), pair[1], check=False)[1]
    assert groove.volume_added == pytest.approx(-report.volume_expected, rel=1e-3)


def test_several_ridges_one_after_another_on_one_face() -> None:
    solid, pairs = (
        box(),
        [flat(h, z=5.0, at=(0.0, y), bend=1.0) for h, y in ((1.0, -14), (-2.0, 0), (2.0, 14))],
    )
    expected = volume(solid.wrapped)
    for pair in pairs:
        face = next(f for f in solid.Faces() if f.geomType() == "PLANE" and f.Center().z > 4.9).wrapped
        made, report = inset(solid.wrapped, face, *pair, check=pair is pairs[-1])
        solid, expected = cq.Solid(made), expected + report.volume_expected
    assert volume(solid.wrapped, 1e-7) == pytest.approx(expected, abs=1e-3)
    for pair in pairs:
        assert face_with(solid.wrapped, pair[0]).IsNull() is False
    with pytest.raises(ValueError, match="clear of holes and earlier ridges"):
        face = next(f for f in solid.Faces() if f.geomType() == "PLANE" and f.Center().z > 4.9).wrapped
        inset(solid.wrapped, face, *flat(1.0, z=5.0, at=(3.0, 5.0)))


def test_a_filleted_host_and_a_moved_one() -> None:
    host = cq.Workplane().box(80, 50, 10).edges("|Z").fillet(4).translate((3, 4, 5)).val()
    solid, report = inset(host.wrapped, top(host), *flat(1.0, z=10.0, at=(3.0, 4.0)))
    assert volume(solid, 1e-7) - volume(host.wrapped) == pytest.approx(report.volume_expected, rel=1e-4)


def bad(host, face, *pair) -> pytest.ExceptionInfo:
    with pytest.raises(ValueError) as caught:
        inset(host, face, *pair)
    return str(caught.value)


def test_bad_input_is_an_error_in_words() -> None:
    host, pair = box(), flat(1.0, z=5.0)
    face = top(host)
    assert "expected one solid, got NoneType" in bad(None, face, *pair)
    assert "expected one solid, got 0" in bad(face, face, *pair)
    two = cq.Compound.makeCompound([box(), box().translate(cq.Vector(200, 0, 0))])
    assert "expected one solid, got 2" in bad(two.wrapped, face, *pair)
    assert "face of the host, got NoneType" in bad(host.wrapped, None, *pair)
    assert "one of another shape" in bad(host.wrapped, top(box()), *pair)
    assert "knots of the surface" in bad(host.wrapped, face, pair[0], flat_ridge(0.0, z=5.0, rows=9))
    assert "borders of the surface" in bad(host.wrapped, face, pair[0], flat_ridge(0.0, z=4.0))


def test_a_border_in_the_wrong_place_is_an_error_in_words() -> None:
    host = cq.Workplane().box(80, 50, 10).faces(">Z").workplane().center(20, 0).hole(2).val()
    face = top(host)
    assert "it is 0.5 off" in bad(host.wrapped, face, *flat(1.0, z=5.5))
    assert "leaves the face's outline" in bad(host.wrapped, face, *flat(1.0, z=5.0, at=(25.0, 0.0)))
    assert "lies outside" in bad(host.wrapped, face, *flat(1.0, z=5.0, at=(200.0, 0.0)))
    assert "it covers one" in bad(host.wrapped, face, *flat(1.0, z=5.0, bend=0.0, at=(10.0, 0.0)))
    assert "it overlaps one" in bad(host.wrapped, face, *flat(1.0, z=5.0, bend=0.0, at=(10.0, 4.9)))


def test_a_surface_that_points_inwards_or_folds_is_an_error_in_words() -> None:
    host = box()
    below = cq.Workplane(obj=host).faces("<Z").val().wrapped
    assert "it points inwards" in bad(host.wrapped, below, *flat(1.0, z=-5.0))
    bends = flat(1.0, z=5.0, bend=9.0, length=20.0, w=16.0)
    assert "border that does not cross itself" in bad(host.wrapped, top(host), *bends)
    tube = cylinder(20.0).cut(cylinder(12.0))
    bore = min((f for f in tube.Faces() if f.geomType() == "CYLINDER"), key=lambda f: f.Area()).wrapped
    assert "fold over itself" in bad(tube.wrapped, bore, *carried(15.0, bore_map(12.0)))


def test_a_groove_through_the_host_is_found_by_the_thorough_check() -> None:
    host = box()
    with pytest.raises(ValueError, match="does not cross itself"):
        inset(host.wrapped, top(host), *flat(-12.0, z=5.0))


def test_an_open_mesh_is_found() -> None:
    host = box()
    assert free_mesh_edges(host.wrapped) == 0
    opened = cq.Shell.makeShell(host.Faces()[:5])
    assert free_mesh_edges(opened.wrapped) == 4


@pytest.mark.parametrize("h", [1.5, -1.0])
def test_over_a_seam_the_seam_is_split(h: float) -> None:
    host = cylinder().rotate(cq.Vector(0, 0, 0), cq.Vector(1, 0, 0), 180)
    solid, report = inset(host.wrapped, curved_face(host), *carried(h, cylinder_map(20.0)), check=h > 0)
    assert report.method == "split seam"
    added = volume(solid, 1e-7) - volume(host.wrapped, 1e-7)
    assert added == pytest.approx(report.volume_expected, rel=1e-3)
