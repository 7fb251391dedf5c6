"""Grid index against scipy's cKDTree: build and nearest-point queries, in one run.

    python benchmarks/bench_grid.py [--large]

Times are the best of a few runs. Read the ratios: they depend less on the machine and on its other work.
"""

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ridgefeature.grid import Floats, build_grid, nearest_distances, points_in_box

QUERIES = 50_000


def surface(n: int, rng: np.random.Generator) -> Floats:
    """Points on a smooth surface of 100 x 100."""
    x, y = rng.uniform(0, 100, (2, n))
    return np.column_stack((x, y, np.sin(x / 7) + 2 * np.cos(y / 9) + 0.02 * rng.standard_normal(n)))


def sphere(n: int, rng: np.random.Generator) -> Floats:
    p = rng.standard_normal((n, 3))
    return np.asarray(50 * p / np.linalg.norm(p, axis=1)[:, None])


def strays(n: int, rng: np.random.Generator) -> Floats:
    """The surface, a tenth of its points anywhere in a box."""
    p = surface(n, rng)
    p[: n // 10] = rng.uniform(0, 100, (n // 10, 3))
    return p


def far_stray(n: int, rng: np.random.Generator) -> Floats:
    """The surface, one point a million times farther away."""
    p = surface(n, rng)
    p[0] = 1e8
    return p


def best(run: Callable[[], Any], times: int) -> tuple[Any, float]:
    """What it returns, and its shortest time in seconds."""
    shortest = np.inf
    for _ in range(times):
        start = time.perf_counter()
        result = run()
        shortest = min(shortest, time.perf_counter() - start)
    return result, shortest


def measure(make: Callable[[int, np.random.Generator], Floats], n: int) -> None:
    rng = np.random.default_rng(0)
    points = make(n, rng)
    times = 7 if n < 10**6 else 3
    grid, build = best(lambda: build_grid(points), times)
    tree, build_tree = best(lambda: cKDTree(points), 3 if n < 10**6 else 1)
    print(f"{make.__name__:>10} {n:>9}  build {build * 1e3:8.1f} ms {build_tree / build:5.1f} x", end="")
    queries = points[rng.integers(0, n, QUERIES)] + rng.normal(0, 0.1, (QUERIES, 3))
    for k in (1, 8):
        found, ours = best(lambda k=k: nearest_distances(grid, queries, k), 3)
        (expected, _), theirs = best(lambda k=k: tree.query(queries, k), 3)
        if not np.allclose(found, np.reshape(expected, found.shape), rtol=1e-12):
            raise SystemExit("the grid and the tree disagree")
        print(f"   k={k} {ours / QUERIES * 1e6:5.2f} us {theirs / ours:5.1f} x", end="")
    box = (points[n // 2], np.eye(3), (3.0, 3.0, 3.0))
    window, whole = best(lambda: points_in_box(grid, *box), 5)
    _, thinned = best(lambda: points_in_box(grid, *box, cells=(50, 50)), 5)
    print(f"   box of {len(window)}: {whole * 1e6:.0f} us, thinned {thinned * 1e6:.0f} us")


def main() -> None:
    print("x: how many times faster than cKDTree")
    nearest_distances(build_grid(np.eye(3)), np.eye(3))  # compile, or load what was compiled
    points_in_box(build_grid(np.eye(3)), np.zeros(3), np.eye(3), np.ones(3))
    points_in_box(build_grid(np.eye(3)), np.zeros(3), np.eye(3), np.ones(3), cells=(2, 2))
    for n in (100_000, 1_000_000, 10_000_000) if "--large" in sys.argv else (100_000, 1_000_000):
        for make in (surface, sphere, strays, far_stray):
            measure(make, n)


if __name__ == "__main__":
    main()
