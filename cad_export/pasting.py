"""Paste: a host solid with a ridge grown out of one of its faces, as a feature that regenerates."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import cadquery as cq
import numpy as np
from numpy.typing import ArrayLike
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape, TopoDS_Solid

from cad_export.carried import record_of
from cad_export.face_base import FaceBase, face_base
from cad_export.geometry import topods
from cad_export.headroom import check_height
from cad_export.host_face import chosen_face, solid_of
from cad_export.inset import InsetReport, inset_at
from cad_export.paste_history import Placement, remember
from cad_export.room import told_if_too_small
from cad_export.site import Site
from cad_export.strip import OffFaceError
from ridgefeature.fitting import FITS
from ridgefeature.folds import folds
from ridgefeature.on_base import surfaces_on
from ridgefeature.ridge import Ridge
from ridgefeature.scan import millimetres_per


def paste(
    ridge: Ridge,
    host: Any,
    face: Any = None,
    path: Any = None,
    at: ArrayLike | None = None,
    direction: ArrayLike | None = None,
    h: float = 1,
    w: float = 1,
    *,
    fit: str = "length",
    scale: float = 1,
    mirror: bool = False,
    reverse: bool = False,
    check: bool = True,
    report: dict[str, Any] | None = None,
    name: str = "ridge",
) -> cq.Solid:
    """The host solid with the ridge grown out of a face; a negative h engraves.

    host: a cq.Solid, a Workplane with one, or anything whose `.wrapped` is a TopoDS_Shape with one solid, in
    millimetres; it is not changed. face: one of its faces, a selector of one such as ">Z", or a Workplane on
    which one is selected; left out, the one nearest to `at` or `path`, or its largest. The ridge's own shape
    is developed onto the face, its bends kept as geodesic curvature: its middle comes to `at` (3,), by
    default the middle of the face, along `direction` (3,). Or it follows `path`, an edge or wire on the face;
    fit tells whether its profile is then stretched ("length"), scaled as a whole ("scale") or cut ("trim"). A
    closed edge makes a ring. h, w: rates. scale: of the whole ridge. mirror: left and right changed; reverse:
    start and end.

    The result has passed a fast certificate: one closed solid, its volume against the surface's own integral,
    edge tolerances, the footprint inside the face; check=True adds OCCT's search for self-intersections and a
    closed mesh. report: filled with method, volumes, largest tolerance and seconds. name: that of the ridge's
    face in STEP files. Raises ValueError that says what to change.
    """
    if fit not in FITS:
        raise ValueError(f"fit: expected one of {', '.join(FITS)}, got {fit!r}; choose one")
    check_rates(h=h, w=w)
    solid, size = solid_of(host), _in_millimetres(_checked(ridge), scale)
    chosen = chosen_face(solid, face, path, at, size)
    by = "face" if face is not None else "host" if at is None else "at"
    lay = partial(_stand, ridge, chosen, path, at, direction, fit, scale, mirror, reverse, w)
    with _fold_told(ridge, path), told_if_too_small(solid, chosen, size if path is None else None, by):
        stand, result, grown, told = _pasted(solid, lay, h, w, check)
    if report is not None:
        report.update(asdict(told))
    options = {"fit": fit, "scale": scale, "mirror": mirror, "reverse": reverse}
    place = Placement(stand.middle, at, direction, path, options, told.volume_added)
    remember(solid, result, grown, record_of(ridge, h, w, name), place)
    return cq.Solid(result)


def _pasted(
    solid: TopoDS_Shape, lay: Callable[..., _Stand], h: float, w: float, check: bool
) -> tuple[_Stand, TopoDS_Solid, TopoDS_Face, InsetReport]:
    """The stand, and what inset_at gives there; lay: lays the ridge on its face, or beyond it."""
    try:
        stand = lay()
        site = _site(solid, stand, h, w)
        return stand, *inset_at(solid, site, h, check)
    except OffFaceError as error:
        with _instead(error):  # other faces may go on from this one
            stand = lay(beyond=True)
        site = _site(solid, stand, h, w)  # what it says of h and w holds on any face
        with _instead(error):
            return stand, *inset_at(solid, site, h, check)


@contextmanager
def _fold_told(ridge: Ridge, path: Any) -> Iterator[None]:
    """Where a ridge that folds over itself cannot be pasted along its own shape, that is told, too."""
    try:
        yield
    except ValueError as error:
        found = folds(ridge) if path is None else ()
        if not found:
            raise
        where = ", ".join(f"{low:.4g} to {high:.4g}" for low, high in found)
        raise ValueError(
            f"ridge: it folds over itself at arc length {where} {ridge.unit}; cut it there first, by "
            f'ridge.stretched(length, "trim"). What came of it: {error}'
        ) from error


@dataclass(frozen=True, eq=False)
class _Stand:
    """A ridge on the base of one place of a host's face, and what identified them, held."""

    held: tuple[Any, ...]
    face: TopoDS_Face
    base: FaceBase
    ridge: Ridge
    sites: dict[float, tuple[Ridge, Site]] = field(default_factory=dict)

    def site(self, h: float, w: float) -> tuple[Ridge, Site]:
        """The ridge at rate w, and the site for all h, since a surface is affine in its height."""
        self.ridge.resized(h=h, w=w)  # refuses rates that are none
        if w not in self.sites:
            ridge = self.ridge.resized(w=w)
            surface, base = surfaces_on(self.base, ridge, ridge.section)
            # The border of the flanks stays at all widths, and with it what is left of the face.
            like = next((site.like or site for _, site in self.sites.values()), None)
            self.sites[w] = ridge, Site(self.face, surface, base, like=like)
            while len(self.sites) > _KEPT_WIDTHS:
                self.sites.pop(next(iter(self.sites)))
        return self.sites[w]

    @cached_property
    def middle(self) -> tuple[float, float, float]:
        """The point of the face under the middle of the ridge."""
        x, y, z = self.base(np.array([0.5 * self.base.length]), np.zeros((1, 1)))[0][0, 0].tolist()
        return x, y, z


