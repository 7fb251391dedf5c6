"""Faces, solids and STEP files hold the exact poles, and fail in words."""

from __future__ import annotations

import dataclasses

import cadquery as cq
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import spiral_ridge
from surfaces import FakeRidge, ridge_surface, ring

import cad_export as cx
from cad_export.check import check_solid, volume
from cad_export.geometry import from_occt, to_occt
from ridgefeature.bspline import Surface, clamped_knots


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_occt_and_back_is_exact(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p, q = rng.integers(1, 5, 2)
    knots_u, knots_v = (clamped_knots(np.cumsum(rng.uniform(0.1, 1, rng.integers(2, 7))), d) for d in (p, q))
    poles = rng.normal(size=(knots_u.size - p - 1, knots_v.size - q - 1, 3))
    surface = Surface(poles, knots_u, knots_v, int(p), int(q))
    occt = to_occt(surface)
    back = from_occt(occt)
    for a, b in ((back.poles, poles), (back.knots_u, knots_u), (back.knots_v, knots_v)):
        np.testing.assert_array_equal(a, b)
    u, v = 0.3 * knots_u[0] + 0.7 * knots_u[-1], 0.6 * knots_v[0] + 0.4 * knots_v[-1]
    point = occt.Value(u, v)
    np.testing.assert_allclose((point.X(), point.Y(), point.Z()), surface(u, v), atol=1e-12)


def test_a_face_is_valid_and_exact() -> None:
    surface = ridge_surface()
    face = cx.face(surface)
    assert isinstance(face, cq.Face) and face.isValid() and len(face.Edges()) == 4
    np.testing.assert_array_equal(cx.surface_of(face).poles, surface.poles)
    u, v = 0.5, 0.0
    normal, _ = face.normalAt(u, v)
    np.testing.assert_allclose(normal.toTuple(), surface.normal(u, v), atol=1e-9)


def test_a_face_of_a_ridge_takes_its_rates() -> None:
    for h, w in ((1, 1), (2, 0.5)):
        got = cx.surface_of(cx.face(FakeRidge(), h=h, w=w))
        np.testing.assert_array_equal(got.poles, ridge_surface(1.5 * h, 2.0 * w).poles)


def test_a_face_is_made_in_another_unit_on_request() -> None:
    ridge = dataclasses.replace(spiral_ridge(), unit="cm")
    face = cx.face(ridge, h=1.5, unit="mm")
    np.testing.assert_allclose(cx.surface_of(face).poles, 10 * ridge.resized(h=1.5).surface().poles)
    [(_, record)] = cx.carried_by(face)
    assert record.h == 1.5 and record.feature["unit"] == "cm"
    assert np.array_equal(cx.surface_of(cx.face(ridge)).poles, ridge.surface().poles)
    with pytest.raises(ValueError, match="expected a length unit"):
        cx.face(ridge, unit="parsec")


def test_a_moved_face_gives_poles_in_its_place() -> None:
    surface = ridge_surface()
    got = cx.surface_of(cx.face(surface).translate(cq.Vector(1, 2, 3)))
    np.testing.assert_allclose(got.poles, surface.poles + np.array([1, 2, 3]), atol=1e-12)


def test_a_closed_ring_is_one_face_and_a_solid() -> None:
    surface = ring()
    face = cx.face(surface)
    assert face.isValid()
    np.testing.assert_array_equal(cx.surface_of(face).poles, surface.poles)
    solid = cx.solid(surface, 2.0)
    assert len(solid.Faces()) == 4
    assert solid.Volume(1e-5) == pytest.approx(2.0 * np.pi * (46.0**2 - 34.0**2), rel=1e-5)


def test_a_ridge_that_tapers_to_points_makes_a_face_and_a_solid() -> None:
    surface = ridge_surface()
    narrow = np.ones(surface.poles.shape[0])
    narrow[:4], narrow[-4:] = (0.0, 0.3, 0.7, 0.9), (0.9, 0.7, 0.3, 0.0)
    middle = surface.poles[:, 6:7]
    poles = middle + (surface.poles - middle) * narrow[:, None, None]
    surface = dataclasses.replace(surface, poles=poles)
    assert cx.face(surface).isValid()
    solid = cx.solid(surface, 2.0)
    assert len(solid.Faces()) == 4 and solid.isValid()


@pytest.mark.parametrize("source", [ridge_surface(), FakeRidge(), FakeRidge(h=-0.5)])
def test_a_solid_is_closed_and_keeps_the_exact_face(source: Surface | FakeRidge) -> None:
    solid = cx.solid(source, thickness=2.0)
    assert isinstance(solid, cq.Solid) and solid.isValid() and len(solid.Shells()) == 1
    assert len(solid.Faces()) == 6
    surface = source if isinstance(source, Surface) else source.surface()
    poles = [cx.surface_of(face).poles for face in solid.Faces()]
    assert sum(p.shape == surface.poles.shape and np.array_equal(p, surface.poles) for p in poles) == 1
    mesh, triangles = solid.tessellate(0.01)
    points = np.array([p.toTuple() for p in mesh])[np.array(triangles)]
    assert np.einsum("ij,ij->", points[:, 0], np.cross(points[:, 1], points[:, 2])) / 6 == pytest.approx(
        solid.Volume(1e-5), rel=1e-2
    )  # outwards, and no triangle missing


@pytest.mark.parametrize("h", [1.0, 0.0, 2.5, -0.5])
def test_the_volume_is_the_slab_and_the_integral_of_the_ridge(h: float) -> None:
    """On a flat base: the height integrated over an annulus' sector, plus the sector's slab."""

    class Flat(FakeRidge):
        def surface(self) -> Surface:
            return ridge_surface(1.5 * self.h, 2.0 * self.w, slope=0.0, bend=0.0, rows=30)

    a, da = np.linspace(0, 1, 2, retstep=True)
    y = np.linspace(-6, 6, 20001)
    expected = np.trapezoid((2.0 + 1.5 * h * np.exp(-((y / 2) ** 2))) * (40.0 - y), y) * da
    assert a.size == 2
    solid = cx.solid(Flat(), thickness=2.0, h=h, check=False)
    assert solid.Volume(1e-5) == pytest.approx(expected, rel=1e-3)
    assert solid.BoundingBox().zmin == pytest.approx(-2.0, abs=1e-4)


def test_thickness_is_kept_at_the_feet_of_a_curved_base() -> None:
    surface = ridge_surface(height=0.0, slope=20.0, bend=0.0)
    solid = cx.solid(surface, thickness=1.5, check=False)
    low = [s for s in map(cx.surface_of, solid.Faces()) if s.poles.shape == surface.poles.shape]
    low = next(s for s in low if not np.array_equal(s.poles, surface.poles))
    _, _, d = low.project(surface.grid(15, 7)[2:-2, 2:-2])
    np.testing.assert_allclose(d, 1.5, atol=0.05)


@pytest.mark.parametrize("thickness", [0.0, -1.0, np.nan, np.inf])
def test_a_bad_thickness_is_an_error(thickness: float) -> None:
    with pytest.raises(ValueError, match="thickness above 0"):
        cx.solid(ridge_surface(), thickness)


def test_a_groove_deeper_than_the_slab_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"thickness above 1\.4"):
        cx.solid(FakeRidge(), thickness=1.0, h=-1)


