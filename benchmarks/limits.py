"""Where the registration stops being right: steep flanks, curved bases, sharp bends, missing flanks.

    python benchmarks/limits.py

A ridge of w = 10 and h = 3 on 60,000 points with noise 0.02, picked in the middle, nothing else given.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import ridgefeature as rf
from ridgefeature.section import bell

Array = NDArray[np.float64]
Place = Callable[[Array, Array, Array], Array]
WIDTH, HEIGHT, NOISE = 10.0, 3.0, 0.02


def flat(x: Array, y: Array, z: Array) -> Array:
    return np.column_stack([x, y, z])


def curved_across(radius: float) -> Place:
    """The outside of a cylinder along which the ridge runs."""

    def place(x: Array, y: Array, z: Array) -> Array:
        return np.column_stack(
            [x, (radius + z) * np.sin(y / radius), (radius + z) * np.cos(y / radius) - radius]
        )

    return place


def curved_along(radius: float) -> Place:
    """The outside of a cylinder around which the ridge runs."""

    def place(x: Array, y: Array, z: Array) -> Array:
        return np.column_stack(
            [(radius + z) * np.sin(x / radius), y, (radius + z) * np.cos(x / radius) - radius]
        )

    return place


def bent(radius: float) -> Place:
    """A plane on which the path is a circle."""

    def place(x: Array, y: Array, z: Array) -> Array:
        turn = x / radius
        return np.column_stack([(radius + y) * np.sin(turn), (radius + y) * np.cos(turn) - radius, z])

    return place


def scan(place: Place, height: float, length: float, breadth: float) -> Array:
    random = np.random.default_rng(0)
    x = random.uniform(-length / 2, length / 2, 60_000)
    y = random.uniform(-breadth / 2, breadth / 2, 60_000)
    points = place(x, y, height * bell()(y / WIDTH))
    return points + random.normal(0.0, NOISE, points.shape)


def show(name: str, points: Array, height: float, length: float) -> None:
    """One row: what was found of the length, and median errors over the ridge's middle half."""
    try:
        ridge = rf.register(points, at=(0.0, 0.0, height))
    except rf.NoRidgeError:
        print(f"| {name:<36} | no ridge found |")
        return
    middle = np.abs(ridge.arc_length - ridge.length / 2) <= ridge.length / 4
    h = 100 * (np.median(ridge.height[middle]) / height - 1)
    w = 100 * (np.median(ridge.half_height_width[middle]) / (bell().half_height_width * WIDTH) - 1)
    print(
        f"| {name:<36} | {100 * ridge.length / length:3.0f} | {h:+7.2f} | {w:+7.2f} | {ridge.section.name} |"
    )


def main() -> None:
    print("| case | length found [%] | error of h [%] | error of the width at half height [%] | section |")
    print("|---|---|---|---|---|")
    for rate in (0.2, 0.6, 1.0, 1.5, 2.0, 2.5, 3.0):
        eta = np.linspace(-0.5, 0.5, 1001)
        steepest = np.degrees(np.arctan(rate * bell()(eta, 1).max()))
        height = rate * WIDTH
        name = f"h = {rate:g} w, steepest {steepest:.0f} degrees"
        show(name, scan(flat, height, 80.0, 60.0), height, 80.0)
    for rate in (20.0, 10.0, 6.0, 4.0, 3.0, 2.0):
        radius = rate * WIDTH
        points = scan(curved_across(radius), HEIGHT, 80.0, min(60.0, 2 * radius))
        show(f"base curved across, radius {rate:g} w", points, HEIGHT, 80.0)
    for rate in (10.0, 4.0, 2.0):
        points = scan(curved_along(rate * WIDTH), HEIGHT, 60.0, 60.0)
        show(f"base curved along, radius {rate:g} w", points, HEIGHT, 60.0)
    for rate in (4.0, 2.0, 1.5, 1.0, 0.7):
        radius = rate * WIDTH
        length, breadth = min(80.0, 4 * radius), min(60.0, 1.9 * radius)
        show(f"path bent, radius {rate:g} w", scan(bent(radius), HEIGHT, length, breadth), HEIGHT, length)
    points = scan(flat, HEIGHT, 80.0, 60.0)
    show("one flank missing from y = 0.1 w on", points[points[:, 1] < 1.0], HEIGHT, 80.0)


if __name__ == "__main__":
    main()
