"""The paper's first experiment: a ridge along a circle, its height and width falling on the way.

python examples/spiral.py
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import ridgefeature as rf
from ridgefeature.synthetic import Spiral


def rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def main() -> None:
    spiral = Spiral()
    scan = spiral.points(40_000)
    near_start = np.array(8.0)
    pick = (*spiral.spine(near_start)[:2], spiral.height(near_start))

    ridge = rf.register(scan, at=pick)

    # The truth at the arc length of each station's foot on the true path.
    s, aside = spiral.path_coordinates(ridge.spine[:, :2])
    on = (s >= 0) & (s <= spiral.arc_length)
    true_half = spiral.section.half_height_width * spiral.width(s)  # full width at half height
    height = rms((ridge.height / spiral.height(s) - 1)[on])
    width = rms((ridge.half_height_width / true_half - 1)[on])
    spine = rms((np.hypot(aside, ridge.spine[:, 2]) / spiral.width(s))[on])

    print(f"{len(ridge.templates)} templates, {ridge.length:.2f} of {spiral.arc_length:.2f} mm")
    print(f"height: rms error {100 * height:.3f} %")
    print(f"width at half height: rms error {100 * width:.3f} %")
    print(f"spine: rms error {100 * spine:.3f} % of the width")
    assert height <= 0.005, height
    assert width <= 0.005, width
    assert spine <= 0.005, spine
    assert abs(ridge.length - spiral.arc_length) <= 0.01 * spiral.arc_length, ridge.length


if __name__ == "__main__":
    main()
