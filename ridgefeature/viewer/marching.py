"""A registration that can be watched and stopped, in a thread of its own."""

from __future__ import annotations

import threading

from ridgefeature.registration import register
from ridgefeature.ridge import Ridge
from ridgefeature.scan import Scan
from ridgefeature.template import Template


class March:
    """Registers the ridge at a pick; `templates` are those fitted so far."""

    def __init__(self, scan: Scan, at: tuple[float, float, float], kind: str = "ridge") -> None:
        self.scan, self.at, self.kind = scan, at, kind
        self.templates: list[Template] = []
        self._stopped = threading.Event()

    def stop(self) -> None:
        """End the march at its next template; what was found is kept."""
        self._stopped.set()

    @property
    def stopped(self) -> bool:
        return self._stopped.is_set()

    def run(self) -> Ridge:
        """The ridge, as far as the march came. Raises as `register` does; KeyboardInterrupt if it was stopped
        before there was a template."""
        return register(self.scan, at=self.at, kind=self.kind, progress=self._noted)

    def _noted(self, template: Template) -> None:
        if self._stopped.is_set():
            raise KeyboardInterrupt
        self.templates.append(template)
