"""Register a ridge, make a stretch of it taller and slimmer, write it as STEP, and read it back.

python examples/resize_and_export.py [FOLDER]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import cad_export
import ridgefeature as rf
from ridgefeature.synthetic import Spiral


def main(folder: Path) -> None:
    spiral = Spiral()
    ridge = rf.register(spiral.points(40_000, noise=0.1), at=(28.9, 7.9, 5.8))
    stretch = (60.0, 110.0)
    changed = ridge.resized(h=1.5, w=0.8, between=stretch)

    s = ridge.arc_length
    middle, outside = np.abs(s - np.mean(stretch)) < 5, (s < stretch[0]) | (s > stretch[1])
    rate = changed.height / ridge.height
    print(f"height rate: {rate[middle].mean():.3f} amid the stretch, {rate[outside].mean():.3f} elsewhere")
    assert np.allclose(rate[middle], 1.5)
    assert np.allclose(changed.width[middle] / ridge.width[middle], 0.8)
    assert np.array_equal(changed.height[outside], ridge.height[outside])

    path = cad_export.step(changed, folder / "changed.step")
    written, read = changed.surface(), cad_export.surface_of(cad_export.read_step(path))
    error = float(np.abs(read.poles - written.poles).max())
    size = path.stat().st_size / 1000
    print(f"{path.name}: {size:.0f} kB, {read.poles.shape[:2]} poles, largest error {error:.1e} mm")
    assert error < 1e-9, error
    assert (read.degree_u, read.degree_v) == (3, 3)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as name:
            main(Path(name))
