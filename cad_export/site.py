"""Where a ridge is set into a face of a host: all of it that does not depend on the height. OCP only."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from OCP.Geom import Geom_Curve
from OCP.Geom2d import Geom2d_BSplineCurve
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Face, TopoDS_Wire

from cad_export.certificate import Ground, ground_under
from cad_export.end_caps import Lift, lifts
from cad_export.footprint import (
    OnHost,
    occt_curve,
    on_host,
    seams_of,
    segments_of,
    surface_on,
    wires_of,
)
from cad_export.polylines import cross, inside, meetings, signed_area
from cad_export.volume_by_height import VolumeByHeight
from ridgefeature.bspline import Curve, Surface

Floats = NDArray[np.float64]

ON_HOST = 1e-4
"""The border may lie off the host's face by this part of its own breadth."""
LIFT = 3e-7
"""A row less than this part of the breadth off the base counts as on it: there edges are shared."""


class SeamError(ValueError):
    """The footprint runs over a seam or the outline of the face."""


@dataclass(frozen=True, eq=False)
class Line:
    """A side or an end of the footprint: its curve on the base, in space and in the face's parameters.

    forward: whether it is gone along with its own parameter, round the surface. off: its distance from the
    face.
    """

    curve: Curve
    space: Geom_Curve
    flat: Geom2d_BSplineCurve
    off: float
    forward: bool


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed border on the face: its lines in the order round the surface, and a polyline of parameters."""

    lines: tuple[Line, ...]
    polyline: Floats


@dataclass(frozen=True, eq=False)
class Division:
    """The face's own wires around the footprint, those within a ring, and which loop is the outer one."""

    kept: tuple[TopoDS_Wire, ...]
    island: tuple[TopoDS_Wire, ...]
    outer: int


