"""The command line: what can be asked for. How it is done is in `ridgefeature.commands`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ridgefeature.commands.console import Program
from ridgefeature.commands.options import SettingsCommand

_FILE = click.Path(path_type=Path)
_OUT = "ridge-out"
_DEMO = "ridge-demo"


@click.group(cls=Program, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="ridgefeature", prog_name="ridgefeature")
def main() -> None:
    """Register a ridge in a 3D scan as a CAD feature with a height and a width.

    Exit status: 0 done, 2 bad input, 3 no ridge there, 130 interrupted.
    """


@main.command()
@click.argument("folder", metavar="[DIR]", type=_FILE, default=Path(_DEMO))
def demo(folder: Path) -> int:
    """Make the paper's spiral and register it: scan, feature, STEP, pictures.

    They go to DIR (ridge-demo if not given); files of the same names there are replaced.
    """
    from ridgefeature.commands.demo import run

    return run(folder)


@main.command(cls=SettingsCommand)
@click.argument("scan", type=_FILE)
@click.option(
    "--at",
    type=float,
    nargs=3,
    metavar="X Y Z",
    required=True,
    help="The pick: a point on or near the ridge.",
)
@click.option(
    "--direction", type=float, nargs=3, metavar="DX DY DZ", help="Along the ridge, from its start to its end."
)
@click.option("--width", type=float, metavar="W", help="Starting guess of the width between the feet.")
@click.option("--height", type=float, metavar="H", help="Starting guess of the height.")
@click.option(
    "--kind",
    type=click.Choice(["ridge", "groove", "auto"]),
    default="ridge",
    show_default=True,
    help="What to look for.",
)
@click.option("--roi", type=float, metavar="R", help="Leave out points further than this from the pick.")
@click.option(
    "--unit",
    metavar="UNIT",
    help="Length unit of the file: um, mm, cm, m, km, in, ft.  [default: what the format says, else mm]",
)
@click.option(
    "--sample", type=int, metavar="N", help="Points to sample on a mesh or CAD file.  [default: 200000]"
)
@click.option("--vertices", is_flag=True, help="Take a mesh's vertices instead of sampling its faces.")
@click.option(
    "--out",
    type=_FILE,
    default=Path(_OUT),
    show_default=True,
    metavar="DIR",
    help="Folder for the files; those of the same names there are replaced.",
)
@click.option("--no-step", is_flag=True, help="Write no ridge.step.")
@click.option("--no-pictures", is_flag=True, help="Write no profile.png, view.png and deviation.png.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of the table.")
def register(**options: Any) -> int:
    """Register the ridge in SCAN under the picked point.

    Writes feature.ridge.json, ridge.step, profile.png (height and width along the ridge), view.png and
    deviation.png (where to trust it) to DIR. Lengths are in the scan's unit. Ctrl-C ends the march and keeps
    what is there.
    """
    from ridgefeature.commands.register import run

    return run(**options)


@main.command()
@click.argument("feature", type=_FILE)
@click.option(
    "-o",
    "--output",
    type=_FILE,
    required=True,
    metavar="X.step",
    help="File to write: .step .stp .iges .igs .brep .stl .3mf .glb .gltf .FCMacro",
)
@click.option("--h", "h", type=float, metavar="RATE", help="Height: 1 is as registered.")
@click.option("--w", "w", type=float, metavar="RATE", help="Width: 1 is as registered.")
@click.option("--name", metavar="NAME", help="The ridge that is meant, of several in a STEP file.")
def export(feature: Path, output: Path, h: float | None, w: float | None, name: str | None) -> None:
    """Write FEATURE as CAD, in millimetres, taller or slimmer if asked.

    FEATURE is a .ridge.json, or a STEP file that carries ridges. Rates that are not given stay as they are in
    the STEP file; a part with pasted ridges is regenerated at new ones.
    """
    from ridgefeature.commands.export import run

    run(feature, output, h, w, name)


@main.command()
@click.argument("scan", type=_FILE, required=False)
@click.option("--unit", metavar="UNIT", help="Length unit of SCAN.  [default: what the format says, else mm]")
@click.option(
    "--port", type=click.IntRange(0, 65535), default=0, metavar="N", help="Port.  [default: a free one]"
)
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    metavar="ADDRESS",
    help="Address to listen at: who can reach it and has the token may use the page.",
)
@click.option(
    "--upload",
    type=click.IntRange(1),
    default=1024,
    show_default=True,
    metavar="MB",
    help="Size of the largest file that may be sent to the page.",
)
@click.option("--no-browser", is_flag=True, help="Open no browser; print the address only.")
def view(scan: Path | None, unit: str | None, port: int, host: str, upload: int, no_browser: bool) -> None:
    """Look at SCAN on a web page: click on a ridge, slide its height and width, take it away.

    The page is served on this machine alone until Ctrl-C. SCAN may also be dropped on the page; a page saved
    there is opened like a scan.
    """
    from ridgefeature.commands.view import run

    run(scan, unit, host, port, upload, not no_browser)


@main.command()
@click.argument("file", type=_FILE)
@click.option("--unit", metavar="UNIT", help="Length unit of a scan.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of the table.")
def info(file: Path, unit: str | None, as_json: bool) -> None:
    """Tell what a scan, a feature or a CAD file holds."""
    from ridgefeature.commands.info import run

    run(file, unit, as_json)
