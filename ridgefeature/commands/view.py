"""`ridgefeature view`: the web page."""

from __future__ import annotations

import errno
import os
import webbrowser
from pathlib import Path

import click

from ridgefeature.commands import interrupts
from ridgefeature.scan import millimetres_per

_MEGABYTE = 2**20


def run(scan: Path | None, unit: str | None, host: str, port: int, upload: int, browser: bool) -> None:
    """Serve it until it is interrupted. What is wrong with the words is told before there is a page."""
    if scan is not None and not scan.is_file():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(scan))
    if unit is not None:
        millimetres_per(unit)
    from ridgefeature.viewer.guard import LOOPBACK
    from ridgefeature.viewer.serve import serve

    def ready(address: str) -> None:
        if host not in LOOPBACK:
            click.echo("Whoever reaches this address and has its token may use the page.", err=True)
        click.echo(f"The page is at {address}\nCtrl-C ends it.")
        if browser:
            webbrowser.open(address)

    with interrupts.at_once():
        try:
            serve(scan, unit, host, port, upload * _MEGABYTE, ready)
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise
            raise ValueError(
                f"--port: expected a free one, {port} is in use; choose another, or leave it out"
            ) from None
