"""What is open on the page: ridges by name, their rates, and the way back to what was before."""

from __future__ import annotations

import math
import time
from collections import Counter
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count

import numpy as np
from numpy.typing import NDArray

from ridgefeature.curvilinear import local_coordinates
from ridgefeature.medians import median
from ridgefeature.ridge import Ridge

Array = NDArray[np.float64]
LEAST, MOST = 0.2, 3.0
"""Rates of height and width that sliders reach."""
_PLACES, _MOST_OF_IT = 20, 0.8
"""Places of a ridge that are looked at, and the share of them that lie on another where that is the same."""
_AS_WIDE = 1.5
"""How many times as wide it may be."""
PAUSE = 1.0
"""Seconds between two changes of one value after which they are two steps."""
_ON = 0.4
"""Distance from a spine, in widths, up to which a place is on its ridge."""


@dataclass(frozen=True, eq=False)
class Feature:
    """A registered ridge and how it was changed."""

    name: str
    registered: Ridge
    pick: tuple[float, float, float]
    h: float = 1.0
    w: float = 1.0
    between: tuple[float, float] | None = None
    """Arc lengths between which the rates hold; None: along the whole ridge."""
    shown: bool = True
    before: Ridge | None = None
    """What the rates are of: as it was changed along other stretches; None: as registered."""

    @property
    def begun(self) -> Ridge:
        """The ridge at rates of 1."""
        return self.registered if self.before is None else self.before

    @cached_property
    def ridge(self) -> Ridge:
        """As it is with these rates. Raises ValueError where one is more than there is room for."""
        if (self.h, self.w) == (1.0, 1.0):
            return self.begun
        return self.begun.resized(h=self.h, w=self.w, between=self.between)

    def along(self, between: tuple[float, float] | None) -> Feature:
        """The same ridge, whose rates from now on hold between other arc lengths, all along if None."""
        before = None if self.ridge is self.registered else self.ridge
        return replace(self, h=1.0, w=1.0, between=between, before=before)


@dataclass(frozen=True, eq=False)
class Session:
    """The ridges of one scan, and which of them is chosen; every change is a new one."""

    features: tuple[Feature, ...] = ()
    chosen: str | None = None

    def __getitem__(self, name: str) -> Feature:
        for feature in self.features:
            if feature.name == name:
                return feature
        raise ValueError(
            f"ridge: expected one of {', '.join(f.name for f in self.features) or 'none'}, got {name!r}; "
            "choose one of them"
        )

    def at(self, place: Array) -> str | None:
        """The name of a ridge that is shown and has this place (3,) of the scan between its feet."""
        for feature in reversed(self.features):
            ridge = feature.registered
            s, y, z = (float(x[0]) for x in local_coordinates(ridge, place[None]))
            half, high = (
                float(np.interp(s, ridge.arc_length, np.abs(x))) for x in (ridge.width, ridge.height)
            )
            if feature.shown and 0.0 <= s <= ridge.length and abs(y) < _ON * half and abs(z) < 2.0 * high:
                return feature.name
        return None

    def again(self, ridge: Ridge) -> str | None:
        """The name of a ridge that is shown and runs along most of this one: it was found a second time."""
        middles = ridge.spine + 0.5 * ridge.height[:, None] * ridge.normal
        at = np.linspace(0, len(middles) - 1, _PLACES + 2).astype(int)[1:-1]
        name, count = Counter(self.at(place) for place in middles[at]).most_common(1)[0]
        if name is None or count <= _MOST_OF_IT * _PLACES:
            return None
        known = self[name].registered
        wider = median(ridge.width) / median(known.width)
        return name if ridge.groove == known.groove and 1 / _AS_WIDE < wider < _AS_WIDE else None

    def added(self, registered: Ridge, pick: tuple[float, float, float]) -> Session:
        """With one more ridge, chosen, by the first free name."""
        taken = {f.name for f in self.features}
        what = "groove" if registered.groove else "ridge"
        name = next(n for n in (f"{what} {k}" for k in count(1)) if n not in taken)
        return Session((*self.features, Feature(name, registered, pick)), name)

    def changed(self, name: str, /, **values: object) -> Session:
        """With other values of one ridge. Raises ValueError where a rate is out of reach, or of room."""
        for rate in ("h", "w"):
            value = float(str(values.get(rate, 1.0)))
            if not LEAST <= value <= MOST:
                got = "no number" if math.isnan(value) else f"{value:g}"
                raise ValueError(
                    f"{rate}: expected a rate from {LEAST:g} to {MOST:g}, got {got}; give another"
                )
        return self._with(name, replace(self[name], **values))  # type: ignore[arg-type]

    def along(self, name: str, between: tuple[float, float] | None) -> Session:
        """With one ridge's rates at 1 between other arc lengths; what was changed before stays."""
        return self._with(name, self[name].along(between))

    def _with(self, name: str, new: Feature) -> Session:
        new.ridge.surface()  # raises where there is none
        return replace(self, features=tuple(new if f.name == name else f for f in self.features))

    def renamed(self, name: str, to: str) -> Session:
        """With another name for one ridge. Raises ValueError where it is empty or taken."""
        to = to.strip()
        if not to:
            raise ValueError("name: expected one, got none; give another")
        if to != name and any(f.name == to for f in self.features):
            raise ValueError(f"name: expected one that no other ridge has, got {to!r}; give another")
        changed = self.changed(name, name=to)
        return replace(changed, chosen=to if self.chosen == name else self.chosen)

    def without(self, name: str) -> Session:
        """Without one ridge; the one before it is chosen then."""
        at = self.features.index(self[name])
        left = self.features[:at] + self.features[at + 1 :]
        if self.chosen != name:
            return Session(left, self.chosen)
        return Session(left, left[max(at - 1, 0)].name if left else None)

    def choosing(self, name: str | None) -> Session:
        """With another one chosen, or none."""
        return replace(self, chosen=None if name is None else self[name].name)


@dataclass
class History:
    """Sessions before and after the one at hand. Steps of one kind in a row, as of a slider, are one, unless
    there is a pause between them."""

    now: Session = field(default_factory=Session)
    before: list[Session] = field(default_factory=list)
    after: list[Session] = field(default_factory=list)
    _kind: str = ""
    _when: float = 0.0

    def do(self, session: Session, kind: str = "") -> None:
        """Go on to a session; kind: of the step, "" for one that stands for itself."""
        now = time.monotonic()
        if not kind or kind != self._kind or now - self._when > PAUSE:
            self.before.append(self.now)
        self._kind, self._when = kind, now
        self.now = session
        self.after.clear()

    def undo(self) -> bool:
        """Go back one step; whether there was one."""
        return self._step(self.before, self.after)

    def redo(self) -> bool:
        """Take back an undo; whether there was one."""
        return self._step(self.after, self.before)

    def _step(self, source: list[Session], target: list[Session]) -> bool:
        if not source:
            return False
        target.append(self.now)
        self.now, self._kind = source.pop(), ""
        return True
