"""A poor scan of a ridge made by hand: about 1 mm between points, 0.15 mm noise, a wandering path.

The paper's third experiment, with a made-up part whose answer is known.
python examples/clay.py
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from winding import Winding

import ridgefeature as rf

Array = NDArray[np.float64]
NOISE = 0.15


def height(s: Array) -> Array:
    return 3.0 + 0.8 * np.sin(s / 20.0)


def width(s: Array) -> Array:
    return 9.0 + 1.2 * np.cos(s / 25.0)


def main() -> None:
    x = np.linspace(-40.0, 40.0, 2001)
    path = np.column_stack([x, 14.0 * np.sin(x / 14.0)])  # no bend sharper than a radius of 14 mm
    clay = Winding(path, height, width)
    scan = clay.points(n=10_000, region=100.0, noise=NOISE)

    ridge = rf.register(scan, at=(*path[600], height(clay.arc_length[600])))

    s, _ = clay.locate(ridge.spine[:, :2])
    covered = float((s.max() - s.min()) / clay.arc_length[-1])
    print(f"{len(ridge.templates)} templates over {100 * covered:.1f} % of {clay.arc_length[-1]:.1f} mm")
    assert covered >= 0.95, covered
    on = (s > 0) & (s < clay.arc_length[-1])  # beyond lie the round ends, which have no height of their own
    for name, values, std, truth in (
        ("height", ridge.height, ridge.height_std, height(s)),
        ("width", ridge.width, ridge.width_std, width(s)),
    ):
        error = (values - truth)[on]
        within = float(np.mean(np.abs(error) <= 3 * std[on]))
        print(f"{name}: rms error {np.sqrt(np.mean(error**2)):.3f} mm, {100 * within:.0f} % within 3 sigma")
        assert within >= 0.9, within


if __name__ == "__main__":
    main()
