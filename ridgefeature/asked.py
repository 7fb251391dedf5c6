"""What `register` is asked, checked: errors tell what was expected, what came and what to do."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ridgefeature.settings import Settings
from ridgefeature.starts import Hints

if TYPE_CHECKING:
    from ridgefeature.ridge import Ridge

Array = NDArray[np.float64]
_OFF = 60.0
"""Degrees between a given direction and the ridge at the pick from which on they do not agree."""
KINDS = ("ridge", "groove", "auto")


def settings_of(settings: Settings | None, max_templates: int | None) -> Settings:
    """The settings to use, checked."""
    settings = settings or Settings()
    if not isinstance(settings, Settings):
        raise ValueError(
            f"settings: expected a Settings, got {type(settings).__name__}; write Settings(name=value)"
        )
    if max_templates is None:
        return settings
    return replace(settings, max_templates=positive(max_templates, "max_templates", whole=True))


def hints_of(direction: ArrayLike | None, width: float | None, height: float | None, kind: str) -> Hints:
    """The hints, checked; the direction as a unit vector."""
    if kind not in KINDS:
        raise ValueError(f"kind: expected one of {', '.join(KINDS)}, got {kind!r}")
    along = None
    if direction is not None:
        along = vector_of(direction, "direction")
        if not np.linalg.norm(along) > 0:
            raise ValueError(
                "direction: expected a vector of some length, got zero; leave it out to have it found"
            )
        along = along / np.linalg.norm(along)
    return Hints(
        along,
        None if width is None else positive(width, "width"),
        None if height is None else positive(height, "height"),
        kind,
    )


def warned(ridge: Ridge, pick: Array, direction: ArrayLike | None) -> Ridge:
    """The ridge; with a UserWarning where it does not run along the direction that was given."""
    if direction is None:
        return ridge
    given = vector_of(direction, "direction")
    tangent = ridge.tangent[int(np.argmin(np.linalg.norm(ridge.spine - pick, axis=1)))]
    off = math.degrees(math.acos(min(abs(float(tangent @ given)) / float(np.linalg.norm(given)), 1.0)))
    if off > _OFF:
        warnings.warn(
            f"direction: expected one along the ridge, got {text_of(given)}; the ridge found runs along "
            f"{text_of(np.round(tangent, 3) + 0.0)} at the pick, {off:.0f} degrees off. See whether it is "
            "the one that is meant; then give its own direction= or leave it out, else pick elsewhere",
            UserWarning,
            stacklevel=3,
        )
    return ridge


def refusal(message: str, hints: Hints) -> str:
    """Why there is no ridge; and along which direction it was looked for, if one was given."""
    if hints.direction is None:
        return message
    along = text_of(hints.direction)
    return f"{message}; it was looked for along {along}: leave direction= out to look all round"


def positive(value: Any, name: str, whole: bool = False) -> Any:
    """A number above 0, as a float; whole: as an int."""
    number = _number(value)
    if not (np.isfinite(number) and number > 0) or (whole and number != int(number)):
        what = "whole number" if whole else "number"
        raise ValueError(f"{name}: expected a {what} above 0, got {value!r}; leave it out to have it found")
    return int(number) if whole else number


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return float("nan")


def vector_of(value: ArrayLike, name: str) -> Array:
    """Three finite numbers (3,)."""
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ValueError(f"{name}: expected three finite numbers x, y, z, got {value!r}")
    return vector


def text_of(point: Array) -> str:
    """A point as messages show it."""
    return "(" + ", ".join(f"{x:.6g}" for x in point) + ")"
