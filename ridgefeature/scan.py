"""The scan: unordered points in one length unit, checked once."""

import math
import warnings
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ridgefeature.kernels import validate

MIN_POINTS = 16
"""A scan has at least this many distinct points."""

MILLIMETRES = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1e3, "km": 1e6, "in": 25.4, "ft": 304.8}
"""The length units a scan may have, and the millimetres in each."""

# Points that leave a line by less than this part of their extent make no surface. So small because
# one wild point, such as a scanner's mark for "no echo", may stretch the extent a millionfold.
LINE_TOLERANCE = 1e-9

Array = NDArray[np.float64]


def millimetres_per(unit: str) -> float:
    """Millimetres in one `unit`: "um", "mm", "cm", "m", "km", "in" or "ft".

    Raises ValueError for any other unit.
    """
    if not isinstance(unit, str) or unit not in MILLIMETRES:
        raise ValueError(f"expected a length unit out of {', '.join(MILLIMETRES)}; got {unit!r}")
    return MILLIMETRES[unit]


@dataclass(frozen=True)
class Source:
    """The file a scan was read from: its name without folder, and the SHA-256 of its bytes in hex."""

    name: str
    sha256: str


@dataclass(frozen=True, eq=False, repr=False)
class Scan:
    """Points of a 3D scan.

    points: (n, 3) float64, C-contiguous, read-only. An array that is so already is shared, not copied:
        do not change it afterwards.
    unit: length unit of the points, one of `MILLIMETRES`.
    source: the file it came from, if any.

    Rows with NaN or inf are dropped with a UserWarning. Raises ValueError unless at least 16 distinct
    points remain that do not lie on one line.
    """

    points: Array
    unit: str = "mm"
    source: Source | None = None
    _bounds: Array = field(init=False)

    def __post_init__(self) -> None:
        millimetres_per(self.unit)
        if self.source is not None and not isinstance(self.source, Source):
            raise ValueError(f"expected source to be a Source or None; got {type(self.source).__name__}")
        points, bounds = _checked(_rows(self.points))
        points.flags.writeable = False
        bounds.flags.writeable = False
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "_bounds", bounds)

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        origin = f", from {self.source.name}" if self.source else ""
        return f"Scan({len(self)} points in {self.unit}{origin})"

    @property
    def bounds(self) -> Array:
        """Lowest and highest coordinates: (2, 3), read-only."""
        return self._bounds

    def crop(self, at: ArrayLike, radius: float) -> "Scan":
        """The scan's points within `radius` of the point `at` (3,), in the scan's unit and order.

        Raises ValueError if these are too few or too flat to be a scan.
        """
        centre = _point(at)
        if not _is_number(radius) or not 0 < radius <= validate.LARGEST:
            raise ValueError(f"expected a radius above 0, in {self.unit}; got {radius!r}")
        count, nearest = validate.ball_count(self.points, centre, float(radius))
        place = f"within {radius:g} {self.unit} of ({centre[0]:g}, {centre[1]:g}, {centre[2]:g})"
        if count < MIN_POINTS:
            raise ValueError(
                f"expected at least {MIN_POINTS} scan points {place}, found {count}; the nearest point is "
                f"{nearest:.6g} {self.unit} away: take a larger radius or a point on the scan"
            )
        try:
            return Scan(
                validate.ball_points(self.points, centre, float(radius), count), self.unit, self.source
            )
        except ValueError as error:
            raise ValueError(f"the points {place} will not do: {error}") from error


def as_scan(points_or_scan: "Scan | ArrayLike", unit: str = "mm") -> Scan:
    """A Scan from an (n, 3) array of points in `unit`; a Scan passes through with its own unit.

    Raises ValueError as `Scan` does.
    """
    if isinstance(points_or_scan, Scan):
        return points_or_scan
    return Scan(points_or_scan, unit)  # type: ignore[arg-type]


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def _point(at: ArrayLike) -> Array:
    try:
        centre = np.asarray(at)
    except ValueError as error:
        raise ValueError(f"expected a point of three numbers x, y, z; got {at!r}") from error
    usable = centre.shape == (3,) and centre.dtype.kind in "iuf"
    if not usable or not (np.abs(centre.astype(np.float64)) <= validate.LARGEST).all():
        raise ValueError(f"expected a point of three finite numbers x, y, z; got {at!r}")
    return centre.astype(np.float64)


def _rows(points: Any) -> Array:
    """An (n, 3) float64 C-contiguous view of the points, or a copy where no view can be had."""
    wanted = "a scan is an (n, 3) array of numbers, one row x, y, z a point"
    if isinstance(points, (str, bytes)) or hasattr(points, "__fspath__"):
        raise ValueError(f"{wanted}; got the text {points!r}: read a file with read_scan(path)")
    if isinstance(points, np.ma.MaskedArray) and points.dtype.kind in "iuf":
        points = np.ma.filled(points.astype(np.float64), np.nan)
    try:
        array = np.asarray(points)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{wanted}; got rows of different lengths or kinds") from error
    if array.dtype.kind not in "iuf":
        came = type(points).__name__ if array.ndim == 0 else f"an array of {array.dtype}"
        raise ValueError(f"{wanted}; got {came}: pass real numbers, integer or floating")
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{wanted}; got shape {array.shape}{_shape_advice(array)}")
    if len(array) < MIN_POINTS:
        raise ValueError(f"a scan needs at least {MIN_POINTS} distinct points; got {len(array)}")
    with np.errstate(over="ignore"):
        return np.require(array, np.float64, ["C", "A"]).view()


def _shape_advice(array: NDArray[Any]) -> str:
    if array.ndim != 2:
        return ""
    if array.shape[0] == 3:
        return ": transpose it, points.T"
    return ": pass points[:, :3] if these are x, y, z" if array.shape[1] > 3 else ""


def _checked(points: Array) -> tuple[Array, Array]:
    """The finite rows and their bounds, if they can carry a surface; else ValueError."""
    # One array type for the kernels, so that each compiles once.
    points.flags.writeable = False
    bad, bounds = validate.finite_bounds(points)
    if bad:
        total = len(points)
        points = points[validate.finite_rows(points)]
        points.flags.writeable = False
        if not len(points):
            raise ValueError(
                f"a scan needs at least {MIN_POINTS} distinct finite points; got {total} that are not finite "
                f"(NaN, inf or beyond {validate.LARGEST:g}): check that the right file or array was taken"
            )
        warnings.warn(
            f"dropped {bad} of {total} points that are not finite (NaN, inf or beyond {validate.LARGEST:g})",
            UserWarning,
            stacklevel=4,
        )
    distinct = validate.distinct_points(points, MIN_POINTS)
    if distinct < MIN_POINTS:
        raise ValueError(
            f"a scan needs at least {MIN_POINTS} distinct finite points; got {distinct}: "
            "check that the right file or array was taken"
        )
    diagonal = math.hypot(*(bounds[1] - bounds[0]))
    rounding = 8 * np.finfo(np.float64).eps * float(np.abs(bounds).max())
    if not validate.off_line(points, diagonal, max(LINE_TOLERANCE * diagonal, rounding)):
        raise ValueError("all points of the scan lie on one line; a ridge needs points on a surface")
    return points, bounds
