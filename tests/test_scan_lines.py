"""Scanners whose lines have an error each: along a ridge they make its height and width less sure."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from made_ridges import made_ridge

import ridgefeature as rf
from ridgefeature.kernels.pair_products import pair_products
from ridgefeature.path_frame import PathFrame, path_frame
from ridgefeature.scan_lines import scan_lines
from ridgefeature.section import bell

HEIGHT, WIDTH, NOISE, LINES = 1.0, 4.0, 0.06, 0.25


def scan(seed: int, in_common: float, along: bool = True) -> np.ndarray:
    """A straight ridge along x whose lines, along or across it, have a part of the noise in common."""
    random = np.random.default_rng(seed)
    x, y = random.uniform(-25, 25, 16_000), random.uniform(-6, 6, 16_000)
    line = np.floor((y if along else x) / LINES).astype(int)
    line -= line.min()
    own = NOISE * np.sqrt(1 - in_common**2) * random.normal(size=(x.size, 3))
    z = HEIGHT * bell()(y / WIDTH) + in_common * NOISE * random.normal(size=line.max() + 1)[line]
    return np.column_stack([x, y, z]) + own


def registered(points: np.ndarray) -> rf.Ridge:
    at = points[np.argmin(np.linalg.norm(points - (0, 0, HEIGHT), axis=1))]
    return rf.register(points, at=at)


def usual_std(in_common: float, along: bool) -> float:
    """Of the height."""
    ridges = [registered(scan(seed, in_common, along)) for seed in range(3)]
    return float(np.mean([np.median(ridge.height_std) for ridge in ridges]))


def winding() -> PathFrame:
    """The path of a ridge in the plane that turns by 90 degrees and back, from the origin along x."""
    return path_frame(made_ridge(length=120.0, k=121, bend=0.04, height=1.0), closed=False)


def errors_in_lines(path: PathFrame, heading: float, share: float, seed: int = 0) -> tuple:
    """Points (m, 3) in path coordinates, their errors (m,) a share of their variance in common by lines."""
    random, nodes = np.random.default_rng(seed), np.arange(len(path.at))
    at, aside = random.uniform(0, nodes[-1], 6000), random.uniform(-4.5, 4.5, 6000)
    origin, left = (
        np.column_stack([np.interp(at, nodes, x[:, k]) for k in (0, 1)]) for x in (path.origin, path.left)
    )
    x, y = (origin + aside[:, None] * left).T
    line = np.floor((y * np.cos(heading) - x * np.sin(heading)) / 0.4).astype(int)
    shared = random.normal(size=np.ptp(line) + 1)[line - line.min()]
    errors = np.sqrt(share) * shared + np.sqrt(1 - share) * random.normal(size=6000)
    return np.column_stack([at, aside, 0 * at]), errors


@pytest.mark.parametrize("heading", [0.1, 0.8, 1.7, 2.6])
def test_lines_are_found_in_all_directions_wherever_the_ridge_goes(heading: float) -> None:
    path = winding()
    found = scan_lines(*with_path(path, heading, 0.3))
    assert found is not None
    assert abs((found.heading - heading + np.pi / 2) % np.pi - np.pi / 2) < 0.06
    assert 0.3 < found.share < 0.9  # of a fit to such points less is seen


def with_path(path: PathFrame, heading: float, share: float, seed: int = 0) -> tuple:
    points, errors = errors_in_lines(path, heading, share, seed)
    return points, path, errors


def test_there_are_no_lines_in_independent_errors_whatever_their_unit() -> None:
    path = winding()
    for seed in range(20):
        points, _, errors = with_path(path, 0.0, 0.0, seed)
        assert scan_lines(points, path, errors) is None
        assert scan_lines(points, path, 1e6 * errors) is None
    assert scan_lines(points, path, 0.0 * errors) is None
    assert scan_lines(points[:100], path, errors[:100]) is None
    assert scan_lines(points[:0], path, errors[:0]) is None


def test_lines_along_a_ridge_tell_least_and_those_across_it_most() -> None:
    path = winding()
    found = scan_lines(*with_path(path, 0.0, 0.3))
    assert found is not None
    inflation = found.inflation
    assert inflation.shape == (len(path.at) - 1,) and (inflation >= 1).all()
    turned = np.abs(path.tangent[1:, 1])
    assert inflation[turned < 0.1].min() > 3 * inflation[turned > 0.8].max()


def test_products_are_those_of_all_pairs_in_a_part_of_a_line() -> None:
    random = np.random.default_rng(3)
    places, errors = random.uniform(0.0, 3.0, (40, 2)), random.normal(size=40)
    angles = np.array([0.0, 0.5, 2.0])
    products, pairs = pair_products(places, errors, angles, 1.0, 2.0)
    for k, angle in enumerate(angles):
        turned = places @ np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        parts = np.floor(turned / (2.0, 1.0)).astype(int)
        alike = [(i, j) for i, j in permutations(range(40), 2) if (parts[i] == parts[j]).all()]
        assert pairs[k] == len(alike)
        assert products[k] == pytest.approx(sum(errors[i] * errors[j] for i, j in alike))


def test_bands_are_wider_than_those_of_independent_noise() -> None:
    along = usual_std(0.6, along=True)
    assert along > 1.4 * usual_std(0.0, along=True)
    assert along > 1.2 * usual_std(0.6, along=False)
