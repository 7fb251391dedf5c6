"""`ridgefeature demo`: the paper's first experiment, from points to STEP, with the errors it made."""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

from ridgefeature import Ridge, read_scan, register
from ridgefeature.commands import interrupts, output
from ridgefeature.commands.console import INTERRUPTED, fail, print_table
from ridgefeature.commands.folder import beside, output_folder
from ridgefeature.commands.progress import shown_progress
from ridgefeature.diagnosis import diagnose
from ridgefeature.readable import number
from ridgefeature.synthetic import Spiral

SCAN, TALLER = "spiral.npy", "ridge_h1.5.step"
_POINTS, _NOISE, _SEED = 40_000, 0.1, 7
_PICK = 8.0  # arc length from the start


def run(folder: Path) -> int:
    """Write the demo's files to `folder` and say what they are; returns the exit status. Raises OSError."""
    spiral = Spiral()
    with output_folder(folder, [SCAN, TALLER, *output.file_names(True, True)]):
        with beside(folder / SCAN) as name:
            np.save(name, spiral.points(_POINTS, _NOISE, seed=_SEED))
        interrupts.wrote(SCAN)
        scan = read_scan(folder / SCAN)
        at = np.array(_PICK)
        pick = spiral.spine(at) + spiral.height(at) * np.array([0.0, 0.0, 1.0])
        click.echo(
            f"A made-up scan: {_POINTS:,} unordered points of a spiral ridge, with {_NOISE:g} mm noise."
        )
        click.echo(
            f"Registering it from one picked point, {number(pick[0])} {number(pick[1])} {number(pick[2])} ..."
        )
        with shown_progress(scan.unit) as progress, interrupts.at_once():
            ridge = register(scan, pick, progress=interrupts.checking(progress))
        interrupts.check()
        click.echo("Writing the feature, STEP and pictures ...\n")
        found = diagnose(ridge, scan)
        files = output.write(ridge, scan, folder, True, True, found)
        import cad_export

        cad_export.step(ridge, folder / TALLER, h=1.5)
        interrupts.wrote(TALLER)
    print_table("The ridge found", output.rows(ridge, found))
    click.echo()
    print_table("Against the truth", _errors(ridge, spiral))
    click.echo()
    print_table("Open next", _next(folder, files))
    if output.interrupted(ridge):
        return fail("interrupted: the ridge goes as far as the march had come", INTERRUPTED)
    return 0


def _errors(ridge: Ridge, spiral: Spiral) -> list[tuple[str, str]]:
    """Root mean square errors at the stations."""
    s, y = spiral.path_coordinates(ridge.spine[:, :2])
    on = (s >= 0) & (s <= spiral.arc_length)

    def rms(values: object) -> float:
        return float(np.sqrt(np.mean(np.square(np.asarray(values)[on]))))

    off = np.hypot(y, ridge.spine[:, 2])
    return [
        ("length", f"{number(ridge.length)} of {number(spiral.arc_length)} mm"),
        ("height", f"{100 * rms(ridge.height / spiral.height(s) - 1):.2f} % rms"),
        ("width", f"{100 * rms(ridge.width / spiral.width(s) - 1):.2f} % rms"),
        ("spine", f"{rms(off):.3f} mm rms"),
    ]


def _next(folder: Path, files: dict[str, str]) -> list[tuple[str, str]]:
    return [
        (files["view"], "the scan with the ridge on it"),
        (files["profile"], "height and width along the ridge"),
        (files["deviation"], "where to trust it"),
        (files["step"], "the ridge for any CAD program"),
        (str(folder / TALLER), "the same ridge, half as high again"),
        ("your own scan", "ridgefeature register SCAN --at X Y Z"),
        ("another height", f"ridgefeature export {files['feature']} -o taller.step --h 2"),
    ]
