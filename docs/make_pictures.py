"""The README's pictures, from real data by the product's own plots.

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


def shrink(source: Path, target: Path, width: int, colours: int) -> None:
    """A copy of a picture that is `width` pixels wide, with few colours."""
    picture = Image.open(source).convert("RGB")
    size = width, round(picture.height * width / picture.width)
    small = picture.resize(size, Image.Resampling.LANCZOS).quantize(colours, Image.Quantize.FASTOCTREE)
    small.save(target, optimize=True)
    print(target.name, target.stat().st_size // 1000, "kB")


def main() -> None:
    from mountain_ridge import elevation_model

    scan = elevation_model()
    ridge = rf.register(scan, at=PICK)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plot.view(scan, ridge, folder / "view.png")
        plot.profile(ridge, folder / "profile.png", scan)
        shrink(folder / "view.png", FOLDER / "view.png", 1300, 256)
        shrink(folder / "profile.png", FOLDER / "profile.png", 1200, 128)


if __name__ == "__main__":
    main()
