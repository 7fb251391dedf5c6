"""The paper's spiral from its scan, developed on a cylinder: its bends and lengths stay as they were.

python examples/spiral_on_cylinder.py [FOLDER]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import cadquery as cq
import numpy as np

import cad_export as cx
import ridgefeature as rf
from ridgefeature.synthetic import Spiral

RADIUS = 45.0
SCALE = 0.7


def make() -> tuple[cq.Solid, cq.Solid, rf.Ridge]:
    """The cylinder without and with the ridge, and the ridge."""
    ridge = rf.register(Spiral().points(20_000, noise=0.05), at=(28.9, 7.9, 5.8))
    cylinder = cq.Workplane().cylinder(80, RADIUS)
    part = cx.paste(ridge, cylinder, at=(-RADIUS, 0, -20), scale=SCALE)
    return cylinder.val(), part, ridge


def main(folder: Path) -> None:
    cylinder, part, ridge = make()
    [(face, _)] = cx.carried_by(part)
    surface = cx.surface_of(cq.Face(face))
    crest = surface(np.linspace(*surface.domain[0], 1000), 0.0)
    out = np.hypot(crest[:, 0], crest[:, 1]) - RADIUS
    height = SCALE * np.interp(np.linspace(0, ridge.length, 1000), ridge.arc_length, ridge.height)
    error = float(np.abs(out - height).max())
    added = part.Volume(1e-6) - cylinder.Volume(1e-6)
    print(f"crest {out.max():.3f} to {out.min():.3f} mm off the cylinder, error {error:.4f} mm")
    print(f"{added:.1f} mm3 added")
    assert error < 0.02, error
    assert part.isValid() and added > 0

    file = cx.step(part, folder / "spiral.step")
    volume = cq.Shape.cast(cx.read_step(file)).Volume(1e-6)
    assert abs(volume / part.Volume(1e-6) - 1) < 1e-6, volume


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as name:
            main(Path(name))
