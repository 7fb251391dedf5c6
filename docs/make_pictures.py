"""The README's pictures: a ridge in real data by the product's own plots, and the parts of three examples.

    python docs/make_pictures.py

The elevation model ships with matplotlib. The pictures are made smaller for the repository.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from PIL import Image

import ridgefeature as rf
from ridgefeature import plot

FOLDER = Path(__file__).parent
sys.path.insert(0, str(FOLDER.parent / "examples"))
PICK = (20558, 740, 508)


def shrink(
    source: Path, target: Path, width: int, colours: int, method: Image.Quantize = Image.Quantize.FASTOCTREE
) -> None:
    """A copy of a picture that is `width` pixels wide, with few colours."""
    picture = Image.open(source).convert("RGB")
    size = width, round(picture.height * width / picture.width)
    small = picture.resize(size, Image.Resampling.LANCZOS).quantize(colours, method)
    small.save(target, optimize=True)
    print(target.name, target.stat().st_size // 1000, "kB")


def parts() -> None:
    """The parts of the examples of pasting."""
    import grip
    import panel_bead
    import spiral_on_cylinder
    from part_pictures import draw

    made = {
        "panel": (panel_bead.part.val(), (-0.3, -1.0, 0.75), (760, 380)),
        "grip": (grip.make()[1], (1.0, -0.45, 0.3), (360, 640)),
        "cylinder": (spiral_on_cylinder.make()[1], (-1.0, -0.15, 0.3), (520, 560)),
    }
    with tempfile.TemporaryDirectory() as name:
        for title, (part, toward, size) in made.items():
            file = Path(name) / f"{title}.png"
            draw(part, file, toward, size)
            shrink(file, FOLDER / f"{title}.png", size[0], 256, Image.Quantize.MEDIANCUT)


def mountains() -> None:
    from mountain_ridge import elevation_model

    scan = elevation_model()
    ridge = rf.register(scan, at=PICK)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plot.view(scan, ridge, folder / "view.png")
        plot.profile(ridge, folder / "profile.png", scan)
        plot.deviation(scan, ridge, folder / "deviation.png")
        shrink(folder / "view.png", FOLDER / "view.png", 1300, 256)
        shrink(folder / "profile.png", FOLDER / "profile.png", 1200, 128)
        shrink(folder / "deviation.png", FOLDER / "deviation.png", 1200, 128)


if __name__ == "__main__":
    parts()
    mountains()
