"""A bead along an edge path on a panel, and the same part regenerated from its STEP file at twice the height.

python examples/panel_bead.py [FOLDER]
In CQ-editor or any other CQGI host, h and w are parameters of the script.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import cadquery as cq
import numpy as np

import cad_export as cx
import ridgefeature as rf
from ridgefeature.section import bell

h = 1.0
w = 1.0


def scanned_bead() -> rf.Ridge:
    """Registered in a noisy scan of a straight bead."""
    random = np.random.default_rng(0)
    x, y = random.uniform(-35.0, 35.0, (2, 20_000))
    points = np.column_stack([x, y, 2.0 * bell()(y / 9.0)]) + random.normal(0.0, 0.02, (20_000, 3))
    return rf.register(points, at=(0.0, 0.0, 2.0))


ridge = scanned_bead()
panel = cq.Workplane().box(160, 100, 1.5).edges("|Z").fillet(12)
points = ((-62, -30), (-30, -26), (0, 5), (30, 26), (62, 22))
path = cq.Edge.makeSpline([cq.Vector(x, y, 0.75) for x, y in points])
part = panel.newObject([path]).pasteRidge(ridge, h=h, w=w, tag="bead")


def volume_added(solid: cq.Shape) -> float:
    return solid.Volume(1e-6) - panel.val().Volume(1e-6)


def main(folder: Path) -> None:
    file = cx.step(part.val(), folder / "panel.step")
    taller = cx.regenerate(file, h=2.0 * h)
    once, twice = volume_added(part.val()), volume_added(taller)
    print(f"bead of {path.Length():.1f} mm: {once:.2f} mm3 at h = {h:g}, {twice:.2f} mm3 at {2 * h:g}")
    assert part.faces(tag="bead").size() == 1
    assert once > 0 and abs(twice / once - 2) < 1e-3, (once, twice)
    assert taller.isValid() and cx.carried_by(taller)[0][1].h == 2.0 * h


if "show_object" in globals():
    globals()["show_object"](part)
elif __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as name:
            main(Path(name))
