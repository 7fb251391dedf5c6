"""What takes long on the page: opening a file, marching. It is done in another thread, and watched."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ridgefeature.diagnosis import diagnose
from ridgefeature.doubts import pick_missed
from ridgefeature.io.colours import Pixels, colours_at
from ridgefeature.io.read import FORMATS, read_scan
from ridgefeature.march import INTERRUPTED
from ridgefeature.readable import number, reason
from ridgefeature.registration import NoRidgeError, register
from ridgefeature.ridge import Ridge
from ridgefeature.synthetic import Spiral
from ridgefeature.viewer import saved, takeaway
from ridgefeature.viewer.marching import March
from ridgefeature.viewer.page import HINT, Page
from ridgefeature.viewer.part_preview import PartPreview, aside

_EVERY, _FIRST = 0.03, 0.01
"""Seconds between two looks at what was found, and before anything is."""


_SETTLES = 0.4
"""Seconds without a template after which a march is taken to have come to its end."""
MARCHING = "Marching"
"""What the page tells as long as templates are added."""


class Work:
    """The long work of one page; one thing at a time. folder: the only one where files are opened by name."""

    def __init__(self, page: Page, folder: Path) -> None:
        self.page, self.folder = page, folder.resolve()
        self.march: March | None = None
        self.preview = PartPreview(page)
        self._lock = asyncio.Lock()
        self._doing: list[str] = []
        self._ready = True

    async def warm(self) -> None:
        """Have all compiled that a march needs, which takes a minute or two the first time of all."""
        self._ready = False
        with self._telling("Getting ready: the first time of all this takes a minute or two"):
            await aside(_rehearse)
        self._ready = True

    @property
    def busy(self) -> bool:
        return self._lock.locked()

    async def open(self, path: Path, name: str, unit: str | None = None) -> None:
        """Open a scan or a saved page. Raises ValueError or OSError where it is none."""
        with self._telling(f"Opening {name}"):
            async with self._lock:
                if path.suffix == saved.SUFFIX:
                    scan, session = await aside(lambda: saved.load(path))
                    if scan is None:
                        raise ValueError(f"{name}: expected a saved page with a scan, it has none")
                    self.page.show_scan(scan, name, session)
                    for feature in session.features:
                        await self._diagnose(feature.registered)
                    self.page.refresh()
                    return
                scan = await aside(lambda: read_scan(path, unit=unit))
                self.page.show_scan(scan, name)
                self.page.own_colours(await aside(lambda: _colours(path, self.page.scene.still)))

    def files(self) -> list[str]:
        """Scans and saved pages in the working folder, by name."""
        known = {*FORMATS, saved.SUFFIX}
        return sorted(p.name for p in self.folder.iterdir() if p.suffix.lower() in known and p.is_file())

    async def open_by_name(self, name: str) -> None:
        """Open a file of the working folder, by its path in it."""
        path = (self.folder / name).resolve()
        if not path.is_relative_to(self.folder):
            self.page.say(
                f"{name}: expected a file in {self.folder.name} or below; drop it on the page", bad=True
            )
            return
        try:
            await self.open(path, path.name)
        except (ValueError, OSError) as error:
            self.page.say(str(error), bad=True)

    async def click(self, across: float, down: float) -> None:
        """Register the ridge at a place on the view, in parts of the picture from its upper left.

        Where a part is shown, the ridge is pasted there.
        """
        page = self.page
        if page.tell.pasting:
            await self.preview.put(across, down)
            return
        if page.scan is None:
            return
        if self.busy or not self._ready:
            with page.tell:
                page.say(f"One thing at a time: {page.tell.busy.lower()}. Click again then.", bad=True)
            return
        place = page.scene.pick(across, down)
        if place is None:
            page.say("There is no scan point here; click on the scan.", bad=True)
            return
        here = page.session.at(place)
        if here is not None:
            page.choose(here)
            page.say(f"This is {here}. To register it anew, remove it first.")
            return
        page.scene.mark(place, "pick", 11.0)
        at = (float(place[0]), float(place[1]), float(place[2]))
        self.march = March(page.scan, at, page.tell.kind)
        with self._telling(MARCHING):
            async with self._lock:
                await self._register(self.march)

    async def _register(self, march: March) -> None:
        page, shown, last = self.page, 0, time.monotonic()
        page.tell.marching = True
        task = asyncio.ensure_future(aside(march.run))
        while not task.done():
            await asyncio.wait({task}, timeout=_EVERY if shown else _FIRST)
            if shown and page.tell.busy == MARCHING and time.monotonic() - last > _SETTLES:
                with page.tell:
                    page.tell.busy = "Fitting the whole ridge"
            if len(march.templates) > shown:
                last = time.monotonic()
                for number, template in enumerate(march.templates[shown:], shown):
                    page.scene.show_template(template, number)
                shown = len(march.templates)
                page.scene.coarse(True)
                with page.tell:
                    page.tell.busy, page.tell.count = MARCHING, shown
                page.draw()
        page.tell.marching = False
        page.scene.hide("template ")
        page.scene.coarse(False)
        try:
            ridge = task.result()
        except NoRidgeError as error:
            page.say(f"There is no ridge here: {reason(error)}. Click on the crest of one.", bad=True)
        except KeyboardInterrupt:
            page.say("Stopped before a template was fitted.")
        except ValueError as error:
            page.say(str(error), bad=True)
        else:
            await self._add(ridge, march)
        page.draw()

    async def _add(self, ridge: Ridge, march: March) -> None:
        page = self.page
        await aside(lambda: page.pointing.points_near(ridge))
        page.scene.mark(None, "pick")
        known = page.session.again(ridge)
        if known is not None:
            page.choose(known)
            page.say(f"This is {known} again. To register it anew, remove it first.")
            return
        page.do(page.session.added(ridge, march.at))
        missed = pick_missed(ridge)
        far = "" if missed is None else f" The pick lies {number(missed[0], 3)} {ridge.unit} from it."
        early = march.stopped and INTERRUPTED in ridge.stop
        stopped = " It was stopped: what was found is kept." if early else ""
        page.say(f"{page.session.chosen}: {len(ridge.templates)} templates.{far}{stopped} {HINT}")
        await self._diagnose(ridge)
        page.refresh()

    async def _diagnose(self, ridge: Ridge) -> None:
        scan = self.page.scan
        if scan is not None:
            await aside(lambda: self.page.pointing.points_near(ridge))
            self.page.found[ridge] = await aside(lambda: diagnose(ridge, scan))

    def stop(self) -> None:
        """End the march at its next template."""
        if self.march is not None:
            self.march.stop()

    async def take(self, kind: str, name: str, folder: Path) -> Path:
        """Write what can be taken away; "page" is the whole state.

        What cannot be written is told on the page, too. Raises ValueError or OSError then.
        """
        try:
            return await self._taken(kind, name, folder)
        except (ValueError, OSError) as error:
            with self.page.tell:
                self.page.say(f"This cannot be taken away: {error}", bad=True)
            raise

    async def _taken(self, kind: str, name: str, folder: Path) -> Path:
        page = self.page
        scan, session = page.scan, page.session
        if kind == "page":
            stem = Path(page.tell.scan_name or "page").stem
            path = folder / f"{takeaway.stem_of(stem)}{saved.SUFFIX}"
            await aside(lambda: saved.save(path, scan, session))
            return path
        if kind == "part":
            part = self.preview.part
            if part is None:
                raise ValueError("expected a part with a ridge on it, there is none; paste first")
            return await aside(lambda: takeaway.part(part.solid, folder))
        feature = session[name]
        return await aside(lambda: takeaway.write(kind, feature, scan, folder))

    @contextmanager
    def _telling(self, text: str) -> Iterator[None]:
        """Tell what is being done while it is; of several things the last that was begun."""
        tell = self.page.tell
        self._doing.append(text)
        with tell:
            tell.busy, tell.count, tell.bad = text, 0, False
        try:
            yield
        finally:
            self._doing.remove(text)
            with tell:
                tell.busy = self._doing[-1] if self._doing else ""


def _colours(path: Path, places: NDArray[np.float64]) -> Pixels | None:
    """The file's own, where it has any that can be read."""
    try:
        return colours_at(path, places)
    except (ValueError, OSError, ImportError, KeyError, IndexError):
        return None


def _rehearse() -> None:
    spiral = Spiral()
    at = (*map(float, spiral.spine(np.array(8.0))[:2]), float(spiral.height(np.array(8.0))))
    points = spiral.points(20_000, noise=0.1)
    diagnose(register(points, at=at), points)
