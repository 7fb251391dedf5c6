"""Numbers and figures for people."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ridgefeature.curvilinear import templates_on
from ridgefeature.doubts import pick_missed

if TYPE_CHECKING:
    from ridgefeature.diagnosis import Diagnosis
    from ridgefeature.ridge import Ridge

_ONE_WAY = 0.5
"""Length of the mean of unit normals below which no one way is up, as round a pipe."""


def number(value: float, digits: int = 4) -> str:
    """So many significant digits, and no exponent for large numbers."""
    return f"{value:,.0f}" if 10**digits <= abs(value) < 1e9 else f"{value:.{digits}g}"


def round_below(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above a value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(m for m in (1, 2, 5) if m * power <= value * (1 + 1e-12)) * power)


def reason(error: Exception) -> str:
    """What is wrong, without the advice for a script that follows it."""
    return str(error).partition(";")[0]


def rows(ridge: Ridge, found: Diagnosis) -> list[tuple[str, str]]:
    """The diagnosis for people: names and values."""
    unit = ridge.unit
    return [
        ("coverage", f"{100 * found.coverage:.1f} % of the surface between the feet has points"),
        ("outliers", f"{100 * found.outliers:.1f} % of {len(found.deviation):,} points"),
        ("noise level", f"{number(found.noise, 3)} {unit}"),
        ("reduced chi-square", f"{number(found.reduced_chi_square, 3)} (1: the surface misses nothing)"),
        *ends(ridge),
        ("in doubt", "; ".join(told(found.doubts, unit)) or "no stretch"),
    ]


def kind(ridge: Ridge) -> str:
    """Whether it is a ridge or a groove, and which way is up for that: seen from below it is the other."""
    mean = ridge.normal.mean(axis=0)
    size = float(np.linalg.norm(mean))
    up = " ".join(f"{x + 0.0:g}" for x in np.round(mean / size, 2)) if size > _ONE_WAY else ""
    return f"{'groove' if ridge.groove else 'ridge'}{f', up is {up}' if up else ''}"


def templates(ridge: Ridge) -> str:
    """How many templates the march fitted, and how many of them are part of the finished ridge."""
    fitted, on = len(ridge.templates), len(templates_on(ridge)[0])
    return f"{fitted}" if on == fitted else f"{fitted}, {on} of them on the finished ridge"


def pick(ridge: Ridge) -> str:
    """Where it was picked; and how far from the ridge that is, where it is not on it."""
    at, missed = " ".join(f"{x:.6g}" for x in ridge.pick), pick_missed(ridge)
    if missed is None:
        return at
    return (
        f"{at}: {number(missed[0], 3)} {ridge.unit} ({missed[1]:.2g} widths) from the ridge; see whether it "
        "is the one that is meant, else pick nearer to its crest"
    )


def ends(ridge: Ridge) -> list[tuple[str, str]]:
    """Why each end stopped and where it lies, for people: names and values."""
    if ridge.closed:
        return [("ends", "none, the ridge is closed")]
    where = [""] * 2
    if ridge.end_interval is not None:
        where = [
            f" (between s = {number(low, 3)} and {number(high, 3)} {ridge.unit} to 95 %)"
            if np.isfinite(low)
            else ""
            for low, high in ridge.end_interval
        ]
    return [
        (f"{name} stopped because", why + at)
        for name, why, at in zip(("start", "end"), ridge.stop, where, strict=True)
    ]


def told(doubts: tuple[tuple[float, float, str], ...], unit: str) -> list[str]:
    """The stretches in doubt, in words, by reason."""
    reasons = dict.fromkeys(why for _, _, why in doubts)
    return [
        f"{reason} at s = "
        + ", ".join(f"{number(a, 3)} to {number(b, 3)}" for a, b, why in doubts if why == reason)
        + f" {unit}"
        for reason in reasons
    ]
