"""A real laser-deposited metal bead, registered in its scan and pasted at three heights on a new plate.

python examples/laser_bead.py [FOLDER]
The plate is written to FOLDER. The environment variable RIDGE_SCANS names a folder with lmd_bead_kink.npz:
`points` (n, 3) in metres and `seed`, a point on the left bead. The scan is downsampled.xyz of
github.com/openlmd/proper.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import cadquery as cq
import numpy as np

import cad_export as cx
import ridgefeature as rf

HEIGHTS = (0.5, 1.0, 1.5)


def main(scan: Path, folder: Path) -> None:
    with np.load(scan) as data:
        points, seed = data["points"], data["seed"]
    ridge = rf.register(rf.Scan(points, unit="m"), at=seed)
    millimetres = 1000.0 * np.array(
        [ridge.length, np.median(ridge.height), np.median(ridge.half_height_width)]
    )
    print("bead {:.1f} mm long, {:.2f} high, {:.2f} wide at half height".format(*millimetres))
    # as read off the cloud by eye: 69.3, 6.7, 6.5
    assert np.allclose(millimetres, (69.3, 6.7, 6.5), rtol=0.25), millimetres

    part = cq.Workplane().box(110, 110, 8).val()
    added = []
    for y, h in zip((-34, 0, 34), HEIGHTS, strict=True):
        before = part.Volume(1e-6)
        part = cx.paste(ridge, part, at=(0, y, 4), direction=(1, 0, 0), h=h)
        added.append(part.Volume(1e-6) - before)
        print(f"h = {h:g}: {added[-1]:.1f} mm3 added")
    assert part.isValid() and len(cx.carried_by(part)) == 3
    assert np.allclose(np.divide(added, added[1]), HEIGHTS, rtol=1e-3), added

    file = cx.step(part, folder / "plate.step")
    print(f"{file.name}: {file.stat().st_size / 1000:.0f} kB, carries {len(cx.load(file))} ridges")
    assert tuple(carried.h for carried in cx.carried_in(file)) == HEIGHTS


if __name__ == "__main__":
    scan = Path(os.environ.get("RIDGE_SCANS", ".")) / "lmd_bead_kink.npz"
    if not scan.is_file():
        print("skipped: set RIDGE_SCANS to the folder that holds lmd_bead_kink.npz")
    elif len(sys.argv) > 1:
        main(scan, Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as name:
            main(scan, Path(name))
