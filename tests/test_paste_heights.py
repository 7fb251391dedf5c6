"""The volume that a pasted ridge adds, as its height goes from a deep groove to three times the registered.

The poles are affine in h, so the volume is a polynomial of degree 3 in h; of degree 1 where the normals of
the base are parallel, on a plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from oracles import spiral_ridge

import cad_export as cx
import ridgefeature as rf
from cad_export import pasting
from cad_export.check import volume
from cad_export.occt_arrays import pole_array

HEIGHTS = np.linspace(-2.0, 3.0, 50)
MEASURED = slice(0, 50, 7)
"""The pastes whose whole solid is measured, too."""


@dataclass(frozen=True)
class Host:
    solid: cq.Solid
    face: cq.Face
    at: tuple[float, float, float]
    direction: tuple[float, float, float]


def plane() -> Host:
    box = cq.Workplane().box(60, 40, 16)
    return Host(box.val(), box.faces(">Z").val(), (0, 0, 8), (1, 0, 0))


def cylinder() -> Host:
    made = cq.Workplane().cylinder(60, 30)
    return Host(made.val(), made.faces("%CYLINDER").val(), (0, -30, 0), (0, 0, 1))


def sphere() -> Host:
    made = cq.Workplane().sphere(40)
    return Host(made.val(), made.faces().val(), (0, -40, 0), (1, 0, 0))


def spline() -> Host:
    grid = [[cq.Vector(x, y, 3 * np.sin(x / 30) * np.cos(y / 35)) for y in np.linspace(-25, 25, 8)]
            for x in np.linspace(-30, 30, 10)]  # fmt: skip
    skin = cq.Face.makeSplineApprox(grid, tol=1e-3)
    made = cq.Workplane(cq.Solid.extrudeLinear(skin, cq.Vector(0, 0, -20)))
    return Host(made.val(), made.faces(">Z").val(), (0, 0, 0), (1, 0, 0))


HOSTS = {"plane": plane, "cylinder": cylinder, "sphere": sphere, "spline": spline}


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge().stretched(20.0, "trim")


@dataclass(frozen=True)
class Heights:
    """Volumes (50,) by the integral, and by OCCT over the faces that changed; (8,) of whole solids."""

    name: str
    expected: np.ndarray
    added: np.ndarray
    whole: np.ndarray


@pytest.fixture(scope="module", params=HOSTS)
def heights(request, ridge) -> Heights:
    host, reports, solids = HOSTS[request.param](), [], []
    place = {"face": host.face, "at": host.at, "direction": host.direction, "scale": 0.5, "check": False}
    for h in HEIGHTS:
        reports.append({})
        solids.append(cx.paste(ridge, host.solid, h=h, report=reports[-1], **place))
    assert {report["method"] for report in reports} == {"inset"}
    expected, added = (np.array([r[k] for r in reports]) for k in ("volume_expected", "volume_added"))
    before = volume(host.solid.wrapped, 1e-8)
    whole = np.array([volume(solid.wrapped, 1e-8) - before for solid in solids[MEASURED]])
    return Heights(request.param, expected, added, whole)


def test_every_step_up_adds_volume(heights: Heights) -> None:
    for volumes in (heights.expected, heights.added, heights.whole):
        assert (np.diff(volumes) > 0).all()


def test_on_a_plane_the_volume_is_affine_in_the_height_elsewhere_cubic(heights: Heights) -> None:
    fit = np.polynomial.Polynomial.fit(HEIGHTS, heights.expected, 1 if heights.name == "plane" else 3)
    size = np.ptp(heights.expected)
    np.testing.assert_allclose(heights.expected, fit(HEIGHTS), rtol=0, atol=1e-12 * size)
    # OCCT's own integration of the whole solid
    np.testing.assert_allclose(heights.whole, fit(HEIGHTS[MEASURED]), rtol=0, atol=1e-6 * size)
    if heights.name == "plane":
        assert fit(0.0) == pytest.approx(0.0, abs=1e-12 * size)


def test_what_was_measured_is_what_was_expected(heights: Heights) -> None:
    np.testing.assert_allclose(heights.added, heights.expected, rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(heights.whole, heights.expected[MEASURED], rtol=1e-4)


@pytest.mark.parametrize("name", HOSTS)
def test_another_width_is_the_same_on_a_warm_place_and_a_cold_one(name: str, ridge: rf.Ridge) -> None:
    host = HOSTS[name]()
    place = {"face": host.face, "at": host.at, "direction": host.direction, "scale": 0.5, "check": False}
    widths = (1.0, 0.8, 0.97, 1.1, 1.2, 0.6)
    warm = [cx.paste(ridge, host.solid, w=w, **place) for w in widths]
    stand = next(reversed(pasting._STANDS.values()))
    assert len(stand.sites) == pasting._KEPT_WIDTHS < len(widths)
    # the first was pasted on a cold place; of the others one at first, one when places were forgotten
    for w, part in ((widths[1], warm[1]), (widths[-1], warm[-1])):
        pasting._STANDS.clear()
        cold = cx.paste(ridge, host.solid, w=w, **place)
        one, other = (pole_array(BRep_Tool.Surface_s(cx.carried_by(p)[0][0])) for p in (part, cold))
        assert np.array_equal(one, other)
        # the rest of the face is measured once, at the first width
        assert volume(part.wrapped, 1e-6) == pytest.approx(volume(cold.wrapped, 1e-6), rel=1e-9)
