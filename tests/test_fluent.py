"""The ridge in a chain of CadQuery calls."""

from __future__ import annotations

import importlib
import subprocess
import sys

import cadquery as cq
import pytest
from cadquery import cqgi
from oracles import spiral_ridge

import cad_export as cx
import ridgefeature as rf


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge().stretched(20.0, "trim")


def host() -> cq.Workplane:
    return cq.Workplane().box(160, 160, 10)


def test_both_ways_give_what_paste_gives(ridge):
    faces = host().faces(">Z")
    pasted = cx.paste(ridge, faces.end(), face=faces.val(), h=1.5, check=False).Volume(1e-6)
    assert faces.pasteRidge(ridge, h=1.5, check=False).val().Volume(1e-6) == pytest.approx(pasted, rel=1e-9)
    invoked = faces.invoke(cx.ridge(ridge, h=1.5, check=False))
    assert invoked.val().Volume(1e-6) == pytest.approx(pasted, rel=1e-9)


def test_the_chain_goes_on_and_the_ridge_can_be_selected_by_tag(ridge):
    part = host().faces(">Z").pasteRidge(ridge, tag="bead", check=False)
    assert part.faces(tag="bead").size() == 1
    assert part.faces(tag="bead").val().geomType() == "BSPLINE"
    assert part.faces("<Z").workplane().hole(3).solids().size() == 1
    assert part.end(2).val().isSame(part.end(2).val())


def test_it_is_pasted_at_every_location(ridge):
    once = host().faces(">Z").pasteRidge(ridge, check=False).val().Volume(1e-6) - 256000
    three = (
        host().faces(">Z").workplane().rarray(1, 40, 1, 3).pasteRidge(ridge, h=1, tag="beads", check=False)
    )
    assert three.val().Volume(1e-6) - 256000 == pytest.approx(3 * once, rel=1e-3)
    assert three.faces(tag="beads").size() == 3


def test_points_edges_and_bare_workplanes_serve_as_places(ridge):
    top = host().faces(">Z").workplane()
    for places in (top, top.pushPoints([(5, 5)]), host().faces(">Z").vertices("<X and <Y")):
        if places.vals() and isinstance(places.val(), cq.Vertex):
            with pytest.raises(ValueError, match="at: expected a face with room"):
                places.pasteRidge(ridge, check=False)
        else:
            assert places.pasteRidge(ridge, check=False).solids().size() == 1


def test_a_chain_without_a_solid_is_refused(ridge):
    with pytest.raises(ValueError, match="solid"):
        cq.Workplane().pasteRidge(ridge)


def test_importing_adds_one_name_and_overrides_none_in_either_order():
    script = """
import importlib, sys
import cad_export
assert "cadquery" not in sys.modules
import cadquery as cq
assert hasattr(cq.Workplane, "pasteRidge")
assert not any("cad_export" in type(finder).__module__ for finder in sys.meta_path)

# as if cadquery alone had been imported
for name in [name for name in sys.modules if name.partition(".")[0] == "cad_export"]:
    del sys.modules[name]
del cq.Workplane.pasteRidge
before = dict(vars(cq.Workplane))
import cad_export
after = dict(vars(cq.Workplane))
assert set(after) - set(before) == {"pasteRidge"}, after
assert all(after[k] is v for k, v in before.items() if k != "__dict__")
importlib.reload(cad_export)
assert vars(cq.Workplane)["pasteRidge"] is after["pasteRidge"]
"""
    subprocess.run([sys.executable, "-P", "-c", script], check=True)


def test_a_reload_of_the_package_works(ridge):
    importlib.reload(cx)
    assert host().faces(">Z").pasteRidge(ridge, check=False).solids().size() == 1


SCRIPT = """
import cadquery as cq
import cad_export
import ridgefeature as rf

h = 1.0
w = 1.0
ridge = rf.load(FILE)
part = cq.Workplane().box(160, 160, 10).faces(">Z").pasteRidge(ridge, h=h, w=w, check=False)
show_object(part)
"""


def test_a_script_regenerates_with_other_parameters(ridge, tmp_path):
    file = tmp_path / "bead.ridge.json"
    ridge.save(file)
    model = cqgi.parse(SCRIPT.replace("FILE", repr(str(file))))
    assert {"h", "w"} <= set(model.metadata.parameters)
    volumes = []
    for h in (1.0, 2.0):
        built = model.build({"h": h})
        assert built.success, built.exception
        volumes.append(built.results[0].shape.val().Volume(1e-6) - 256000)
    assert volumes[1] == pytest.approx(2 * volumes[0], rel=1e-4)
