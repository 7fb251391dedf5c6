"""The certificate lets a right change pass and names what is wrong with another."""

from __future__ import annotations

import dataclasses

import cadquery as cq
import numpy as np
import pytest
from inset_helpers import box, cylinder, cylinder_map, flat_ridge, on_map, top
from OCP.BRep import BRep_Builder
from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL, TopAbs_VERTEX
from OCP.TopoDS import TopoDS, TopoDS_Shell, TopoDS_Solid

from cad_export.certificate import Change, certify, check_shape, free_mesh_edges
from cad_export.check import subshapes
from cad_export.inset import inset
from cad_export.volume_by_height import volume_between
from ridgefeature.bspline import Surface

SURFACE, BASE = flat_ridge(1.0, z=5.0), flat_ridge(0.0, z=5.0)


def change(**other) -> Change:
    host = box()
    face = top(host)
    solid, report = inset(host.wrapped, face, SURFACE, BASE, check=False)
    old = subshapes(host.wrapped, TopAbs_FACE)
    new = tuple(TopoDS.Face_s(f) for f in subshapes(solid, TopAbs_FACE) if not any(f.IsSame(g) for g in old))
    right = Change((face,), solid, new, BASE, report.volume_expected)
    return dataclasses.replace(right, **other)


def test_a_right_change_passes() -> None:
    right = change()
    certify(right)
    assert right.volume_added == pytest.approx(right.volume_expected, rel=5e-4)
    assert 0 < right.largest_tolerance < 1e-4


@pytest.mark.parametrize("factor", [1.002, 0.998, -1.0, 0.0, np.nan])
def test_a_volume_that_is_off_by_more_than_one_in_a_thousand_fails(factor: float) -> None:
    with pytest.raises(ValueError, match="expected an added volume"):
        certify(change(volume_expected=factor * change().volume_expected), thorough=False)


def test_a_missing_face_or_solid_fails() -> None:
    right = change()
    with pytest.raises(ValueError, match="one solid, got 0"):
        certify(dataclasses.replace(right, solid=subshapes(right.solid, TopAbs_SHELL)[0]))
    build, solid, shell = BRep_Builder(), TopoDS_Solid(), TopoDS_Shell()
    build.MakeSolid(solid)
    build.MakeShell(shell)
    for face in subshapes(right.solid, TopAbs_FACE)[:-1]:
        build.Add(shell, face)
    build.Add(solid, shell)
    with pytest.raises(ValueError, match="closed shell"):
        certify(dataclasses.replace(right, solid=solid))


def test_a_slack_edge_fails() -> None:
    right = change()
    edge = cq.Face(right.new[0]).Edges()[0].wrapped
    BRep_Builder().UpdateEdge(edge, 0.1)
    with pytest.raises(ValueError, match=r"largest tolerance is 0\.1"):
        certify(right, thorough=False)
    assert subshapes(edge, TopAbs_VERTEX)


def test_solids_that_run_through_themselves_fail_the_thorough_check() -> None:
    check_shape(box().wrapped)
    both = cq.Compound.makeCompound([box(), box().translate(cq.Vector(5, 5, 5))])
    with pytest.raises(ValueError, match="cross itself"):
        check_shape(both.wrapped)
    assert free_mesh_edges(cylinder().wrapped) == 0


@pytest.mark.parametrize("h", [2.0, -1.0])
def test_the_volume_between_is_the_flux_with_its_caps_and_does_not_hang_on_the_place(h: float) -> None:
    bent = [on_map(flat_ridge(k), cylinder_map(20.0)) for k in (h, 0.0)]
    high, low = bent
    rows = [np.stack([low.poles[end], high.poles[end]]) for end in (0, -1)]
    start, end = (Surface(p, np.array([0.0, 0.0, 1.0, 1.0]), low.knots_v, 1, low.degree_v) for p in rows)
    enclosed = high.flux() - low.flux() + start.flux() - end.flux()
    assert volume_between(high, low) == pytest.approx(enclosed, rel=1e-12)
    far = [dataclasses.replace(s, poles=s.poles + 1000.0) for s in bent]
    assert volume_between(*far) == pytest.approx(volume_between(*bent), rel=1e-9)
    straight = [flat_ridge(k, bend=0.0) for k in (h, 0.0)]
    assert volume_between(*straight) == pytest.approx(h * 40.0 * 6.0 * 3 / 8, rel=1e-12)
