"""Mountain ridges in a real elevation model, from one picked point each and nothing else.

The model ships with matplotlib (jacksboro_fault_dem.npz): the land around the Jacksboro fault in Tennessee.
python examples/mountain_ridge.py
"""

from __future__ import annotations

import numpy as np
from matplotlib.cbook import get_sample_data
from numpy.typing import NDArray

import ridgefeature as rf

# A column is 75 m times cos(36.6 degrees) of longitude east, a row 92.5 m south.
COLUMN, ROW = 74.5, 92.5


def elevation_model() -> rf.Scan:
    """The model as 138,632 points: x east, y north, z up, in metres."""
    with get_sample_data("jacksboro_fault_dem.npz") as file:
        z = file["elevation"].astype(np.float64)
    row, column = np.indices(z.shape)
    y = ROW * (len(z) - 1 - row)
    return rf.Scan(np.column_stack([COLUMN * column.ravel(), y.ravel(), z.ravel()]), unit="m")


def named_stretch(
    ridge: rf.Ridge, pick: NDArray[np.float64], direction: NDArray[np.float64], length: float
) -> NDArray[np.bool_]:
    """The stations from the pick on, over the named length in the named direction."""
    nearest = int(np.argmin(np.linalg.norm(ridge.spine - pick, axis=1)))
    onward = np.sign(ridge.tangent[nearest] @ direction)
    beyond = onward * (ridge.arc_length - ridge.arc_length[nearest])
    return (beyond >= 0) & (beyond <= length)


def main() -> None:
    scan = elevation_model()
    print("ridge          templates  whole  asked  covered [km]   height  read by eye [m]")
    # Lengths from the pick and heights as a person read them off the model. Covered is the advance along
    # the named direction. Pine Mountain is asked up to the river gap at 10 km.
    for name, at, along, length, asked, heights in (
        ("small, south", (20558, 740, 508), (0.56, 0.83, 0), 4900.0, 0.9 * 4900.0, (180.0,)),
        ("small, north", (22122, 6935, 415), (-0.61, 0.80, 0), 5000.0, 0.9 * 5000.0, (159.0,)),
        ("Pine Mountain", (17429, 19603, 518), (0.80, 0.61, 0), 14700.0, 10000.0, (170.0, 240.0)),
    ):
        pick, direction = np.array(at, np.float64), np.array(along)
        ridge = rf.register(scan, at=pick)
        there = named_stretch(ridge, pick, direction, length)
        covered = float(np.max((ridge.spine[there] - pick) @ direction))
        height = float(np.median(ridge.height[there]))
        print(
            f"{name:<13} {len(ridge.templates):>10} {ridge.length / 1e3:>6.1f} {asked / 1e3:>6.2f}"
            f" {covered / 1e3:>8.2f} {height:>13.0f}  {' to '.join(f'{x:g}' for x in heights)}"
        )
        assert covered >= asked, covered
        assert 0.8 * min(heights) <= height <= 1.2 * max(heights), height


if __name__ == "__main__":
    main()
