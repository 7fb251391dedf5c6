"""How high a ridge may stand before it crosses itself or the host. Oracles: radii, gaps, normals."""

import cadquery as cq
import numpy as np
import pytest
from made_ridges import made_ridge

from cad_export.face_base import face_base
from cad_export.headroom import check_height, headroom

RIDGE = made_ridge(40.0, 41)
TALLEST = RIDGE.height.max()


def bore(radius: float = 20.0) -> cq.Workplane:
    """A block with a hole through it, whose face bends towards its normals."""
    return cq.Workplane().box(80, 120, 80).faces("<Y").workplane().hole(2 * radius)


def plate(thickness: float = 10.0) -> cq.Workplane:
    return cq.Workplane().box(120, 60, thickness)


def slot(gap: float = 8.0) -> cq.Workplane:
    """Two plates that face each other, joined at one side."""
    return cq.Workplane().box(120, 60, 20 + gap).cut(cq.Workplane().box(120, 50, gap).translate((0, -5, 0)))


CASES = {
    # host, face, at, direction, how high, how deep, whether normals meet there
    "plate": (plate, ">Z", (0, 0, 5), (1, 0, 0), (np.inf, None), (10.0, False)),
    "bore, along": (bore, "%CYLINDER", (20, 0, 0), (0, 1, 0), (19.6, True), (20.0, False)),
    "bore, around": (bore, "%CYLINDER", (20, 0, 0), (0, 0, 1), (19.6, True), (20.0, False)),
    "shaft": (
        lambda: cq.Workplane().cylinder(120, 20), "%CYLINDER", (20, 0, 0), (0, 0, 1),
        (np.inf, None), (19.6, True),
    ),
    "ball": (lambda: cq.Workplane().sphere(40), None, (0, -40, 0), (1, 0, 0), (np.inf, None), (39.2, True)),
    "slot": (slot, "<<Z[-2]", (0, -5, -4), (1, 0, 0), (8.0, False), (10.0, False)),
}  # fmt: skip


def stood(name: str):
    make, selector, at, direction, *limits = CASES[name]
    host = make()
    face = host.faces(selector).val() if name != "slot" else min(
        host.faces("+Z").vals(), key=lambda f: abs(f.Center().z + 4)
    )  # fmt: skip
    base, ridge = face_base(face, RIDGE, at=at, direction=direction)
    return host.val().wrapped, base, ridge, limits


@pytest.mark.parametrize("name", CASES)
def test_the_limits_are_radii_and_gaps(name):
    solid, base, ridge, limits = stood(name)
    room = headroom(solid, base, ridge)
    for found, (height, folds) in zip((room.raised, room.engraved), limits, strict=True):
        if np.isinf(height):
            assert np.isinf(found.rate)
            continue
        # exact at the crest's tallest place, around a bore that is not where other faces are nearest
        assert found.rate * TALLEST >= height * (1 - 1e-2)
        assert found.folds is folds
        assert found.height >= height * (1 - 1e-6)
        if name != "bore, around":
            assert found.rate * TALLEST == pytest.approx(height, rel=1e-2)
            assert found.height == pytest.approx(height, rel=1e-6)


@pytest.mark.parametrize("name", ["bore, along", "shaft", "ball"])
def test_beyond_the_limit_and_only_there_the_surface_turns_over(name):
    solid, base, ridge, _ = stood(name)
    room = headroom(solid, base, ridge)
    sign, limit = (1, room.raised) if name == "bore, along" else (-1, room.engraved)
    u, (v0, v1) = np.linspace(0, ridge.length, 161), ridge.surface(base).domain[1]
    v = np.linspace(v0, v1, 81)
    flat = ridge.resized(h=0).surface(base).normal(u[:, None], v)

    def least_turn(h: float) -> float:
        return float((ridge.resized(h=sign * h).surface(base).normal(u[:, None], v) * flat).sum(-1).min())

    assert least_turn(0.9 * limit.rate) > 0
    assert least_turn(1.1 * limit.rate) < 0


def test_what_is_too_high_is_refused_in_words_and_what_is_not_passes():
    solid, base, ridge, _ = stood("bore, along")
    check_height(solid, base, ridge, h=0.9 * 20 / TALLEST)
    with pytest.raises(ValueError, match=r"h: expected at most .* normals of the face meet, 19\.6 from it"):
        check_height(solid, base, ridge, h=20 / TALLEST)
    solid, base, ridge, _ = stood("plate")
    check_height(solid, base, ridge, h=1e3)
    check_height(solid, base, ridge, h=-0.95 * 10 / TALLEST)
    with pytest.raises(ValueError, match=r"h: expected at least -.* another part of the host, 10 from"):
        check_height(solid, base, ridge, h=-1.05 * 10 / TALLEST)


def test_the_same_face_on_another_solid_has_its_own_room():
    thin = plate(10)
    base, ridge = face_base(thin.faces(">Z").val(), RIDGE, at=(0, 0, 5), direction=(1, 0, 0))
    deep = -1.5 * 10 / TALLEST
    with pytest.raises(ValueError, match="another part of the host"):
        check_height(thin.val().wrapped, base, ridge, h=deep)
    thick = plate(10).faces("<Z").workplane().rect(120, 60).extrude(30).val()
    check_height(thick.wrapped, base, ridge, h=deep)


def test_a_wider_or_higher_ridge_on_the_same_base_has_its_own_limits():
    solid, base, ridge, _ = stood("plate")
    deep = -0.95 * 10 / TALLEST
    check_height(solid, base, ridge, h=deep)
    check_height(solid, base, ridge.resized(w=1.2), h=deep)
    with pytest.raises(ValueError, match="another part of the host"):
        check_height(solid, base, ridge.resized(h=1.2), h=deep)


@pytest.mark.parametrize("name", ["bore, around", "slot"])
def test_another_width_on_a_known_place_has_the_limits_that_it_has_on_a_new_one(name):
    solid, base, ridge, _ = stood(name)
    check_height(solid, base, ridge, h=1e-3)
    for w in (0.7, 1.2):
        other = ridge.resized(w=w)
        limit = headroom(solid, base, other).raised.rate
        check_height(solid, base, other, h=limit * (1 - 1e-9))
        with pytest.raises(ValueError, match="h: expected at most"):
            check_height(solid, base, other, h=limit)


def test_a_grooves_own_sign_counts():
    solid, base, ridge, _ = stood("plate")
    groove = ridge.resized(h=-1)
    forth, back = headroom(solid, base, ridge), headroom(solid, base, groove)
    assert back.raised.rate == pytest.approx(forth.engraved.rate)
    assert np.isinf(back.engraved.rate)


def test_moving_and_scaling_the_host_changes_nothing():
    solid, base, ridge, _ = stood("bore, around")
    room = headroom(solid, base, ridge)
    moved = bore().val().moved(cq.Location((7, -3, 11), (30, 40, 50)))
    where = cq.Location((7, -3, 11), (30, 40, 50))
    at = cq.Vertex.makeVertex(20, 0, 0).moved(where).Center()
    along = cq.Vertex.makeVertex(20, 0, 1).moved(where).Center() - at
    face = min((f for f in moved.Faces() if f.geomType() == "CYLINDER"), key=lambda f: f.distance(
        cq.Vertex.makeVertex(*at.toTuple())
    ))  # fmt: skip
    other, same = face_base(face, RIDGE, at=at, direction=along)
    found = headroom(moved.wrapped, other, same)
    assert found.raised.rate == pytest.approx(room.raised.rate, rel=1e-6)
    assert found.engraved.rate == pytest.approx(room.engraved.rate, rel=1e-6)
