"""Regenerating: a pasted part made again at other heights and widths, from the part or its STEP file."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from oracles import spiral_ridge

import cad_export as cx
import ridgefeature as rf
from cad_export import paste_history, record, regeneration
from cad_export.occt_arrays import pole_array


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge().stretched(20.0, "trim")


@pytest.fixture(scope="module")
def host() -> cq.Solid:
    return cq.Workplane().box(120, 80, 10).edges("|Z").fillet(5).val()


@pytest.fixture(scope="module")
def part(ridge, host) -> cq.Solid:
    once = cx.paste(ridge, host, at=(-20, 0, 5), direction=(0, 1, 0), h=1.2, check=False)
    path = cq.Edge.makeSpline([cq.Vector(15, -25, 5), cq.Vector(25, 0, 5), cq.Vector(20, 25, 5)])
    return cx.paste(ridge, once, path=path, w=0.9, check=False)


def volume_added(part: cq.Solid, host: cq.Solid) -> float:
    return part.Volume(1e-6) - host.Volume(1e-6)


def test_the_same_rates_give_the_same_part(part):
    assert cx.regenerate(part, check=False).Volume(1e-6) == pytest.approx(part.Volume(1e-6), rel=1e-9)


def test_all_ridges_change_or_the_named_one(part, host, ridge):
    both = cx.regenerate(part, h=2, check=False)
    names = [record.name for _, record in cx.carried_by(part)]
    assert len(names) == 2
    ones = [record for _, record in cx.carried_by(both)]
    assert [record.h for record in ones] == [2, 2]
    assert sorted(record.w for record in ones) == [0.9, 1.0]


def test_a_step_file_regenerates(part, host, tmp_path):
    file = cx.step(part, tmp_path / "part.step")
    again = cx.regenerate(file, check=False)
    assert volume_added(again, host) == pytest.approx(volume_added(part, host), rel=1e-4)
    name = cx.carried_in(file)[1].name
    changed = cx.regenerate(file, h=3, name=name, check=False)
    assert sorted(record.h for _, record in cx.carried_by(changed)) == [1.2, 3]
    # and what was regenerated can be written and regenerated again
    twice = cx.regenerate(cx.step(changed, tmp_path / "again.step"), h=1, check=False)
    assert [record.h for _, record in cx.carried_by(twice)] == [1, 1]


def test_the_ridges_come_back_from_a_part(part, ridge, tmp_path):
    first, second = cx.load(cx.step(part, tmp_path / "part.step"))
    for found in (first, second):
        assert (found.height == ridge.height).all() and (found.arc_length == ridge.arc_length).all()


def test_a_moved_part_regenerates_where_it_is(part):
    moved = part.moved(cq.Location(cq.Vector(7, -3, 11), cq.Vector(0, 1, 1), 40))
    again = cx.regenerate(moved, check=False)
    assert (again.Center() - moved.Center()).Length < 1e-6


def test_a_part_that_was_changed_since_is_refused(part):
    with pytest.raises(ValueError, match="changed"):
        cx.regenerate(cq.Workplane(part).faces("<Z").workplane().hole(3))


def test_a_named_ridge_of_the_solid_is_that_of_its_file(part, tmp_path):
    names = [record.name for record in cx.carried_in(cx.step(part, tmp_path / "part.step"))]
    assert names == ["ridge", "ridge 2"]  # both were pasted as "ridge"
    changed = cx.carried_by(cx.regenerate(part, h=3, name="ridge 2", check=False))
    assert {record.name: record.h for _, record in changed} == {"ridge": 1.2, "ridge 2": 3}


def test_a_part_that_was_moved_or_drilled_and_pasted_on_again(part, ridge):
    place = cq.Location(cq.Vector(5, 6, 7), cq.Vector(0, 0, 1), 30)
    top = (place * cq.Location((45, 0, 5))).toTuple()[0]
    hole = cq.Solid.makeCylinder(1, 40, cq.Vector(52, -30, -20)).moved(place)
    for host in (part.moved(place), part.moved(place).cut(hole)):
        along = (-0.5, 3**0.5 / 2, 0)
        again = cx.paste(ridge, host, at=top, direction=along, scale=0.4, name="late", check=False)
        with pytest.raises(ValueError, match=r"one of 'late', got none: .* 'ridge', 'ridge 2', which cannot"):
            cx.regenerate(again, h=2)
        with pytest.raises(ValueError, match="got 'ridge', after whose paste the part was changed"):
            cx.regenerate(again, h=2, name="ridge")
        higher = cx.regenerate(again, h=2, name="late", check=False)
        # added volume is linear in h on a plane; volumes are integrated to 1e-6 of the whole part
        twice, room = 2 * volume_added(again, host), 4e-6 * host.Volume()
        assert room < 0.01 * twice
        assert volume_added(higher, host) == pytest.approx(twice, abs=room)
        assert {r.name: r.h for _, r in cx.carried_by(higher)} == {"ridge": 1.2, "ridge 2": 1, "late": 2}


def test_several_solids_are_refused_and_each_regenerates(part, tmp_path):
    two = cq.Assembly(part, name="a").add(part, name="b", loc=cq.Location((0, 100, 0)))
    file = cx.step(two, tmp_path / "two.step")
    with pytest.raises(ValueError, match="expected one solid, got 2; give one of them"):
        cx.regenerate(file, h=2)
    for solid in cq.Shape.cast(cx.read_step(file)).Solids():
        again = cx.regenerate(solid, check=False)
        assert (again.Center() - solid.Center()).Length < 1e-6


def test_what_cannot_be_regenerated_says_why(part, host, ridge, tmp_path):
    with pytest.raises(ValueError, match="pasted ridge"):
        cx.regenerate(host)
    with pytest.raises(ValueError, match="carries no ridge feature"):
        cx.regenerate(cx.step(host, tmp_path / "host.step"))
    with pytest.raises(ValueError, match="pasted ridge"):
        cx.regenerate(cx.step(ridge, tmp_path / "ridge.step"))
    with pytest.raises(ValueError, match="name: expected one of"):
        cx.regenerate(part, h=2, name="bead")
    with pytest.raises(OSError):
        cx.regenerate(tmp_path / "none.step")


def poles_of(part: cq.Solid) -> list[np.ndarray]:
    return [pole_array(BRep_Tool.Surface_s(face)) for face, _ in cx.carried_by(part)]


def test_it_is_the_paste_at_those_rates_bit_for_bit_warm_or_cold(part, host, ridge, tmp_path):
    place = {"at": (-20, 0, 5), "direction": (0, 1, 0), "check": False}
    one = cx.paste(ridge, host, h=1.2, **place)
    file = cx.step(one, tmp_path / "one.step")
    for rates in ({"h": 0.7}, {"h": 1.3}, {"h": -0.5}, {"h": 1.2, "w": 0.8}, {"h": 1.3, "w": 1.1}):
        expected = cx.paste(ridge, host, **rates, **place)
        for source in (one, one, file):
            again = cx.regenerate(source, **rates, check=False)
            assert all(np.array_equal(*pair) for pair in zip(*map(poles_of, (again, expected)), strict=True))
            assert again.Volume(1e-6) == expected.Volume(1e-6)


def faces_in_both(a: cq.Solid, b: cq.Solid) -> int:
    return sum(any(f.isSame(g) for g in b.Faces()) for f in a.Faces())


def test_what_does_not_change_is_made_once(part):
    """A slider pastes on the very same host, and the very same ridges before the one that it moves."""
    slid = [cx.regenerate(part, h=h, name="ridge 2", check=False) for h in (1.1, 1.2)]
    slid.append(cx.regenerate(slid[0], h=1.3, name="ridge 2", check=False))
    for other in slid[1:]:
        # all but the face that the ridge stands on, the ridge and its two caps
        assert faces_in_both(slid[0], other) >= len(other.Faces()) - 4
        assert len(other.Faces()) > 12


def test_a_slider_measures_no_whole_part(part, monkeypatch):
    last = cx.regenerate(part, h=1.5, check=False)
    for module in (paste_history, regeneration):
        monkeypatch.setattr(module, "volume", lambda *_: pytest.fail("a volume was measured"))
    for h in (1.6, 1.7):
        last = cx.regenerate(last, h=h, check=False)
    moved = last.moved(cq.Location((1, 2, 3)))
    assert [r.h for _, r in cx.carried_by(cx.regenerate(moved, h=2, check=False))] == [2, 2]


def test_a_part_changed_since_is_refused_however_warm_it_is(part, tmp_path):
    last = cx.regenerate(cx.regenerate(part, h=1.5, check=False), h=1.4, check=False)
    drilled = last.cut(cq.Solid.makeCylinder(1, 40, cq.Vector(52, -30, -20)))
    shallow = last.cut(cq.Solid.makeCylinder(30, 0.01, cq.Vector(0, 0, -5)))
    assert abs(shallow.Volume(1e-6) / last.Volume(1e-6) - 1) < 1e-3
    inside_out = cq.Solid(last.wrapped.Reversed())
    for changed in (drilled, shallow, inside_out, cx.step(drilled, tmp_path / "drilled.step")):
        with pytest.raises(ValueError, match="it was changed since"):
            cx.regenerate(changed, h=1.3, check=False)
    assert cx.regenerate(last, h=1.3, check=False).isValid()


def test_a_part_of_the_same_faces_and_another_volume_is_refused(ridge):
    made = cx.paste(ridge, cq.Workplane().box(120, 80, 10).val(), at=(0, 0, 5), check=False)
    thinner = made.cut(cq.Solid.makeBox(120, 80, 0.01, cq.Vector(-60, -40, -5)))
    assert len(thinner.Faces()) == len(made.Faces())
    with pytest.raises(ValueError, match="it was changed since"):
        cx.regenerate(thinner, h=1.3, check=False)


def test_what_is_remembered_is_bounded(part, ridge, monkeypatch):
    monkeypatch.setattr(paste_history, "_KEPT", 3)
    for h in (1.0, 1.1, 1.2):
        cx.regenerate(part, h=h, check=False)
    assert len(paste_history._PARTS) == 3
    for size in range(paste_history._KEPT_TEXTS + 2):
        paste_history.from_text(paste_history.to_text(cq.Solid.makeBox(1, 1, 1 + size).wrapped))
    assert paste_history.from_text.cache_info().currsize == paste_history._KEPT_TEXTS
    for scale in range(1, record._KEPT + 3):
        record.ridge_in(record.record_of(ridge.resized(h=scale)))
    assert len(record._RIDGES) == record._KEPT
    assert len(regeneration._INNER) <= 8


@pytest.mark.parametrize("rates", [{"h": "2"}, {"w": True}, {"h": 1.0, "w": "wide"}])
def test_rates_are_numbers(rates):
    with pytest.raises(ValueError, match=r"^[hw]: expected a number, a rate, got "):
        cx.regenerate("no.step", **rates)
