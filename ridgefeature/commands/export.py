"""`ridgefeature export`: a feature as a CAD file, at other heights and widths if asked."""

from __future__ import annotations

from pathlib import Path

import click

from ridgefeature.commands.feature_file import load_feature


def run(feature: Path, output: Path, h: float, w: float) -> None:
    """Write `feature` to `output`, whose suffix says how. Raises ValueError or OSError."""
    from cad_export.formats import checked_target, write

    checked_target(output)
    write(load_feature(feature), output, h=h, w=w)
    click.echo(f"wrote {output}")
