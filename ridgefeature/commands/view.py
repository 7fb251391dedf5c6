"""`ridgefeature view`: the web page."""

from __future__ import annotations

from pathlib import Path

import click

from ridgefeature.commands import interrupts

_MEGABYTE = 2**20


def run(scan: Path | None, unit: str | None, host: str, port: int, upload: int, browser: bool) -> None:
    """Serve it until it is interrupted."""
    from ridgefeature.viewer.serve import serve

    def ready(address: str) -> None:
        click.echo(f"The page is at {address}\nCtrl-C ends it.")

    with interrupts.at_once():
        serve(scan, unit, host, port, upload * _MEGABYTE, ready, browser)
