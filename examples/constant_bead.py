"""Dense, accurate points of a bead of constant section: height and width come out constant.

The paper's second experiment, with a made-up part: an S-shaped bead, 3 mm high and 10 mm wide.
python examples/constant_bead.py
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from winding import Winding

import ridgefeature as rf

HEIGHT, WIDTH = 3.0, 10.0


def spread(
    name: str, values: NDArray[np.float64], std: NDArray[np.float64], truth: float
) -> tuple[float, float]:
    """Print and return the relative spread and the chi-square a station about the truth."""
    mean = np.average(values, weights=std**-2.0)
    relative = float(np.std(values) / mean)
    chi_square = float(np.mean(((values - truth) / std) ** 2))
    print(
        f"{name} {mean:.4f} mm, spread {100 * relative:.3f} %, "
        f"one sigma {100 * np.median(std) / mean:.3f} %, chi-square a station {chi_square:.2f}"
    )
    return relative, chi_square


def main() -> None:
    x = np.linspace(-65.0, 65.0, 2001)
    s_shape = np.column_stack([x, 10.0 * np.sin(1.5 * np.pi * x / 60.0)])
    bead = Winding(s_shape, lambda s: HEIGHT + 0 * s, lambda s: WIDTH + 0 * s)
    scan = bead.points(n=200_000, region=120.0, noise=0.02)

    ridge = rf.register(scan, at=(0.0, 0.0, HEIGHT))

    inside = np.abs(x) <= 60.0  # the bead runs out of the data at both ends
    length = float(np.ptp(bead.arc_length[inside]))
    print(f"{len(ridge.templates)} templates, {ridge.length:.1f} of {length:.1f} mm")
    for name, values, std, truth in (
        ("height", ridge.height, ridge.height_std, HEIGHT),
        ("width ", ridge.width, ridge.width_std, WIDTH),
    ):
        relative, chi_square = spread(name, values, std, truth)
        assert relative <= 0.003, relative
        # One value as good as the band of all: found constant, they are all off alike.
        assert chi_square <= 4.0, chi_square
        assert abs(np.mean(values) / truth - 1) <= 0.003, np.mean(values)
    assert abs(ridge.length / length - 1) <= 0.03, ridge.length


if __name__ == "__main__":
    main()
