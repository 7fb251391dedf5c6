"""A scanned ridge pasted along a new path on the side of a freeform grip, written as STEP and read back.

python examples/grip.py [FOLDER]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import cadquery as cq
import numpy as np
from winding import Winding

import cad_export as cx
import ridgefeature as rf


def finger_ridge() -> rf.Ridge:
    """Registered in a noisy scan of a wavy ridge whose height rises and falls."""
    x = np.linspace(-40.0, 40.0, 1001)
    wave = np.column_stack([x, 3.0 * np.sin(x / 9.0)])
    truth = Winding(wave, lambda s: 2.0 + 0.6 * np.sin(s / 4.0), lambda s: 7.0 + 0 * s)
    return rf.register(truth.points(n=20_000, region=70.0, noise=0.02), at=(0.0, 0.0, 2.0))


def grip() -> cq.Workplane:
    """A lofted handle. Its side is one spline face, round the axis from a seam at y > 0."""
    body = cq.Workplane().ellipse(13, 18)
    for x, y, rise in ((15, 20, 35), (12, 16, 35), (14, 19, 30)):
        body = body.workplane(offset=rise).ellipse(x, y)
    return body.loft()


def new_path(side: cq.Face) -> cq.Edge:
    """A wave up the side of x > 0, by the face's own parameters: u around, v up."""
    v = np.linspace(0.16, 0.84, 15)
    u = 0.75 + 0.05 * np.sin(3.0 * np.pi * (v - v[0]) / (v[-1] - v[0]))
    return cq.Edge.makeSpline([side.positionAt(*at) for at in zip(u, v, strict=True)])


def make() -> tuple[cq.Solid, cq.Solid, rf.Ridge, dict[str, Any]]:
    """The grip without and with the ridge, the ridge, and the report of pasting it."""
    body, ridge, report = grip(), finger_ridge(), {}
    side = body.faces("not %PLANE").val()
    part = cx.paste(ridge, body, face=side, path=new_path(side), report=report)
    return body.val(), part, ridge, report


def main(folder: Path) -> None:
    body, part, ridge, report = make()
    added = part.Volume(1e-6) - body.Volume(1e-6)
    print(f"ridge of {ridge.length:.1f} mm on a grip of {body.Volume() / 1000:.1f} cm3: {report['method']}")
    print(f"{added:.2f} mm3 added, {report['volume_expected']:.2f} by the ridge's own integral")
    assert added > 0 and abs(added / report["volume_expected"] - 1) < 1e-3, (added, report)
    assert part.isValid()

    file = cx.step(part, folder / "grip.step")
    read, again = cq.importers.importStep(str(file)).val(), cx.load(file)
    print(f"{file.name}: {file.stat().st_size / 1000:.0f} kB, carries a ridge of {again.length:.1f} mm")
    assert read.isValid() and abs(read.Volume(1e-6) / part.Volume(1e-6) - 1) < 1e-6
    assert np.array_equal(again.height, ridge.height)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as name:
            main(Path(name))
