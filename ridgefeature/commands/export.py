"""`ridgefeature export`: a feature, or a part with ridges, as a CAD file at the heights and widths asked."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ridgefeature.commands import interrupts
from ridgefeature.commands.feature_file import CAD, check_is_feature, chosen, load_feature
from ridgefeature.readable import number

if TYPE_CHECKING:
    from cad_export.record import Carried

_MACRO = ".fcmacro"


def run(feature: Path, output: Path, h: float | None, w: float | None, name: str | None) -> None:
    """Write `feature` to `output`, whose suffix says how, and say what was written.

    h, w: rates; None leaves those of a STEP file, and is 1 for a .ridge.json. name: of the ridge meant, where
    a STEP file carries several. Raises ValueError or OSError.
    """
    from cad_export.formats import checked_target, write

    checked_target(output)
    interrupts.writes(output.parent, [output.name], [])
    check_is_feature(feature)
    with interrupts.at_once():
        source, rates, said = _found(feature, output, h, w, name)
    interrupts.check()
    if isinstance(source, Path):
        _copy(source, output)
    else:
        write(source, output, **rates)
    interrupts.wrote(output.name)
    click.echo(f"wrote {output}: {said}")


Found = tuple[Any, dict[str, float], str]
"""What to write (a Path: that file itself), the rates for it, and what to say of it."""


def _found(feature: Path, output: Path, h: float | None, w: float | None, name: str | None) -> Found:
    if feature.suffix.lower() in CAD:
        return _from_step(feature, output, h, w, name)
    if name is not None:
        raise ValueError(f"--name: {feature.name} holds one ridge, which has no name; leave it out")
    rates = {"h": _or(h, 1.0), "w": _or(w, 1.0)}
    return load_feature(feature), rates, f"the ridge at {_at(**rates)}"


def _from_step(file: Path, output: Path, h: float | None, w: float | None, name: str | None) -> Found:
    from cad_export.loading import carried_in

    records = carried_in(file)
    if name is not None:
        chosen(file, records, name)
    as_it_is = h is None and w is None
    if output.suffix.lower() == _MACRO:
        return _one_ridge(file, records, h, w, name, placed=False)
    if any(record.placement for record in records):
        if not as_it_is:
            return _regenerated(file, h, w, name)
        if name is not None:
            raise ValueError(
                f"--name: expected --h or --w for {name!r} too, got neither; give one, or leave --name out"
            )
    if as_it_is and name is None:
        return _as_it_is(file, output, records)
    return _one_ridge(file, records, h, w, name, placed=True)


def _regenerated(file: Path, h: float | None, w: float | None, name: str | None) -> Found:
    """The part of a file with its pasted ridges at these rates."""
    from cad_export.carried import carried_by
    from cad_export.regeneration import regenerate

    part = regenerate(file, h=h, w=w, name=name)
    return part, {}, f"the part regenerated with {_list([r for _, r in carried_by(part)])}"


def _as_it_is(file: Path, output: Path, records: list[Carried]) -> Found:
    """The shape of a file, unchanged; for another STEP file the file itself, with all names and colours."""
    from cad_export.step_file import read_step

    source = file if output.suffix.lower() in CAD else read_step(file)
    return source, {}, f"what {file.name} holds, with {_list(records)}"


def _copy(file: Path, output: Path) -> None:
    """Written beside and renamed, so that the file may be its own copy."""
    beside = output.with_name(f".{output.stem}.{os.getpid()}{output.suffix}")
    try:
        shutil.copyfile(file, beside)
        os.replace(beside, output)
    finally:
        beside.unlink(missing_ok=True)


def _one_ridge(
    file: Path, records: list[Carried], h: float | None, w: float | None, name: str | None, placed: bool
) -> Found:
    """The surface of one ridge, without what it stands on, where the file has it if `placed`."""
    from cad_export.loading import ridge_of
    from cad_export.step_file import moved_face

    record = chosen(file, records, name)
    rates = {"h": _or(h, record.h), "w": _or(w, record.w)}
    said = f"the surface of {record.name!r} alone at {_at(**rates)}"
    ridge = ridge_of(record, file)
    if not placed:
        return ridge, rates, f"{said}, where it was registered"
    return moved_face(ridge, record, **rates), {}, said


def _or(rate: float | None, default: float) -> float:
    return default if rate is None else rate


def _at(h: float, w: float) -> str:
    return f"h {number(h)}, w {number(w)}"


def _list(records: list[Carried]) -> str:
    return "; ".join(f"{record.name!r} at {_at(record.h, record.w)}" for record in records)
