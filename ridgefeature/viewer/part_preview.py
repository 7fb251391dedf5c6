"""The chosen ridge on a part, on the page: pasted again whenever it, its rates or its place change."""

from __future__ import annotations

import asyncio
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ridgefeature.readable import reason
from ridgefeature.ridge import Ridge
from ridgefeature.viewer import preview
from ridgefeature.viewer.page import HINT, Page
from ridgefeature.viewer.session import Feature

T = TypeVar("T")
Array = NDArray[np.float64]
_LIVE = "Click on the part to put the ridge there; the sliders are live."
_CHOOSE = "Click on the face where the ridge is to stand."
_CHECKING = "one closed valid solid; looking for self-intersections"


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
        """Kind, ridge, solid and the place where the ridge goes first."""
        self._at: Array | None = None
        self._good: tuple[Ridge, Array, float] | None = None
        """What was pasted last on this host, where, and by how many degrees it was turned."""
        self._task: asyncio.Task[None] | None = None
        self._again = False

    async def open_host(self, path: Path, name: str) -> None:
        """Take the solid of a STEP file for the host. Raises ValueError or OSError where there is none."""
        self._file = await aside(lambda: preview.host_from(path))
        with self.page.tell as tell:
            tell.host_name, tell.host = name, "file"
        if self.page.feature is not None:
            await self.paste()

    async def paste(self) -> None:
        """Show a part with the ridge on it instead of the scan; a file's without, until a face is chosen."""
        page = self.page
        if page.feature is None:
            return
        if not page.tell.pasting:
            page.scene.keep_camera()
        self._host, self._at, self._good, self.part = (), None, None, None
        with page.tell:
            page.tell.pasting, page.tell.part_note, page.tell.part_turn = True, "", 0.0
        self._begin()
        if self._task is not None:
            await self._task

    def again(self) -> None:
        """Something changed; paste anew if the part is shown."""
        if self.page.tell.pasting and self.page.feature is None:
            self.leave()
        elif self.page.tell.pasting:
            self._begin()

    async def put(self, across: float, down: float) -> None:
        """Paste at a place on the view, in parts of the picture from its upper left."""
        place = self.page.scene.pick_part(across, down)
        if place is None:
            self.page.say("There is no part here; click on it.", bad=True)
        elif self._host:
            # On the ridge that is there now, the click means the host under it.
            self._at = preview.nearest_on(self._host[2], place)
            self.again()

    def leave(self) -> None:
        """Back to the scan."""
        page = self.page
        page.tell.pasting, self._again = False, False
        page.scene.hide("part")
        page.scene.only_part(False)
        page.scene.restore_camera()
        page.say(HINT)
        page.refresh()

    def _begin(self) -> None:
        self._again = True
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._work())

    async def _work(self) -> None:
        page, wrong = self.page, ""
        while self._again and page.tell.pasting:
            self._again = False
            with page.tell:
                page.tell.busy, page.tell.count = "Pasting", 0
            try:
                await self._once(wrong)
                wrong = ""
            except (ValueError, OSError) as error:
                wrong = await self._back(f"It cannot be pasted there: {reason(error)}.")
            with page.tell:
                page.tell.busy = ""

    async def _back(self, wrong: str) -> str:
        """After what went wrong: to the place where the same ridge was before, or to the bare host."""
        page, good, here = self.page, self._good, self._at
        self.part, self._good, page.tell.part_note = None, None, ""
        if self._again or not page.tell.pasting:
            return ""
        same = good is not None and page.feature is not None and good[0] is page.feature.ridge
        if good and same and (good[1] is not here or good[2] != page.tell.part_turn):
            self._at, self._again = good[1], True
            with page.tell:
                page.tell.part_turn = good[2]
            return f"{wrong} It stays where it was."
        await self._show_host()
        if page.tell.pasting:
            page.say(wrong, bad=True)
        return ""

    async def _once(self, wrong: str) -> None:
        """Paste. wrong: what the page goes on telling, if it is not empty."""
        page, feature = self.page, self.page.feature
        if feature is None:
            return
        await self._choose_host(feature)
        if self._at is None:
            await self._show_host()
            page.say(_CHOOSE)
            return
        first, host, at, turn = self.part is None, self._host, self._at, float(page.tell.part_turn or 0.0)
        part = await aside(partial(preview.pasted, feature.ridge, host[2], at, turn))
        if not page.tell.pasting or self._host is not host:
            return
        self.part = part
        page.scene.show_part(part.points, part.host, part.grown)
        if first and host[3] is not None and not wrong:
            page.scene.look_at_part(part.points, part.grown)
        page.say(wrong or _LIVE, bad=bool(wrong))
        page.draw()
        await self._check(part)
        if self._host is host:
            self._good = feature.ridge, at, turn

    async def _choose_host(self, feature: Feature) -> None:
        kind = str(self.page.tell.host)
        if self._host[:2] == (kind, feature.registered):
            return
        if kind == "file":
            if self._file is None:
                raise ValueError("expected the STEP file of a part, there is none; open one")
            solid, at = self._file, None
        else:
            solid, at = await aside(lambda: preview.host_for(kind, feature.registered))
        self.part, self._good = None, None
        same = bool(self._host) and self._host[0] == kind == "file"
        self._host, self._at = (kind, feature.registered, solid, at), self._at if same else at

    async def _show_host(self) -> None:
        """The host without a ridge, so that a face can be clicked."""
        page, host = self.page, self._host
        if host and page.tell.pasting:
            bare = await aside(lambda: preview.bare(host[2]))
            if not page.tell.pasting or self._host is not host:
                return
            first = not any(name.startswith("part") for name in page.scene.names())
            page.scene.show_part(bare.points, bare.host, bare.grown)
            if first:
                page.scene.fit()
            page.draw()

    async def _check(self, part: preview.Part) -> None:
        """The thorough checks, given up when something changes."""
        page = self.page
        with page.tell:
            page.tell.part_note, page.tell.busy = f"{_CHECKING}; {part.told}", "Checking the part"
        with tempfile.TemporaryDirectory(prefix="ridgefeature-") as folder:
            path = Path(folder) / "part.brep"
            await aside(lambda: part.solid.exportBrep(str(path)))
            words = sys.executable, "-m", "ridgefeature.viewer.check_part", str(path)
            process = await asyncio.create_subprocess_exec(*words, stdout=asyncio.subprocess.PIPE)
            done = asyncio.ensure_future(process.communicate())
            while not done.done():
                await asyncio.wait({done}, timeout=0.05)
                if self._again or not page.tell.pasting:
                    process.kill()
                    await done
                    return
        told = done.result()[0].decode().strip()
        if told or process.returncode:
            raise ValueError(told or "the checks of the part failed")
        with page.tell:
            page.tell.part_note = f"one closed valid solid, checked for self-intersections; {part.told}"
