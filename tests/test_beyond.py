"""A whole fit beyond the known ends of a ridge: as high as it was there, and where flanks hold few points."""

from __future__ import annotations

import numpy as np
import pytest

import ridgefeature as rf
from ridgefeature.beyond import continued
from ridgefeature.grid import build_grid
from ridgefeature.kernels.strip import TERMS, H, W
from ridgefeature.noise import Noise
from ridgefeature.path_frame import NODES_A_WIDTH, PathFrame, path_frame
from ridgefeature.refit import refitted
from ridgefeature.section import box
from ridgefeature.stations import Stations

HEIGHT, WIDTH, LENGTH = 18.0, 8.0, 40.0
NOISE = Noise(0.1, 0.01, 0.001, 4 * HEIGHT, 0.0, 0.1)


def along_x(length: float, heights: tuple[float, float] = (HEIGHT, HEIGHT)) -> Stations:
    s, ones = np.linspace(0.0, length, 31), np.ones(31)
    x, _, z = np.eye(3)
    height = np.linspace(*heights, 31)
    spine, frames = s[:, None] * x, (np.tile(x, (31, 1)), np.tile(z, (31, 1)))
    return Stations(s, spine, *frames, height, WIDTH * ones, ones, ones, ones)


def begun(path: PathFrame) -> np.ndarray:
    out = np.zeros((len(path.at), TERMS))
    out[:, H], out[:, W] = path.height, path.width
    return out


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("true", "expected"), [(0.0, 0.0), (0.5, 0.5), (3.0, 1.0)])
def test_a_fit_begins_as_high_as_before_as_far_as_points_say_so(true, expected, sign):
    """The ridge goes on by `true` widths at its end, but not at its start; a width further is looked at."""
    path = path_frame(along_x(LENGTH, (sign * HEIGHT, sign * HEIGHT)), False, (3 * WIDTH, 3 * WIDTH))
    random = np.random.default_rng(0)
    n = 40 * len(path.at)
    s, y = random.uniform(0, len(path.at) - 1, n), random.uniform(-WIDTH, WIDTH, n)
    at = np.interp(s, np.arange(len(path.at)), path.at)
    on = (at > 0) & (at < LENGTH + true * WIDTH)
    z = np.where(on, sign * HEIGHT * box()(y / WIDTH), 0.0) + random.normal(0, 0.1, n)
    found = continued(np.column_stack([s, y, z]), path, begun(path), box(), NOISE)
    beyond = path.at > LENGTH + 1e-9
    nodes = np.count_nonzero(found[beyond, H])
    assert nodes == pytest.approx(expected * NODES_A_WIDTH, abs=1.5)
    assert found[beyond, H][:nodes] == pytest.approx(sign * HEIGHT)
    assert not found[path.at < -1e-9, H].any()
    assert (found[~beyond] == begun(path)[~beyond]).all()


def test_a_steep_ridge_that_fades_is_followed_to_where_it_is_low():
    """Points lie evenly over the surface: there are far fewer of them where flanks get low."""
    random = np.random.default_rng(1)
    eta = np.linspace(-2.5, 2.5, 20001)
    xs = np.linspace(-20.0, 80.0, 401)
    heights = np.where(xs < 0, 0.0, HEIGHT * np.clip((64.0 - xs) / 32.0, 0.0, 1.0) ** 2)
    girths = [np.hypot(WIDTH * np.diff(eta), h * np.diff(box()(eta))).sum() for h in heights]
    n = 20000
    x = np.interp(random.uniform(0, 1, n), np.cumsum(girths) / sum(girths), xs)
    h = np.interp(x, xs, heights)
    flank = np.hypot(WIDTH, h[:, None] * box()(eta[::200], 1)[None, :])
    place = [
        np.interp(u, np.cumsum(f) / f.sum(), eta[::200]) for u, f in zip(random.random(n), flank, strict=True)
    ]
    y = np.array(place)
    points = np.column_stack([x, WIDTH * y, h * box()(y)]) + random.normal(0, 0.1, (n, 3))
    known = along_x(46.0, (HEIGHT, 5.0))
    found = refitted(build_grid(points), known, box(), False, (True, True), rf.Settings())
    assert found.joint is not None
    assert 56.0 < found.stations.spine[:, 0].max() < 66.0
