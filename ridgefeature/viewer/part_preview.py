"""The chosen ridge on a part, on the page: pasted again whenever it, its rates or its place change."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ridgefeature.viewer import preview
from ridgefeature.viewer.page import HINT, Page

T = TypeVar("T")
Array = NDArray[np.float64]
_STILL = "Click on the part to put the ridge there; the sliders are live."


async def aside(work: Callable[[], T]) -> T:
    """Done in another thread."""
    return await asyncio.get_running_loop().run_in_executor(None, work)


class PartPreview:
    """What is pasted on what. Only the last of several changes in a row is worked out."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.part: preview.Part | None = None
        self._file: Any = None
        self._host: tuple[Any, ...] = ()
        self._at: Array | None = None
        self._task: asyncio.Task[None] | None = None
        self._again = False

    async def open_host(self, path: Path, name: str) -> None:
        """Take the solid of a STEP file for the host. Raises ValueError or OSError where there is none."""
        self._file = await aside(lambda: preview.host_from(path))
        with self.page.tell as tell:
            tell.host_name, tell.host = name, "file"
        self._host = ()
        if self.page.feature is not None:
            await self.paste()

    async def paste(self) -> None:
        """Paste, and show the part instead of the scan."""
        page = self.page
        if page.feature is None:
            return
        if not page.tell.pasting:
            page.scene.keep_camera()
        self._host = ()
        self._at = None
        with page.tell:
            page.tell.pasting, page.tell.busy = True, "Pasting"
        await self._work(fit=True)

    def again(self) -> None:
        """Something changed; paste anew if the part is shown."""
        if not self.page.tell.pasting:
            return
        if self.page.feature is None:
            self.leave()
        elif self._task is not None and not self._task.done():
            self._again = True
        else:
            self._task = asyncio.get_running_loop().create_task(self._work())

    async def put(self, across: float, down: float) -> None:
        """Paste at a place on the view, in parts of the picture from its upper left."""
        place = self.page.scene.pick_part(across, down)
        if place is not None:
            # On the ridge that is there now, the click means the host under it.
            self._at = preview.nearest_on(self._host[2], place)
            self.again()

    def leave(self) -> None:
        """Back to the scan."""
        page = self.page
        page.tell.pasting = False
        page.scene.hide("part")
        page.scene.only_part(False)
        page.scene.restore_camera()
        page.say(HINT)
        page.refresh()

    async def _work(self, fit: bool = False) -> None:
        """Paste fast first, as long as things change, then with all checks."""
        page = self.page
        try:
            for check in (False, True):
                self._again = True
                while self._again:
                    self._again = False
                    await self._once(check, fit)
                    fit = False
        except (ValueError, OSError) as error:
            self.part = None
            page.scene.hide("part")
            page.tell.part_note = ""
            page.say(f"It cannot be pasted: {error}", bad=True)
            page.draw()
        finally:
            with page.tell:
                page.tell.busy = ""

    async def _once(self, check: bool, fit: bool) -> None:
        page = self.page
        feature, kind = page.feature, str(page.tell.host)
        if feature is None:
            return
        key = kind, id(feature.registered)
        if self._host[:2] != key:
            if kind == "file":
                solid, at = self._file, None
            else:
                solid, at = await aside(lambda: preview.host_for(kind, feature.registered))
            self._host = (*key, solid, at)
            self._at = self._at if fit is False and self._at is not None else at
        ridge = feature.registered.resized(h=feature.h, w=feature.w, between=feature.between)
        make = partial(preview.pasted, ridge, self._host[2], self._at, 1.0, 1.0, check)
        self.part = await aside(make)
        if not page.tell.pasting:
            return
        page.scene.show_part(self.part.points, self.part.host, self.part.grown)
        if fit:
            page.scene.look_at_part(self.part.points, self.part.grown)
        with page.tell:
            page.tell.part_note = self.part.told
            page.say(_STILL)
        page.draw()
