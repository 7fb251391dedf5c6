"""The march as it goes: a line on stderr that a terminal keeps up to date, nothing elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ridgefeature.template import Template

_FIRST = "looking for the ridge (compiles for some seconds the first time)"


@contextmanager
def shown_progress(unit: str) -> Iterator[Callable[[Template], None] | None]:
    """What to pass as `progress`; how many templates there will be is not known beforehand."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as display:
        task = display.add_task(_FIRST, total=None)
        count, length = 0, 0.0

        def show(template: Template) -> None:
            nonlocal count, length
            count += 1
            length += template.length
            display.update(
                task,
                description=f"template {count}: {length:.4g} {unit} so far, here "
                f"h {template.height:.3g}, w {template.width:.3g}",
            )

        yield show