_STANDS: OrderedDict[tuple[Any, ...], _Stand] = OrderedDict()
_KEPT_WIDTHS = 4
_KEPT = 16
"""Stands that are remembered: a slider pastes again and again at one place."""


def _stand(
    ridge: Ridge,
    face: TopoDS_Face,
    path: Any,
    at: ArrayLike | None,
    direction: ArrayLike | None,
    fit: str,
    scale: float,
    mirror: bool,
    reverse: bool,
    w: float,
    beyond: bool = False,
) -> _Stand:
    """The ridge on the face's base along the path, remembered: one for all w, unless flanks are narrowed."""
    along = None if path is None else topods(path)
    held = (ridge, face.TShape(), along and along.TShape())
    places = [repr(None if value is None else np.asarray(value).tolist()) for value in (at, direction)]
    locations = [shape and shape.Location().HashCode() for shape in (face, along)]
    key = (*map(id, held), face.Orientation(), *locations, *places, fit, scale, mirror, reverse, beyond)

    def stand(rate: float) -> _Stand:
        if (*key, rate) not in _STANDS:
            base, fitted = face_base(
                face,
                _in_millimetres(ridge, scale),
                path=path,
                at=at,
                direction=direction,
                fit=fit,
                mirror=mirror,
                reverse=reverse,
                w=rate,
                beyond=beyond,
            )
            _STANDS[(*key, rate)] = _Stand(held, face, base, fitted)
            while len(_STANDS) > _KEPT:
                _STANDS.popitem(last=False)
        return _STANDS[(*key, rate)]

    own = isinstance(w, (int, float)) and 0 < w < np.inf and w != 1
    try:
        found = stand(1.0)
    except ValueError:
        if own and w < 1:  # flanks may be narrower for a narrower ridge
            return stand(float(w))
        raise
    return stand(float(w)) if own and found.base.slim else found


def check_rates(**rates: object) -> None:
    """Raise ValueError for rates that are no numbers, under their names."""
    for name, rate in rates.items():
        if isinstance(rate, bool) or not isinstance(rate, (int, float, np.integer, np.floating)):
            raise ValueError(f"{name}: expected a number, a rate, got {rate!r}; 1 leaves the ridge as it is")


def _site(solid: TopoDS_Shape, stand: _Stand, h: float, w: float) -> Site:
    """The site for these rates, which the place has room for."""
    ridge, site = stand.site(h, w)
    check_height(solid, stand.base, ridge, h)
    return site


@contextmanager
def _instead(error: ValueError) -> Iterator[None]:
    """Raise this error for any ValueError inside."""
    try:
        yield
    except ValueError:
        raise error from None


def _checked(ridge: Any) -> Ridge:
    if not isinstance(ridge, Ridge):
        raise ValueError(f"ridge: expected a Ridge, got {type(ridge).__name__}; register or load one first")
    return ridge


def _in_millimetres(ridge: Ridge, scale: float) -> Ridge:
    """The same ridge, `scale` times as large, in the unit of CAD shapes."""
    if not (isinstance(scale, (int, float)) and np.isfinite(scale) and scale > 0):
        raise ValueError(f"scale: expected a finite number above 0, got {scale!r}")
    factor = scale * millimetres_per(ridge.unit)
    if factor == 1:
        return ridge
    lengths = ("arc_length", "spine", "height", "width", "border")
    stds = ("height_std", "width_std", "half_height_width_std", "spine_std")
    scaled = {name: factor * getattr(ridge, name) for name in lengths + stds}
    return replace(ridge, unit="mm", curvature=ridge.curvature / factor, end_interval=None, **scaled)
