"""What is written and said about a registered ridge."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ridgefeature.commands import interrupts
from ridgefeature.commands.console import one_line, print_table
from ridgefeature.diagnosis import Diagnosis
from ridgefeature.readable import ends, kind, number, pick, templates
from ridgefeature.readable import rows as trust
from ridgefeature.ridge import Ridge
from ridgefeature.scan import Scan

FEATURE, STEP = "feature.ridge.json", "ridge.step"
PROFILE, VIEW, DEVIATION = "profile.png", "view.png", "deviation.png"


def file_names(step: bool, pictures: bool) -> list[str]:
    """The files that `write` writes."""
    return [FEATURE, *([STEP] if step else []), *([PROFILE, VIEW, DEVIATION] if pictures else [])]


def write(
    ridge: Ridge, scan: Scan, folder: Path, step: bool, pictures: bool, found: Diagnosis | None = None
) -> dict[str, str]:
    """Write the files of a ridge; returns what is in each and its path. found: its diagnosis, if there.

    An interrupt is raised between two files.
    """
    files = {"feature": FEATURE}
    ridge.save(folder / FEATURE)
    interrupts.wrote(FEATURE)
    if step:
        from cad_export import step as write_step

        interrupts.check()
        write_step(ridge, folder / STEP)
        interrupts.wrote(STEP)
        files["step"] = STEP
    if pictures:
        from ridgefeature import plot

        interrupts.check()
        plot.profile(ridge, folder / PROFILE, scan)
        interrupts.wrote(PROFILE)
        plot.view(scan, ridge, folder / VIEW)
        interrupts.wrote(VIEW)
        plot.deviation(scan, ridge, folder / DEVIATION, found)
        interrupts.wrote(DEVIATION)
        files |= {"profile": PROFILE, "view": VIEW, "deviation": DEVIATION}
    return {kind: str(folder / name) for kind, name in files.items()}


def document(ridge: Ridge, found: Diagnosis | None = None) -> dict[str, Any]:
    """The summary for machines: the ridge's own, its values at the stations, and its diagnosis if there."""
    arrays = "arc_length", "height", "height_std", "width", "width_std", "half_height_width"
    return {
        **ridge.summary(),
        "source": None if ridge.source is None else ridge.source.name,
        "pick": ridge.pick.tolist(),
        "interrupted": interrupted(ridge),
        "stations": {name: getattr(ridge, name).tolist() for name in arrays},
        **({} if found is None else {"diagnosis": found.summary()}),
    }


def rows(ridge: Ridge, found: Diagnosis | None = None) -> list[tuple[str, str]]:
    """The summary for people; with what its scan tells of it, if that is there."""
    figures, unit = ridge.summary(), ridge.unit
    return [
        ("kind", kind(ridge)),
        ("length", f"{number(ridge.length)} {unit}{', a ring' if ridge.closed else ''}"),
        ("templates", templates(ridge)),
        ("height h", _span(ridge.height, unit, ridge.height_std)),
        ("width w, foot to foot", _span(ridge.width, unit, ridge.width_std)),
        ("width at half height", _span(ridge.half_height_width, unit)),
        ("section", figures["section"]),
        (
            "mean distance M",
            f"{number(figures['M'], 3)} {unit}, where a perfect patch has {number(figures['M_floor'], 3)}",
        ),
        ("pick", pick(ridge)),
        *(
            [("noise level", f"{number(figures['noise'], 3)} {unit}"), *ends(ridge)]
            if found is None
            else trust(ridge, found)
        ),
    ]


def show(ridge: Ridge, files: dict[str, str], found: Diagnosis) -> None:
    """Print the summary and the files written."""
    what = "groove" if ridge.groove else "ridge"
    name = what if ridge.source is None else f"{what} in {ridge.source.name}"
    print_table(name, [*rows(ridge, found), *((f"wrote {kind}", path) for kind, path in files.items())])


def interrupted(ridge: Ridge) -> bool:
    """Whether the march was stopped by hand."""
    from ridgefeature.march import INTERRUPTED

    return INTERRUPTED in ridge.stop


def _span(values: Any, unit: str, std: Any = None) -> str:
    low, high = number(values.min()), number(values.max())
    text = f"{low if low == high else f'{low} to {high}'} {unit}"
    if std is None:
        return text
    least, most = number(std.min(), 2), number(std.max(), 2)
    return one_line(f"{text}, standard deviation {least if least == most else f'{least} to {most}'}")
