"""`ridgefeature view` with a march that takes its time, as in bends and gaps: for a test that stops it."""

from __future__ import annotations

import time

from ridgefeature.cli import main
from ridgefeature.template import Template
from ridgefeature.viewer.marching import March

_noted = March._noted


def _slowly(march: March, template: Template) -> None:
    _noted(march, template)
    time.sleep(0.02)


if __name__ == "__main__":
    March._noted = _slowly  # type: ignore[method-assign]
    main()
