"""What is done on the page at once: each thing is one function here, and what it changes is told to the page.

The page's markup is in `layout`; what is open, in `session`; what is seen, in `scene`; what takes long, in
`work`. All of this runs in the server's own thread: VTK wants one.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ridgefeature.diagnosis import Diagnosis
from ridgefeature.readable import ends, kind, number, round_below, templates
from ridgefeature.readable import rows as trust
from ridgefeature.ridge import Ridge
from ridgefeature.scan import Scan
from ridgefeature.viewer import curves
from ridgefeature.viewer.colours import Pixels, by_deviation, by_height
from ridgefeature.viewer.pointing import Pointing
from ridgefeature.viewer.scene import Scene
from ridgefeature.viewer.session import LEAST, MOST, Feature, History, Session
from ridgefeature.viewer.sizes import Sizes

Array = NDArray[np.float64]
HINT = "Click on a ridge to register it. Drag turns, the wheel zooms, Shift with drag pans."
TOLD: dict[str, Any] = {
    "scan_name": "", "scan_note": "", "unit": "mm", "hint": "", "bad": False, "busy": "", "count": 0,
    "ridges": [], "chosen": "", "h": 1.0, "w": 1.0, "rows": [], "profile": "", "section": "", "place": -1.0,
    "stretch": "", "can_undo": False, "can_redo": False, "colouring": "height", "dark": False,
    "kind": "ridge", "bar": 0.0, "bar_text": "", "help": False, "least": LEAST, "most": MOST, "most_w": MOST,
    "height": "", "width": "", "legend": [], "gradient": "", "pasting": False, "host": "plane",
    "part_note": "", "host_name": "", "coloured": False, "earlier": False, "part_turn": 0.0,
    "marching": False,
}  # fmt: skip
"""What the page knows, and how it begins."""


class Page:
    """One page. tell: state of trame that the page sees; draw: sends a new picture to it."""

    def __init__(self, tell: Any, scene: Scene, draw: Callable[[], None]) -> None:
        self.tell, self.scene, self.draw = tell, scene, draw
        self.scan: Scan | None = None
        self.history = History()
        self.found: WeakKeyDictionary[Ridge, Diagnosis] = WeakKeyDictionary()
        """What its scan tells of a ridge as registered, as long as there is a way back to it."""
        self.pointing = Pointing(tell, scene)
        self._shown: set[str] = set()
        self.sizes = Sizes(self)
        self._painted: Ridge | None = None
        self._own_colours: Pixels | None = None
        scene.window.AddObserver("WindowResizeEvent", lambda *_: self._resized())

    @property
    def session(self) -> Session:
        return self.history.now

    @property
    def feature(self) -> Feature | None:
        """The ridge that is chosen."""
        return None if self.session.chosen is None else self.session[self.session.chosen]

    # What is open.

    def show_scan(self, scan: Scan, name: str, session: Session | None = None) -> None:
        """Another scan, with the ridges that were found in it."""
        self.scan, self.history = scan, History(session or Session())
        self.pointing.clear()
        self.found.clear()
        self._shown.clear()
        self.scene.show_points(scan.points)
        self.tell.scan_name = name
        self._tell_scan()
        self.tell.pasting, self._own_colours, self.tell.coloured = False, None, False
        self.say(HINT)
        self.colour("height")

    def _tell_scan(self) -> None:
        scan = self.scan
        if scan is None:
            return
        few = "" if len(self.scene.still) == len(scan) else f", {len(self.scene.still):,} of them drawn"
        size = " x ".join(number(x, 3) for x in np.ptp(scan.bounds, axis=0))
        self.tell.unit = scan.unit
        self.tell.scan_note = f"{len(scan):,} points{few}, {size} {scan.unit}"

    def do(self, session: Session, kind: str = "") -> None:
        """Go on to another session, as `History.do`, and show it."""
        self.history.do(session, kind)
        self.refresh()

    def undo(self) -> None:
        if self.history.undo():
            self.refresh()

    def redo(self) -> None:
        if self.history.redo():
            self.refresh()

    def choose(self, name: str) -> None:
        self.history.now = self.session.choosing(name)
        self.refresh()

    def set_unit(self, unit: str) -> None:
        """The scan's coordinates are in another unit; only as long as there are no ridges."""
        if self.scan is None or unit == self.scan.unit:
            return
        if self.session.features:
            self.say("The unit of a scan is chosen before its ridges; remove them first.", bad=True)
        else:
            self.scan = Scan(self.scan.points, unit, self.scan.source)
            self._tell_scan()
        self.tell.unit = self.scan.unit
        self.colour(self.tell.colouring)

    def toggle(self, name: str) -> None:
        """Show a ridge, or hide it."""
        self.do(self.session.changed(name, shown=not self.session[name].shown))

    def remove(self, name: str | None = None) -> None:
        """Leave out one ridge, by default the chosen one."""
        name = name or self.session.chosen
        if name is not None:
            self.do(self.session.without(name))

    def rename(self, name: str, to: str) -> None:
        self.do(self.session.renamed(name, to))

    def rest(self) -> None:
        """Nothing moves any more: all points are drawn."""
        if not self.tell.pasting:
            self.scene.coarse(False)
        self.draw()
        self.scale()

    # What is seen.

    def own_colours(self, colours: Pixels | None) -> None:
        """Colours (m, 3) that the file has for the points that are drawn; None: it has none."""
        self._own_colours, self.tell.coloured = colours, colours is not None
        if colours is not None:
            self.colour("file")

    def hover(self, across: float, down: float) -> None:
        """As `Pointing.hover`."""
        self.pointing.hover(self.feature, across, down)
        self.draw()

    def away(self) -> None:
        """As `Pointing.away`."""
        self.pointing.away()
        self.draw()

    def point(self, part: float) -> None:
        """As `Pointing.point`."""
        if self.feature is not None:
            self.pointing.point(self.feature, part)
            self.draw()

    def step(self, way: int) -> None:
        """As `Pointing.step`."""
        if self.feature is not None:
            self.pointing.step(self.feature, way)
            self.draw()

    def colour(self, by: str) -> None:
        """Points by "height", by "deviation" from the chosen ridge as registered, or as in the "file"."""
        if len(self.scene.still):
            self._paint(by)
            self.refresh()

    def _paint(self, by: str) -> None:
        feature, points = self.feature, self.scene.still
        if by == "file" and self._own_colours is not None:
            self.scene.paint(self._own_colours)
            self.scene.faint, self.tell.colouring, self.tell.legend = False, "file", []
            return
        self._painted = feature.registered if feature is not None and by == "deviation" else None
        deviation = self._painted is not None
        colouring = (
            by_height(points) if self._painted is None else by_deviation(self._painted.distance(points))
        )
        self.scene.paint(colouring.pixels)
        self.scene.faint = deviation
        unit = self.tell.unit
        self.tell.legend = [f"{number(x, 3)} {unit}" for x in (colouring.low, colouring.high)]
        self.tell.gradient = colouring.gradient
        self.tell.colouring = "deviation" if deviation else "height"

    def theme(self) -> None:
        """Dark, or light."""
        self.tell.dark = not self.tell.dark
        self.scene.dark(self.tell.dark)
        self.draw()

    def look(self, how: str, *values: float) -> None:
        """Move the camera: "fit", "turn", "zoom" or "pan"."""
        moves: dict[str, Callable[..., None]] = {
            "fit": self.scene.fit,
            "turn": self.scene.turn,
            "zoom": self.scene.zoom,
            "pan": self.scene.pan,
        }
        moves[how](*map(float, values))
        self.draw()
        self.scale()

    def scale(self) -> None:
        """Tell how long the scale bar is, in pixels, and what that is."""
        pixel = self.scene.length_of_pixel()
        length = round_below(110.0 * pixel)
        self.tell.bar, self.tell.bar_text = length / pixel, f"{number(length)} {self.tell.unit}"

    def _resized(self) -> None:
        with self.tell:
            self.scale()

    def say(self, text: str, bad: bool = False) -> None:
        self.tell.hint, self.tell.bad = text, bad

    def right(self) -> None:
        """Something went right: what was wrong before is told no more."""
        if self.tell.bad:
            self.say("" if self.tell.pasting else HINT)

    def refresh(self) -> None:
        """Show the session as it is: ridges, sliders, curves, table."""
        session, tell = self.session, self.tell
        wanted = None if self.feature is None else self.feature.registered
        if tell.colouring == "deviation" and self._painted is not wanted:
            self._paint("deviation")
        names = {f.name for f in session.features if f.shown}
        for name in self._shown - names:
            self.scene.hide_ridge(name)
        for feature in session.features:
            if feature.shown:
                self.scene.show_ridge(feature.name, feature.ridge, feature.name == session.chosen)
        self._shown = names
        tell.ridges = [{"name": f.name, "shown": f.shown} for f in session.features]
        tell.chosen = session.chosen or ""
        tell.can_undo, tell.can_redo = bool(self.history.before), bool(self.history.after)
        self._tell_feature()
        if tell.pasting:
            self.scene.only_part(True)
        self.draw()
        self.scale()

    def _tell_feature(self) -> None:
        feature, tell = self.feature, self.tell
        if feature is None:
            tell.rows, tell.profile, tell.section, tell.place, tell.stretch = [], "", "", -1.0, ""
            self.scene.mark(None, "place")
            return
        ridge = feature.ridge
        self.sizes.tell(feature)
        low, high = feature.between or (0.0, ridge.length)
        tell.stretch = "" if feature.between is None else f"s = {number(low)} to {number(high)} {ridge.unit}"
        tell.earlier = feature.before is not None
        tell.profile = curves.profile(ridge, feature.between)
        tell.rows = [{"name": name, "value": value} for name, value in self._rows(feature)]
        self.pointing.show(feature, self.pointing.place(feature))

    def _rows(self, feature: Feature) -> list[tuple[str, str]]:
        ridge, unit = feature.ridge, feature.ridge.unit
        spans = [(name, f"{number(float(x.min()))} to {number(float(x.max()))} {unit}")
                 for name, x in (("height h", ridge.height), ("width w", ridge.width))]  # fmt: skip
        found = self.found.get(feature.registered)
        return [
            ("kind", kind(ridge)),
            ("length", f"{number(ridge.length)} {unit}"),
            *spans,
            ("section", ridge.section.name),
            ("templates", templates(ridge)),
            *(ends(ridge) if found is None else trust(feature.registered, found)),
        ]

    def triggers(self) -> dict[str, Callable[..., None]]:
        """All that is done at once, by the name that the page calls it."""
        sizes = self.sizes
        own = (
            self.undo, self.redo, self.set_unit, self.choose, self.toggle, self.remove, self.rename,
            self.rest, self.hover, self.away, self.point, self.step, self.colour, self.theme,
            sizes.reset, sizes.stretch, sizes.bound, sizes.whole,
        )  # fmt: skip
        moves = {how: partial(self.look, how) for how in ("fit", "turn", "zoom", "pan")}
        return {**{f.__name__: f for f in own}, **moves, "help": self._help}

    def _help(self) -> None:
        self.tell.help = not self.tell.help