def test_a_lower_face_that_folds_is_an_error() -> None:
    bowl = ridge_surface(height=0.0, slope=-100.0, bend=0.0)
    with pytest.raises(ValueError, match="radius of curvature"):
        cx.solid(bowl, thickness=60.0)


def told(text: str, words: str) -> float:
    """The number after these words."""
    return float(text.partition(words)[2].split()[0].rstrip(",;"))


def test_the_largest_thickness_that_is_told_goes() -> None:
    bowl = ridge_surface(height=0.0, slope=-100.0, bend=0.0)
    with pytest.raises(ValueError, match="at most") as caught:
        cx.solid(bowl, thickness=60.0, check=False)
    most = told(str(caught.value), "at most")
    assert cx.solid(bowl, thickness=most, check=False).isValid()
    with pytest.raises(ValueError, match="radius of curvature"):
        cx.solid(bowl, thickness=1.01 * most, check=False)


def test_the_least_thickness_that_is_told_goes() -> None:
    with pytest.raises(ValueError, match="above") as caught:
        cx.solid(FakeRidge(), thickness=1.0, h=-1)
    assert cx.solid(FakeRidge(), thickness=1.01 * told(str(caught.value), "above"), h=-1).isValid()


def test_a_base_that_folds_has_no_thickness_that_goes() -> None:
    """Broader to the inside than its path's radius of 40."""
    flat = ridge_surface(height=0.0, slope=0.0, bend=0.0)
    middle = flat.poles[:, 6:7]
    folded = dataclasses.replace(flat, poles=middle + 8 * (flat.poles - middle))
    with pytest.raises(ValueError, match="does not fold, got one that does at arc length"):
        cx.solid(folded, thickness=0.1)


def test_a_thickness_at_which_the_slab_meets_itself_is_told_with_one_that_goes() -> None:
    """A helix whose turns lie above each other: the slab below one reaches the next."""
    surface = ridge_surface(turn=2.4 * np.pi, slope=0.2, bend=0.0, rows=40)
    with pytest.raises(ValueError, match="self-intersections") as caught:
        cx.solid(surface, thickness=12.0)
    most = told(str(caught.value), "one of at most")
    assert 3.0 < most < 8.0
    assert cx.solid(surface, thickness=most).isValid()


def test_a_path_that_crosses_itself_is_an_error() -> None:
    surface = ridge_surface(turn=2.2 * np.pi, slope=0.02, rows=12)
    with pytest.raises(ValueError, match="self-intersections"):
        cx.solid(surface, thickness=3.0)


def test_check_solid_tells_what_is_wrong() -> None:
    box = cq.Solid.makeBox(1, 2, 3).wrapped
    check_solid(box, 6.0)
    assert volume(box) == pytest.approx(6.0)
    with pytest.raises(ValueError, match=r"volume 7, got 6"):
        check_solid(box, 7.0)
    with pytest.raises(ValueError, match="one solid, got 0"):
        check_solid(cq.Compound.makeCompound([]).wrapped, 6.0)
    open_box = cq.Solid.makeSolid(cq.Shell.makeShell(cq.Solid.makeBox(1, 2, 3).Faces()[:5]))
    with pytest.raises(ValueError, match="open borders"):
        check_solid(open_box.wrapped, 6.0)


def test_surface_of_needs_one_exact_face() -> None:
    box = cq.Workplane().box(1, 1, 1)
    with pytest.raises(ValueError, match="one face, got 6"):
        cx.surface_of(box.val())
    with pytest.raises(ValueError, match="B-spline surface, got Geom_Plane"):
        cx.surface_of(box.faces(">Z").val())
    with pytest.raises(ValueError, match="CAD shape, got NoneType"):
        cx.surface_of(None)
    round_face = cq.Solid.makeCylinder(1, 2).Faces()[0].toNURBS()
    with pytest.raises(ValueError, match="non-rational"):
        cx.surface_of(round_face)
