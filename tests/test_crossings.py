"""Where a ridge meets others: side by side, crossed by some, behind a corner, or run into a blob."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from oracles import window_on

import ridgefeature as rf
from ridgefeature.continuation import FLAT, risen
from ridgefeature.march import Track
from ridgefeature.section import Section, cosine, dome, plateau
from ridgefeature.settle import settle
from ridgefeature.stations import lay_out
from ridgefeature.template import Template

SCANS = Path(os.environ.get("RIDGE_SCANS") or "/nowhere")
H, W, NOISE = 2.0, 6.0, 0.05


def plane(seed: int, x: tuple[float, float], y: tuple[float, float], spacing: float = 0.45) -> np.ndarray:
    """(n, 2) places spread evenly."""
    random = np.random.default_rng(seed)
    count = int((x[1] - x[0]) * (y[1] - y[0]) / spacing**2)
    return random.uniform((x[0], y[0]), (x[1], y[1]), (count, 2))


def scanned(places: np.ndarray, heights: np.ndarray, seed: int) -> np.ndarray:
    """(n, 3) places (n, 2) at heights (n,) with noise."""
    points = np.column_stack([places, heights])
    return points + np.random.default_rng(seed + 1).normal(0, NOISE, points.shape)


def ridge_over(distance: np.ndarray, height: float = H, width: float = W) -> np.ndarray:
    return height * cosine()(distance / width)


def network(seed: int, spacing: float, section: Section) -> np.ndarray:
    """A ridge along x that others like it cross every `spacing`."""
    places = plane(seed, (-10, 100), (-25, 25))
    x, y = places.T
    apart = np.abs((x - 0.5 * spacing) % spacing - 0.5 * spacing)
    across = np.where((x > 5) & (x < 95), apart, 99.0)
    return scanned(places, np.maximum(H * section(y / W), H * section(across / W)), seed)


def beside(seed: int, apart: float, height: float, width: float) -> np.ndarray:
    """A groove 1.2 deep and 5 wide along x, and a ridge beside it."""
    places = plane(seed, (-40, 40), (-20, 20))
    y = places[:, 1]
    return scanned(places, ridge_over(y - apart, height, width) - ridge_over(y, 1.2, 5.0), seed)


@pytest.mark.parametrize("seed", range(5))
def test_of_a_groove_and_a_ridge_beside_it_the_one_that_was_aimed_at_is_found(seed):
    """The ridge explains more of the points about the pick, but that lies beyond its half height."""
    found = rf.register(beside(seed, 5.0, 3.0, 9.0), at=(0.0, 1.0, -0.8), kind="auto")
    middle = np.abs(found.spine[:, 0]) < 30
    assert middle.sum() > 5
    assert np.abs(found.spine[middle, 1]).max() < 2.5


@pytest.mark.parametrize("seed", range(3))
def test_where_what_is_nearest_is_no_ridge_the_one_beside_it_is_found(seed):
    found = rf.register(beside(seed, 6.0, 3.0, 8.0), at=(0.0, 1.0, -0.8), kind="auto")
    assert found.length > 60
    assert np.median(np.abs(found.height)) > 2.5


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("section", "spacing"), [(plateau, 10.0), (plateau, 13.0), (cosine, 10.0), (cosine, 11.0), (cosine, 16.0)]
)
def test_a_ridge_is_followed_straight_over_others_that_cross_it(section, spacing, seed):
    found = rf.register(network(seed, spacing, section()), at=(0.0, 0.0, H))
    low, high = np.sort(found.spine[[0, -1], 0])
    assert low < -9 and high > 99
    assert np.abs(found.spine[:, 1]).max() < 1.0
    assert np.median(found.height) == pytest.approx(H, rel=0.1)


@pytest.mark.parametrize("rise", [2.0, 3.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_ridge_ends_where_it_runs_into_a_blob(seed, rise):
    """A blob at its end, twice or three times as high and wider."""
    places = plane(seed, (-30, 60), (-15, 15))
    x, y = places.T
    blob = rise * H * np.exp(-0.5 * ((x - 44) ** 2 + y**2) / 3.0**2)
    on = np.where((x > -20) & (x < 42), ridge_over(y), 0.0)
    found = rf.register(scanned(places, np.maximum(on, blob), seed), at=(0.0, 0.0, H))
    low, high = np.sort(found.spine[[0, -1], 0])
    assert abs(low + 20) < 0.5 * W
    assert 34 < high < 44
    assert found.height.max() < 1.3 * H
    assert np.median(found.half_height_width) == pytest.approx(0.496 * W, rel=0.1)


def blobbed(seed: int, rise: float, size: float, strays: int, section: Section, noise: float) -> np.ndarray:
    """A ridge along x from -20 to 42 that ends in a blob no wider than itself, which casts a shadow."""
    places = plane(seed, (-30, 60), (-15, 15))
    x, y = places.T
    blob = rise * H * np.exp(-0.5 * ((x - 44) ** 2 + y**2) / size**2)
    z = np.maximum(np.where((x > -20) & (x < 42), H * section(y / W), 0.0), blob)
    behind = x - 44 - 0.3 * size
    seen = ~((behind > 0) & (behind < 3 * size) & (np.abs(y) < 1.2 * size))
    random = np.random.default_rng(seed + 1)
    points = np.column_stack([places, z])[seen]
    odd = np.column_stack(
        [random.uniform(low, high, strays) for low, high in ((42, 47), (-2, 2), (H, 3 * H))]
    )
    return np.vstack([points + random.normal(0, noise, points.shape), odd])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("rise", "size", "strays", "section", "noise"),
    [
        (1.7, 1.5, 0, plateau(), 0.02),
        (2.0, 1.5, 20, plateau(), 0.02),
        (1.8, 2.0, 20, plateau(), 0.01),
        (1.6, 2.0, 20, dome(), 0.02),
    ],
)
def test_an_end_does_not_run_up_a_blob_nor_beyond_its_points(seed, rise, size, strays, section, noise):
    points = blobbed(seed, rise, size, strays, section, noise)
    found = rf.register(points, at=(0.0, 0.0, H))
    low, high = np.sort(found.spine[[0, -1], 0])
    assert abs(low + 20) < 0.5 * W
    assert 36 < high < 48
    assert found.height.max() < 1.25 * H
    end = found.end_interval[int(np.argmax(found.spine[[0, -1], 0]))]
    at = found.length if found.spine[-1, 0] > found.spine[0, 0] else 0.0
    assert end[0] <= at <= end[1]


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    ("rise", "size", "section"),
    [(1.8, 1.2, cosine()), (2.1, 1.6, cosine()), (1.8, 2.0, plateau()), (2.1, 2.5, dome())],
)
def test_a_steep_ridge_does_not_climb_what_it_runs_into(seed, rise, size, section):
    """A mound about as narrow as the ridge, so that one section fits both, but much higher within a width."""
    high = float(W)
    places = plane(seed, (-30, 60), (-15, 15), 0.35)
    x, y = places.T
    mound = rise * high * np.exp(-0.5 * (((x - 47) / (3 * size)) ** 2 + (y / size) ** 2))
    z = np.maximum(np.where((x > -20) & (x < 44), high * section(y / W), 0.0), mound)
    found = rf.register(scanned(places, z, seed), at=(0.0, 0.0, high))
    low, last = np.sort(found.spine[[0, -1], 0])
    assert abs(low + 20) < 0.5 * W
    assert 34 < last < 47
    assert found.height.max() < 1.3 * high


@pytest.mark.parametrize(("slope", "over"), [(1.5, 25.0), (3.0, 10.0)])
@pytest.mark.parametrize("seed", range(4))
def test_a_ridge_ends_where_it_runs_into_the_edge_of_a_plate(seed, slope, over):
    """On one side the plate falls off from x = 25 on, the more so the further; the ridge ends at x = 32."""
    places = plane(seed, (-40, 90), (-15, 15))
    x, y = places.T
    fall = slope * np.maximum(-y - 1, 0) * np.clip((x - 25) / over, 0, 1)
    found = rf.register(scanned(places, np.where(x < 32, ridge_over(y), 0.0) - fall, seed), at=(0.0, 0.0, H))
    low, high = np.sort(found.spine[[0, -1], 0])
    assert low < -39
    assert 22 < high < 32 + 2.0 * W
    assert found.height.max() < 1.5 * H  # up to this none is asked whether it is an edge


def test_only_what_is_much_higher_than_several_before_is_asked_whether_it_is_an_edge():
    usual = Template(np.zeros(3), np.eye(3), W, -H, 5.0, 2.0, cosine())
    assert risen(usual.changed(height=-1.6 * H), [usual] * 3)
    assert not risen(usual.changed(height=-1.4 * H), [usual] * 3)
    assert not risen(usual.changed(height=-1.6 * H), [usual] * 2)


def test_a_ring_that_falls_apart_is_none():
    """Two templates left of one: no neighbours on both sides to be refitted by."""
    places = plane(0, (-20, 20), (-20, 20))
    points = scanned(places, np.zeros(len(places)), 0)
    lost = Template(np.zeros(3), np.eye(3), W, H, 5.0, 2.0, cosine(), status="converged")
    chain = (lost, lost.changed(position=np.array([0.1, 0, 0])), lost.changed(position=np.array([0, 0.1, 0])))
    track = settle(window_on(points), Track(chain, ("closed", "closed"), closed=True), rf.Settings())
    assert not track.closed and track.stop == (FLAT, FLAT)


def test_unknown_deviations_are_infinite_beside_known_ones():
    known = Template(np.zeros(3), np.eye(3), W, H, 5.0, 2.0, cosine(), std=np.full(8, 0.1))
    chain = tuple(known.changed(position=np.array([5.0 * i, 0, 0])) for i in range(6))
    chain = (*chain[:3], chain[3].changed(std=None), *chain[4:])
    std = lay_out(chain, rf.Settings()).height_std
    assert not np.isnan(std).any()
    assert np.isinf(std).any()


@pytest.mark.skipif(not SCANS.is_dir(), reason="RIDGE_SCANS names no folder of scans")
@pytest.mark.parametrize(
    ("file", "suffix", "kind", "half_height_width", "asked"),
    [
        ("lmd_bead_kink", "", "ridge", 0.0065, 0.95),
        ("lmd_bead_kink", "_2", "ridge", 0.0060, 0.95),
        ("nefertiti_uraeus", "", "ridge", 7.3, 0.95),
        ("nefertiti_uraeus", "_2", "ridge", 6.7, 0.85),
        ("nefertiti_uraeus", "_3", "ridge", 7.3, 0.85),
        ("boot_sole_groove", "", "auto", 0.0064, 0.85),
        ("boot_sole_groove", "_2", "auto", 0.0064, 0.85),
        ("waam_weld_wall", "", "ridge", 5.0, 0.95),
    ],
)
def test_tracks_that_a_person_read_off_real_scans_are_covered(file, suffix, kind, half_height_width, asked):
    """From one click. The crest lies on the track that was read, over the share of it that is asked."""
    if not (SCANS / f"{file}.npz").is_file():
        pytest.skip(f"no {file} in RIDGE_SCANS")
    with np.load(SCANS / f"{file}.npz") as scan:
        points = scan["points_sampled"] if "points_sampled" in scan else scan["points"]
        seed, read = scan["seed" + suffix], scan["ref_path" + suffix]
    found = rf.register(points, at=seed, kind=kind)
    eta = np.linspace(-0.5, 0.5, 2001)
    # Some are deepest along both edges of their floor, by up to a twentieth: its middle is what was read.
    top = float(eta[found.section(eta) >= 0.9][[0, -1]].mean())
    crest = found.spine + (top * found.width)[:, None] * found.across + found.height[:, None] * found.normal
    fine = np.linspace(0, 1, 400)
    crest, read = (
        np.column_stack([np.interp(fine, np.linspace(0, 1, len(p)), p[:, i]) for i in range(3)])
        for p in (crest, read)
    )
    apart = np.linalg.norm(read[:, None] - crest[None], axis=2)
    nearest, apart = apart.argmin(axis=1), apart.min(axis=1)
    near = apart < half_height_width
    assert near.mean() >= asked
    if file == "lmd_bead_kink":  # which ends in a molten blob
        assert found.height.max() < 1.3 * np.median(found.height)
    beside = near & (nearest > 0) & (nearest < len(crest) - 1)  # not beyond its ends
    assert np.sqrt(np.mean(apart[beside] ** 2)) < 0.15 * half_height_width
