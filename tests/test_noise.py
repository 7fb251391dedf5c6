"""Noise that points have in common: how much less their sums tell."""

import numpy as np
import pytest

from ridgefeature.kernels.strip import TERMS, H, W
from ridgefeature.noise import inflation_along
from ridgefeature.path_frame import NODES_A_WIDTH

NODES, POINTS, SHARE, LINES = 201, 12_000, 0.3, 0.05
FREEDOM = TERMS * (NODES // NODES_A_WIDTH)
"""SHARE: of the variance that a scan line has in common; LINES: their distance in widths."""


def terms() -> np.ndarray:
    out = np.zeros((NODES, TERMS))
    out[:, [H, W]] = 0.4, 1.0
    return out


def points(lines: str, seed: int) -> np.ndarray:
    """Points whose z is noise, less what six functions across fit in each width."""
    rng = np.random.default_rng(seed)
    s, y = rng.uniform(0, NODES - 1, POINTS), rng.uniform(-0.8, 0.8, POINTS)
    z = rng.normal(0.0, 1.0, POINTS)
    across = {"along": y, "across": s / NODES_A_WIDTH}.get(lines)
    if across is not None:
        line = np.floor((across - across.min()) / LINES).astype(int)
        shared = rng.normal(0.0, 1.0, line.max() + 1)[line]
        z = np.sqrt(1 - SHARE) * z + np.sqrt(SHARE) * shared
    for k in range(NODES // NODES_A_WIDTH):
        here = (s / NODES_A_WIDTH).astype(int) == k
        z[here] -= np.polyval(np.polyfit(y[here], z[here], TERMS - 1), y[here])
    return np.column_stack([s, y, z])


def inflation(scan: np.ndarray, shares: float = 1.0) -> np.ndarray:
    return inflation_along(scan, terms(), scan[:, 2], np.full(len(scan), shares), 1.0, FREEDOM)


@pytest.mark.parametrize("seed", range(3))
def test_independent_noise_is_left_as_it_is(seed):
    assert (inflation(points("none", seed)) == 1.0).all()


def test_scan_lines_along_a_ridge_tell_as_little_as_there_are_lines():
    in_common = POINTS / (NODES / NODES_A_WIDTH) / (1.6 / LINES)  # points of one line a width long
    found = [inflation(points("along", seed)) for seed in range(12)]
    assert all(x.shape == (NODES - 1,) and x.min() > 1.5 for x in found)
    # A ridge has 32 lines, so each tells the inflation to some 40 %.
    assert np.mean([np.median(x) for x in found]) == pytest.approx(1 + SHARE * (in_common - 1), rel=0.25)


def test_lines_along_a_part_of_a_ridge_inflate_that_part():
    along, free = points("along", 5), points("none", 5)
    half = 0.5 * NODES
    both = np.concatenate([along[along[:, 0] < half], free[free[:, 0] >= half]])
    found = inflation(both)
    assert np.median(found[:80]) > 3 * np.median(found[120:])


def test_strays_and_units_do_not_count():
    scan = points("along", 7)
    found = inflation(scan)
    assert np.allclose(inflation(scan, 0.3), found)
    stray = np.array([[100.0, 0.3, 50.0]])
    with_stray = np.concatenate([scan, stray])
    shares = np.append(np.ones(len(scan)), 0.0)
    assert np.allclose(
        inflation_along(with_stray, terms(), with_stray[:, 2], shares, 1.0, FREEDOM), found, rtol=0.02
    )
    longer = terms()
    longer[:, [H, W]] *= 1000
    big = scan * (1.0, 1000.0, 1000.0)
    assert np.allclose(inflation_along(big, longer, big[:, 2], np.ones(len(big)), 1000.0, FREEDOM), found)
