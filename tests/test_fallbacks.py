"""Where a ridge cannot be set into its face: a sunk fuse, or an error that says what to change."""

from __future__ import annotations

from dataclasses import replace

import cadquery as cq
import numpy as np
import pytest
from inset_helpers import box, curved_face, cylinder_map, flat_ridge, on_map

from cad_export.certificate import Change, free_mesh_edges
from cad_export.check import volume
from cad_export.fallbacks import fallback, sunk_fuse
from cad_export.inset import face_of, inset
from cad_export.seam import split_inset
from cad_export.site import SeamError, Site
from ridgefeature.bspline import Surface

LYING = cq.Workplane("YZ").circle(20).extrude(60).translate((-30, 0, 0)).val()
"""A cylinder along x, its seam at y = 20."""


def straight(h: float, around: float) -> tuple[Surface, Surface]:
    """A straight ridge along a cylinder about x, so far round from the top."""
    place = cylinder_map(20.0)
    made = (flat_ridge(x, length=24.0, w=4.0, bend=0.0, rows=9) for x in (h, 0.0))
    surface, base = (on_map(s, lambda x, y: place(x, y + around)) for s in made)
    return surface, base


def fallen(host: cq.Shape, face, pair: tuple[Surface, Surface]) -> tuple[Change, str]:
    return fallback(host.wrapped, Site(face_of(host.wrapped, face), *pair), 1.0, False)


@pytest.mark.parametrize("h", [1.0, -1.0])
def test_a_border_along_the_seam_is_fused(h: float) -> None:
    quarter = np.pi / 2 * 20.0
    pair = straight(h, quarter - 3.6)
    site = Site(face_of(LYING.wrapped, curved_face(LYING)), *pair)
    with pytest.raises(SeamError, match="runs along it"):
        split_inset(LYING.wrapped, site, 1.0)
    before = volume(LYING.wrapped), len(LYING.Edges())
    change, method = fallback(LYING.wrapped, site, 1.0, False)
    assert method == "sunk fuse" and free_mesh_edges(change.solid) == 0
    assert change.volume_added == pytest.approx(change.volume_expected, rel=1e-3)
    assert before == (volume(LYING.wrapped), len(LYING.Edges()))


def test_beside_it_nothing_is_fused() -> None:
    for around in (np.pi / 2 * 20.0, np.pi / 2 * 20.0 - 3.5):
        change, method = fallen(LYING, curved_face(LYING), straight(1.0, around))
        assert method == "split seam"
        added = volume(change.solid, 1e-9) - volume(LYING.wrapped, 1e-9)
        assert added == pytest.approx(change.volume_expected, rel=1e-3)


def plate(radius: float) -> cq.Solid:
    """A plate whose top, z = 5, goes on beyond x = 10 as a cylinder that bends down."""
    a = 30.0 / radius
    end = (10 + radius * np.sin(a), 5 - radius * (1 - np.cos(a)))
    middle = (10 + radius * np.sin(a / 2), 5 - radius * (1 - np.cos(a / 2)))
    profile = cq.Workplane("XZ").moveTo(-40, -5).lineTo(-40, 5).lineTo(10, 5).threePointArc(middle, end)
    return profile.lineTo(end[0], -5).close().extrude(25, both=True).val()


def flat_top(host: cq.Solid):
    return next(f for f in host.Faces() if f.geomType() == "PLANE" and f.normalAt().z > 0.9999).wrapped


def test_over_a_face_that_follows_closely_is_fused() -> None:
    host, pair = plate(40000.0), (flat_ridge(1.0, z=5.0), flat_ridge(0.0, z=5.0))
    change, method = fallen(host, flat_top(host), pair)
    assert method == "sunk fuse"
    assert volume(change.solid, 1e-9) - volume(host.wrapped, 1e-9) == pytest.approx(
        change.volume_expected, rel=1e-3
    )


def test_over_a_fillet_or_in_the_air_is_an_error_in_words() -> None:
    pair = flat_ridge(1.0, z=5.0), flat_ridge(0.0, z=5.0)
    for host in (plate(100.0), box(30, 50, 10)):
        with pytest.raises(ValueError, match=r"leaves the face's outline; move the path \(near .* is .* off"):
            fallen(host, flat_top(host), pair)


def test_what_a_fuse_cannot_make_is_an_error_in_words() -> None:
    host, base = box(), flat_ridge(0.0, z=5.0)
    with pytest.raises(ValueError, match="a height that is not 0"):
        sunk_fuse(host.wrapped, base, base)
    ridge = flat_ridge(1.0, z=5.0)
    way = np.linspace(-1, 1, len(base.poles))[:, None, None]
    both = replace(ridge, poles=base.poles + (ridge.poles - base.poles) * way)
    with pytest.raises(ValueError, match="got both"):
        sunk_fuse(host.wrapped, both, base)


def test_the_report_names_the_method() -> None:
    _, report = inset(LYING.wrapped, curved_face(LYING), *straight(1.0, np.pi / 2 * 20.0), check=False)
    assert report.method == "split seam" and report.largest_tolerance < 5e-4 * 7.2
    assert report.volume_added == pytest.approx(report.volume_expected, rel=1e-3)
