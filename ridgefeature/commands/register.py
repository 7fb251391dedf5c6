"""`ridgefeature register`: from a scan file and a pick to a feature, STEP and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ridgefeature import read_scan, register
from ridgefeature.commands import interrupts, output
from ridgefeature.commands.console import INTERRUPTED, fail, print_json
from ridgefeature.commands.folder import output_folder
from ridgefeature.commands.options import settings_from
from ridgefeature.commands.progress import shown_progress
from ridgefeature.diagnosis import diagnose


def run(
    scan: Path,
    out: Path,
    no_step: bool,
    no_pictures: bool,
    as_json: bool,
    unit: str | None,
    sample: int | None,
    vertices: bool,
    **options: Any,
) -> int:
    """Do it and print the summary; returns the exit status. options: hints and settings of `register`."""
    settings = settings_from(options)
    step, pictures = not no_step, not no_pictures
    with output_folder(out, output.file_names(step, pictures)) as folder:
        count = {} if sample is None else {"sample": sample}
        with interrupts.at_once():
            points = read_scan(scan, vertices=vertices, unit=unit, **count)
        with shown_progress(points.unit) as progress, interrupts.at_once():
            ridge = register(points, settings=settings, progress=interrupts.checking(progress), **options)
        interrupts.check()
        found = diagnose(ridge, points)
        interrupts.check()
        files = output.write(ridge, points, folder, step, pictures, found)
    if as_json:
        print_json({**output.document(ridge, found), "files": files})
    else:
        output.show(ridge, files, found)
    if output.interrupted(ridge):
        return fail("interrupted: the ridge goes as far as the march had come", INTERRUPTED)
    return 0
