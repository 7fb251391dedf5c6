"""Which face a ridge is pasted on, and what is said where that has no room for it."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from made_ridges import made_ridge

import cad_export as cx
from ridgefeature.base import developed

STRAIGHT = made_ridge()  # 60 long, 12 broad with its flanks
BENT = made_ridge(length=40.0, bend=0.12, waves=0.5)


def block(*size: float) -> cq.Workplane:
    return cq.Workplane().box(*size)


@pytest.mark.parametrize("face", [">Z", cq.selectors.DirectionMinMaxSelector(cq.Vector(0, 0, 1))])
def test_a_face_may_be_named_by_a_selector(face):
    host = block(90, 80, 10)
    same = cx.paste(STRAIGHT, host, face=host.faces(">Z").val(), check=False)
    part = cx.paste(STRAIGHT, host, face=face, check=False)
    assert part.Volume(1e-4) == pytest.approx(same.Volume(1e-4), rel=1e-12)
    assert part.BoundingBox().zmax == pytest.approx(same.BoundingBox().zmax)


def test_a_face_may_be_the_one_selected_on_a_workplane():
    host = block(90, 80, 10)
    part = cx.paste(STRAIGHT, host, face=host.faces("<Z"), check=False)
    assert part.BoundingBox().zmin < -6 and part.BoundingBox().zmax == pytest.approx(5)


@pytest.mark.parametrize(
    ("face", "got"),
    [
        ("|Z", r"got 2 faces by '\|Z'"),
        ("nonsense(", r"got 'nonsense\('"),
        (">Z[9]", r"got '>Z\[9\]'"),
        (3, "got int"),
        (block(1, 1, 1), "got a Workplane with Solid"),
        (block(1, 1, 1).faces("|Z"), "got a Workplane with Face, Face"),
        (block(1, 1, 1).edges(">Z and >X").val(), "got Edge"),
        (block(1, 1, 1).faces(">Z").faces("<Z and >Z and |X"), "got a Workplane with nothing"),
    ],
)
def test_what_names_no_face_says_what_would(face, got):
    message = rf"face: expected a face of the host, a selector of one such as '>Z', .*{got}.*; "
    with pytest.raises(ValueError, match=message):
        cx.paste(STRAIGHT, block(90, 80, 10), face=face)


@pytest.mark.parametrize("size", [(30, 30, 30), (70, 8, 5), (40, 40, 40)])
@pytest.mark.parametrize("options", [{}, {"face": ">Z"}, {"at": (0, 0, 15)}, {"direction": (1, 1, 0)}])
def test_a_host_that_is_too_small_is_told_with_and_without_a_face(size, options):
    host = block(*size).translate((0, 0, 15 - size[2] / 2))
    with pytest.raises(
        ValueError, match=r"(face|host|at): expected a face with room .* 60 mm long and 12 mm broad"
    ):
        cx.paste(STRAIGHT, host, **options)


def test_too_small_is_a_matter_of_shape_not_of_area_alone():
    x, y = np.ptp(developed(BENT)[0], axis=0)
    assert y > 0.2 * x
    with pytest.raises(ValueError, match="too small wherever it lies"):
        cx.paste(BENT, block(x + 20, 12.5, 5), face=">Z")
    with pytest.raises(ValueError, match="too small wherever it lies"):
        cx.paste(STRAIGHT, cq.Workplane().cylinder(12, 8), face="%CYLINDER")


def test_a_face_with_room_elsewhere_is_not_called_too_small():
    with pytest.raises(ValueError, match="leaves the face near"):
        cx.paste(STRAIGHT, block(62, 13, 5), face=">Z", direction=(0, 1, 0))
    with pytest.raises(ValueError, match="leaves the face near"):
        cx.paste(STRAIGHT, cq.Workplane().cylinder(5, 31.5), face=">Z", at=(0, 10, 2.5), direction=(1, 0, 0))
    with pytest.raises(ValueError, match="several largest faces"):
        cx.paste(STRAIGHT, block(62, 13, 13))
