"""Flanks that would fold are narrowed; what is needed for the feet stays."""

import cadquery as cq
import numpy as np
import pytest
from made_ridges import made_ridge

import cad_export as cx
from cad_export.face_base import face_base
from cad_export.flanks import UNFOLDED
from ridgefeature.merge import LEAST_BORDER

STRAIGHT = made_ridge(40.0, 41)


def plate() -> cq.Workplane:
    return cq.Workplane().box(200, 200, 10)


def circle(radius: float) -> cq.Edge:
    return cq.Edge.makeCircle(radius, cq.Vector(0, 0, 5))


def test_where_nothing_folds_nothing_changes():
    face = plate().faces(">Z").val()
    _, plain = face_base(face, STRAIGHT)
    _, same = face_base(face, STRAIGHT, w=1.0)
    np.testing.assert_array_equal(same.border, plain.border)


def test_around_a_small_circle_flanks_end_before_its_middle():
    face, radius = plate().faces(">Z").val(), 5.5  # the flanks are 6 broad, the feet 3.3
    with pytest.raises(ValueError, match="bends wider"):
        face_base(face, STRAIGHT, path=circle(radius))
    _, fitted = face_base(face, STRAIGHT, path=circle(radius), w=1.0)
    np.testing.assert_allclose(fitted.border, (1 - UNFOLDED) * radius, rtol=0.02)
    assert (fitted.border > LEAST_BORDER * fitted.width).all()
    assert fitted.border[0] == fitted.border[-1]
    solid = cx.paste(fitted, plate().val(), path=circle(radius), check=True)
    assert solid.isValid()


def test_a_smaller_width_lets_the_flanks_be_narrower():
    face, radius = plate().faces(">Z").val(), 3.2
    with pytest.raises(ValueError, match="bends wider"):
        face_base(face, STRAIGHT, path=circle(radius), w=1.0)
    _, fitted = face_base(face, STRAIGHT, path=circle(radius), w=0.5)
    assert fitted.border.max() < radius
    assert fitted.resized(w=0.5).width.max() == pytest.approx(0.5 * fitted.width.max())


def test_on_a_small_ball_it_is_the_face_that_folds_them():
    ball = cq.Workplane().sphere(3.6)
    small = made_ridge(8.0, 41, width=4.0, border=5.4)
    _, fitted = face_base(ball.faces().val(), small, at=(0, -3.6, 0), direction=(1, 0, 0), w=1.0)
    # beside a great circle one goes along by the cosine
    np.testing.assert_allclose(np.cos(fitted.border / 3.6), UNFOLDED, atol=0.01)
    assert fitted.border.max() < 5.4


def test_only_near_the_bend_and_alike_on_a_turned_face():
    face = plate().faces(">Z").val()
    bend = made_ridge(90.0, 91, 0.17, 1.5, border=6.0)
    _, fitted = face_base(face, bend, direction=(1, 0, 0), w=1.0)
    _, turned = face_base(face, bend, direction=(1, 2, 0), w=1.0)
    np.testing.assert_allclose(fitted.border, turned.border, rtol=1e-9)
    assert fitted.border.min() == pytest.approx((1 - UNFOLDED) / 0.17, rel=0.03)
    assert fitted.border.max() == 6.0
