"""The ridge feature: stations with height and width, from which its surface is regenerated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ridgefeature.base import Base, RuledBase, registered_base
from ridgefeature.bspline import Surface
from ridgefeature.fitting import check_widths, stretched
from ridgefeature.medians import median
from ridgefeature.merge import along, merged_surface
from ridgefeature.on_base import surface_on
from ridgefeature.scan import Scan, Source
from ridgefeature.section import Section
from ridgefeature.settings import Settings
from ridgefeature.stations import Stations
from ridgefeature.template import Template

Array = NDArray[np.float64]
Profile = float | Callable[[Array], ArrayLike]


@dataclass(frozen=True, eq=False)
class Ridge(Stations):
    """A registered ridge. It holds what was found; shape is derived from it.

    Lengths in the unit of the scan, coordinates in its frame, k stations evenly spaced in arc length.
    `height` is the apex over the base; `width` the distance between the feet, where the section meets the
    base; `half_height_width` the full width at half height. The `_std` are one standard deviation. `closed`
    tells whether the ridge is a ring, whose last station is the first again; `stop` why each end stopped, in
    words, of a ring "closed". `end_interval` (2, 2): arc lengths between which each end is, to 95 %; below 0
    or above the length where it may lie further out; NaN where it was not looked for, None if neither was.
    """

    section: Section
    templates: tuple[Template, ...]
    stop: tuple[str, str]
    closed: bool = False
    unit: str = "mm"
    pick: Array = field(default_factory=lambda: np.zeros(3))
    settings: Settings = field(default_factory=Settings)
    source: Source | None = None
    end_interval: Array | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for f in fields(Stations):
            array = getattr(self, f.name)
            if array.flags.writeable:
                array = np.array(array, dtype=np.float64)
                array.setflags(write=False)
                object.__setattr__(self, f.name, array)

    @property
    def half_height_width(self) -> Array:
        """(k,) full width at half height."""
        return self.width * self.section.half_height_width

    @property
    def across(self) -> Array:
        """(k, 3) unit vectors to the left of the path, square to tangent and normal."""
        return np.cross(self.normal, self.tangent)

    @property
    def length(self) -> float:
        """Arc length of the whole ridge."""
        return float(self.arc_length[-1])

    @property
    def groove(self) -> bool:
        """Whether it is a groove: its height is below 0 along most of it."""
        return bool(median(self.height) < 0)

    @property
    def _meets_itself(self) -> bool:
        """Whether the last station is the first again: a ring where it was registered, not only on a base."""
        names = ("spine", "tangent", "normal", "height", "width", "border")
        return self.closed and all(np.array_equal(x[0], x[-1]) for x in (getattr(self, n) for n in names))

    @cached_property
    def _base(self) -> RuledBase:
        """What it was registered on. A resized ridge has the same, whose rows and columns are then known."""
        return registered_base(self)

    @cached_property
    def _surface(self) -> Surface:
        if self.curvature.any():
            return surface_on(self._base, self, self.section)
        sizes = self.height, self.width, self.border
        path = self.arc_length, self.spine, self.across, self.normal
        return merged_surface(*path, *sizes, self.section, self._meets_itself)

    def surface(self, base: Base | None = None) -> Surface:
        """The finished surface, C2 and bicubic: u is arc length, v the distance from the spine in widths.

        On a base (see ridgefeature.base), the ridge stands on that: the spine and both feet lie on it, and
        heights are along its normals. Without one it stands on the base it was registered on. Poles depend on
        base and stations alone; for the same stations they are affine in height, on a registered base that is
        flat across in width, too. Raises ValueError for a base of another length, for which `stretched` fits
        the ridge, or one that gives no finite points.
        """
        return self._surface if base is None else surface_on(base, self, self.section)

    def stretched(self, length: float, fit: str = "length") -> Ridge:
        """A ridge of another arc length, its stations even along it; standard deviations follow.

        fit: "length" stretches path and profile along and keeps height, width and border; "scale" scales
        them too; "trim" cuts the ridge at that length. Templates stay as they were fitted. Raises ValueError
        for a length that is not above 0, another fit, or a length to trim to that is beyond the ridge's.
        """
        return stretched(self, length, fit)

    def resized(
        self,
        h: float | None = None,
        w: float | None = None,
        *,
        height: Profile | None = None,
        width: Profile | None = None,
        between: tuple[float, float] | None = None,
    ) -> Ridge:
        """The ridge with other heights or widths; the border of its flanks stays.

        h, w: rates, 1 = as it is; a negative h makes a groove. height, width: absolute, a number or a
        function of arc length (k,) -> (k,). between: arc lengths (s0, s1) of the stretch that changes,
        blended smoothly inside it over a third of the stretch or one width, whichever is less; on a ring s1
        may lie beyond the length, then the stretch runs over the seam. Standard deviations follow; that of a
        height made 0 is 0. Raises ValueError for both a rate and an absolute value, values that are not
        finite or of a ring differ at both ends, w or width not above 0, a width too large for the flanks, or
        a stretch that is not on the ridge.
        """
        blend = self._blend(between)
        new_height, height_rate = self._changed("height", "h", self.height, h, height, blend)
        new_width, width_rate = self._changed("width", "w", self.width, w, width, blend)
        check_widths(self, new_width, w, blend)
        rates = {"height_std": np.abs(height_rate), "width_std": width_rate}
        rates["half_height_width_std"] = width_rate
        stds: dict[str, Any] = {name: _times(getattr(self, name), rate) for name, rate in rates.items()}
        ridge = replace(self, height=new_height, width=new_width, **stds)
        ridge.__dict__["_base"] = self._base
        return ridge

    def _changed(
        self,
        name: str,
        rate_name: str,
        old: Array,
        rate: float | None,
        absolute: Profile | None,
        blend: Array,
    ) -> tuple[Array, Array]:
        """New values and their local rates."""
        ring = self.closed and old[0] == old[-1]
        if rate is not None and absolute is not None:
            raise ValueError(
                f"expected either the rate {rate_name} or the absolute {name}, got both; drop one"
            )
        if absolute is not None:
            wanted = absolute(self.arc_length) if callable(absolute) else absolute
            values = _finite(wanted, name)
            if values.shape not in ((), old.shape):
                raise ValueError(
                    f"{name}: expected one number or {old.size}, one a station, got shape {values.shape}"
                )
            goal = np.broadcast_to(values, old.shape)
            if ring and abs(goal[0] - goal[-1]) > 1e-9 * np.abs(goal).max():
                raise ValueError(
                    f"{name}: expected the same value at both ends of a closed ridge, got {goal[0]:g} at 0 "
                    f"and {goal[-1]:g} at {self.length:g}; give a function that repeats"
                )
        elif rate is not None:
            goal = old * float(_finite(rate, rate_name, ()))
        else:
            return old, np.ones_like(old)
        new = old + blend * (goal - old)
        if ring:
            new[-1] = new[0]
        return new, np.divide(new, old, out=np.ones_like(old), where=old != 0)

    def _blend(self, between: tuple[float, float] | None) -> Array:
        if between is None:
            return np.ones_like(self.arc_length)
        low, high = (float(x) for x in _finite(between, "between", (2,)))
        longest = self.length * (1 + 1e-12)
        if not (0 <= low < high and (high - low if self.closed else high) <= longest and low <= longest):
            limit = "s1 <= s0 + " if self.closed else "s1 <= "
            raise ValueError(
                f"between: expected 0 <= s0 < {limit}{self.length:g}, the ridge's arc length, "
                f"got ({low:g}, {high:g})"
            )
        at = self.arc_length
        if self.closed:
            if high - low >= self.length:
                return np.ones_like(at)
            at = low + (at - low) % self.length
        inside = (at > low) & (at < high)
        if inside.sum() < 3:
            step = float(self.arc_length[1])
            raise ValueError(
                f"between: expected a stretch of three stations or more, which are {step:.4g} apart, "
                f"got {high - low:.4g}; choose a longer one"
            )
        ramp = min((high - low) / 3, median(self.width))
        # An end of the ridge needs no ramp: there is nothing beyond it to blend with.
        rise = 1.0 if low <= 0 and not self.closed else np.clip((at - low) / ramp, 0, 1)
        fall = 1.0 if high >= self.length and not self.closed else np.clip((high - at) / ramp, 0, 1)
        x = np.minimum(rise, fall) * np.ones_like(at)
        return x**3 * (10 - 15 * x + 6 * x * x)

    def section_at(self, s: float, n: int = 101, h: float = 1.0, w: float = 1.0) -> Array:
        """Points (n, 2) across the finished surface at arc length s: y to the left and z up.

        In the station's frame, from border to border, with the rates h and w applied. Raises ValueError for s
        off the ridge or n < 2.
        """
        if not 0 <= float(_finite(s, "s", ())) <= self.length * (1 + 1e-12):
            raise ValueError(f"s: expected an arc length from 0 to {self.length:g}, got {s:g}")
        if n < 2:
            raise ValueError(f"n: expected at least 2 points, got {n}")
        ridge = self if h == 1 and w == 1 else self.resized(h, w)
        surface = ridge.surface()
        v = np.linspace(*surface.domain[1], n)
        at = np.array([min(float(s), self.length)])
        points = surface(at, v)
        origin, tangent, normal = (
            along(self.arc_length, x, at, closed=self._meets_itself)[0]
            for x in (self.spine, self.tangent, self.normal)
        )
        left = np.cross(normal, tangent)
        left /= np.linalg.norm(left)
        up = np.cross(tangent, left)
        up /= np.linalg.norm(up)
        return np.column_stack([(points - origin) @ left, (points - origin) @ up])

    def distance(self, scan: Scan | ArrayLike) -> Array:
        """Signed distance (n,) of scan points to the finished surface, positive on the side of the normal.

        NaN for points whose foot lies beyond the surface's border, and for points that are NaN.
        """
        points = np.asarray(scan.points if isinstance(scan, Scan) else scan, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise ValueError(f"scan: expected points of shape (n, 3), got shape {points.shape}")
        return self.surface().project(points)[2]

    def save(self, path: Any) -> None:
        """Write the feature as versioned JSON, exact to the last bit. Raises OSError where it cannot."""
        from ridgefeature.io.feature import write_feature

        write_feature(self, path)

    def summary(self) -> dict[str, Any]:
        """Figures of the ridge as plain numbers and words, for a table or for JSON."""
        return {
            "unit": self.unit,
            "groove": self.groove,
            "length": self.length,
            "templates": len(self.templates),
            "height_min": float(self.height.min()),
            "height_max": float(self.height.max()),
            "width_min": float(self.width.min()),
            "width_max": float(self.width.max()),
            "half_height_width_min": float(self.half_height_width.min()),
            "half_height_width_max": float(self.half_height_width.max()),
            "section": self.section.name,
            "closed": self.closed,
            "stop_start": self.stop[0],
            "stop_end": self.stop[1],
            "noise": median([t.scale for t in self.templates]),
            "M": float(np.mean([t.M for t in self.templates])),
            "M_floor": float(np.mean([t.M_floor for t in self.templates])),
            "settings": asdict(self.settings),
        }


def _times(std: Array, rate: Array) -> Array:
    """Standard deviations at local rates: of a value that was made 0 it is 0, also where it was infinite."""
    return np.multiply(std, rate, out=np.zeros_like(rate), where=rate != 0)


def _finite(value: Any, name: str, shape: tuple[int, ...] | None = None) -> Array:
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if shape is not None and array.shape != shape and np.isfinite(array).all():
        what = "one number" if shape == () else f"{shape[0]} numbers"
        raise ValueError(f"{name}: expected {what}, got {value!r}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: expected finite numbers, got {value!r}")
    return array