@dataclass(frozen=True, eq=False)
class Site:
    """A place on a face for a surface that grows from a base; worked out once, for all heights.

    face: as the host holds it, oriented outwards. surface: for height 1; base: for 0, same knots and borders,
    which lie on the face (to ON_HOST of the breadth). du x dv points away from the material.
    """

    face: TopoDS_Face
    surface: Surface
    base: Surface
    _lifts: dict[tuple[int, float], list[Lift]] = field(default_factory=dict, repr=False)
    like: Site | None = None
    """A site with the same border on the same face, for another width: it is asked for what they share."""

    def __post_init__(self) -> None:
        for a in (self.surface, self.base):
            for knots, degree in ((a.knots_u, a.degree_u), (a.knots_v, a.degree_v)):
                if knots[0] != knots[degree] or knots[-1] != knots[-degree - 1]:
                    raise ValueError("surface: expected clamped knots, got open ends; repeat the end knots")
        for one, other in (
            (self.surface.knots_u, self.base.knots_u),
            (self.surface.knots_v, self.base.knots_v),
        ):
            if not np.array_equal(one, other):
                raise ValueError(
                    "base: expected the knots of the surface, got others; make both from one ridge"
                )
        gap = max(np.abs(self.surface.poles[:, k] - self.base.poles[:, k]).max() for k in (0, -1))
        if gap > 1e-9 * self.base.size:
            raise ValueError(
                f"base: expected borders of the surface, they are {gap:.3g} apart; make both from one ridge"
            )

    def at(self, h: float) -> Surface:
        """The surface at a height."""
        return self.surface if h == 1 else replace(self.base, poles=self.base.poles + h * self._rise)

    def lifts(self, end: int, h: float) -> list[Lift]:
        """Where the surface at h is off the base, at its first (end = 0) or last (end = -1) row.

        Looked for at the power of 2 below h, where a row less than `_least` off counts as on the base.
        """
        if h == 0:
            return []
        octave = math.copysign(2.0 ** math.floor(math.log2(abs(h))), h)
        if (end, octave) not in self._lifts:
            line = self._end_line(end)
            row = replace(line.curve, poles=line.curve.poles + octave * self._rise[end])
            self._lifts[end, octave] = lifts(row, line.curve, self._least(line))
        return [lift.times(h / octave) for lift in self._lifts[end, octave]]

    def gap(self, end: int, h: float) -> float:
        """How far the row may be off the base where it counts as on it."""
        highest = float(np.linalg.norm(self._rise[end], axis=1).max())
        return min(2 * self._least(self._end_line(end)), abs(h) * highest)

    def _end_line(self, end: int) -> Line:
        return self.loops[0].lines[1 if end else 3]

    def _least(self, line: Line) -> float:
        # Edges closer than their tolerances would count as crossing: a cap ends where it is that thin.
        return max(LIFT * self.breadth, 4 * line.off)

    @cached_property
    def _rise(self) -> Floats:
        return np.asarray(self.surface.poles - self.base.poles)

    @cached_property
    def ground(self) -> Ground:
        """What is left of the face beside the footprint."""
        return self.like.ground if self.like else ground_under(self.base)

    @cached_property
    def volume(self) -> VolumeByHeight:
        """The volume under the surface."""
        return VolumeByHeight(self.surface, self.base)

    @cached_property
    def breadth(self) -> float:
        """Distance between the borders of the flanks, the largest."""
        return float(np.linalg.norm(self.base.poles[:, 0] - self.base.poles[:, -1], axis=1).max())

    @cached_property
    def loops(self) -> tuple[Loop, ...]:
        """The border: one loop, in the order side, end, side, start; of a ring two, a side each.

        Raises ValueError where it is off the face or winds round it.
        """
        host = surface_on(self.face)
        sides = self._side(0), self._side(-1)
        rounds = [[side] for side in sides]
        if not self.base.closed[0]:
            rounds = [[sides[0], self._end(-1), sides[1], self._end(0)]]
        made = []
        for parts in rounds:
            found: list[OnHost] = []
            for curve, span, forward in parts:
                at = found[-1].polyline[-1] if found else None
                found.append(on_host(host, curve, span, at, forward))
                self._check_distance(found[-1].distance)
            gap = np.abs(found[-1].polyline[-1] - found[0].polyline[0])
            if any(p and g > 0.5 * p for p, g in zip(host.periods, gap, strict=True)):
                raise SeamError("surface: expected a border that closes on the face, it winds round it")
            line = np.concatenate([f.polyline[:-1] for f in found])
            shift = self._shift(line, host.periods)
            flats = [f.flat for f in found]
            if shift.any():
                flats = [replace(flat, poles=flat.poles + shift) for flat in flats]
            lines = (
                Line(curve, occt_curve(curve), occt_curve(flat), f.distance, forward)
                for (curve, _, forward), flat, f in zip(parts, flats, found, strict=True)
            )
            made.append(Loop(tuple(lines), line + shift))
        if self.like is None:
            _check_crossings([loop.polyline for loop in made])
        return tuple(made)

    @cached_property
    def division(self) -> Division:
        """How the loops divide the face; ValueError where they leave it or meet holes and earlier ridges."""
        if self.like is not None:
            return self.like.division
        loops = [self._as_hole(loop.polyline) for loop in self.loops]
        areas = [signed_area(loop) for loop in loops]
        outer = int(np.argmax(np.abs(areas)))
        if areas[outer] > 0:
            raise ValueError(
                "surface: expected du x dv away from the host's material, "
                "it points inwards; turn the surface round"
            )
        seams = seams_of(self.face)
        if len(seams) and any(cross(_pieces_of(loop), seams) for loop in loops):
            raise SeamError("surface: expected a border clear of the face's seam, it runs over it")
        lines = [_pieces_of(loop) for loop in loops]
        around = np.concatenate(lines)
        island = []
        for k, (wire, segments) in enumerate(self.own):
            if cross(around, segments):
                if k == 0:
                    raise SeamError(
                        "surface: expected a border within the face, it leaves the face's outline"
                    )
                raise ValueError(
                    "surface: expected a border clear of holes and earlier ridges, it overlaps one; "
                    "move the path"
                )
            if k and inside(segments[:1, 0], lines[outer])[0]:
                if len(loops) == 1 or inside(segments[:1, 0], around)[0]:
                    raise ValueError(
                        "surface: expected a footprint clear of holes and earlier ridges, it covers one; "
                        "move the path"
                    )
                island.append(wire)
        if not inside(loops[outer][:1], np.concatenate([segments for _, segments in self.own]))[0]:
            raise ValueError("surface: expected a border within the face, it lies outside; move the path")
        kept = tuple(wire for wire, _ in self.own if not any(wire.IsSame(other) for other in island))
        return Division(kept, tuple(island), outer)

    @cached_property
    def own(self) -> list[tuple[TopoDS_Wire, Floats]]:
        """The face's own wires, the outer one first, and straight pieces along them."""
        if self.like is not None:
            return self.like.own
        return [(wire, segments_of(wire, self.face)) for wire in wires_of(self.face)]

    @property
    def flipped(self) -> bool:
        """Whether the face is turned against its surface."""
        return bool(self.face.Orientation() == TopAbs_REVERSED)

    def _as_hole(self, line: Floats) -> Floats:
        """A polyline round the surface in the sense in which the face has it as a hole."""
        return line if self.flipped else line[::-1]

    def _side(self, k: int) -> _Part:
        s = self.base
        return Curve(s.poles[:, k], s.knots_u, s.degree_u), s.domain[0], k == 0

    def _end(self, k: int) -> _Part:
        s = self.base
        return Curve(s.poles[k], s.knots_v, s.degree_v), s.domain[1], k != 0

    def _check_distance(self, distance: float) -> None:
        if not distance <= ON_HOST * self.breadth:
            raise ValueError(
                f"surface: expected a border on the face to {ON_HOST * self.breadth:.3g}, it is "
                f"{distance:.3g} off; make the surface on this face"
            )

    def _shift(self, line: Floats, periods: tuple[float, float]) -> Floats:
        """Whole periods by which a loop is moved to lie among the face's own parameters."""
        if not any(periods):
            return np.zeros(2)
        centre = 0.5 * (line.min(axis=0) + line.max(axis=0))
        period = np.array(periods)
        return period * np.round((self._middle - centre) / np.where(period > 0, period, np.inf))

    @cached_property
    def _middle(self) -> Floats:
        """(2,) the middle of the face's own parameters."""
        if self.like is not None:
            return self.like._middle
        own = np.concatenate([segments for _, segments in self.own])
        return np.asarray(0.5 * (own.min(axis=(0, 1)) + own.max(axis=(0, 1))))


_Part = tuple[Curve, tuple[float, float], bool]


def _pieces_of(line: Floats) -> Floats:
    return np.stack([line, np.roll(line, -1, axis=0)], axis=1)


def _check_crossings(loops: list[Floats]) -> None:
    """Raise ValueError where the border crosses itself."""
    lines = [_pieces_of(loop[:: 1 + len(loop) // 200]) for loop in loops]
    for k, line in enumerate(lines):
        i = np.arange(len(line))
        apart = np.abs(i[:, None] - i)
        meet = meetings(line, line) & (apart > 1) & (apart < len(line) - 1)
        if meet.any() or any(cross(line, other) for other in lines[:k]):
            raise ValueError("surface: expected a border that does not cross itself, it does; move the path")
