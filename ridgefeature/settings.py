"""All tunables of the registration, in one place. The command line derives its options from these fields."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Any

from ridgefeature.section import SECTIONS

MEASURES = ("residual", "M")
LOSSES = ("tukey", "huber", "cauchy", "square")
SECTION_CHOICES = ("auto", *SECTIONS, "learned")


def _setting(default: Any, text: str, choices: tuple[str, ...] = ()) -> Any:
    return field(default=default, metadata={"help": text, "choices": choices})


@dataclass(frozen=True)
class Settings:
    """Tunables; lengths are parts of the local width unless said otherwise.

    Raises ValueError for a value that is unknown, not finite or out of range.
    """

    measure: str = _setting(
        "residual", "what a template minimises: residual, or M for the paper's mean distance", MEASURES
    )
    k: int = _setting(2, "nearest points averaged in M")
    optimiser: str = _setting(
        "auto", "name of a local NLopt algorithm; auto: LD_LBFGS for residual, LN_BOBYQA for M"
    )
    loss: str = _setting("tukey", "robust loss, where Huber's does not do", LOSSES)
    tuning: float = _setting(5.0, "tuning constant of the loss, in units of the noise scale")
    section: str = _setting(
        "auto", "cross-section; auto: the bell, unless another is clearly better", SECTION_CHOICES
    )
    length: float = _setting(0.8, "length of a template")
    longest: float = _setting(2.0, "factor by which templates grow longer where the data are poor")
    wanted_error: float = _setting(0.08, "relative error of the width above which templates grow longer")
    flank: float = _setting(0.3, "breadth of each flat flank that is fitted")
    border: float = _setting(0.5, "breadth of the finished surface outside each foot; less in sharp bends")
    max_evaluations: int = _setting(
        80, "evaluations allowed for one optimisation; ten times that without gradient"
    )
    tolerance: float = _setting(
        3e-3, "step that ends an optimisation of the final residual fit, in noise scales"
    )
    march_width_change: float = _setting(
        1.5, "largest factor by which the width may change from template to template"
    )
    march_height_change: float = _setting(
        2.0, "largest factor by which one fit may raise the height from template to template"
    )
    march_drift: float = _setting(
        0.15, "relative change of the width between templates that is expected; of the height, twice"
    )
    drift: float = _setting(0.25, "the same for the first fit")
    width_change: float = _setting(2.0, "largest factor by which the first fit may change the width")
    height_change: float = _setting(4.0, "largest factor by which the first fit may raise the height")
    flips: bool = _setting(True, "let the first fit turn a ridge into a groove")
    evidence: float = _setting(
        25.0, "log likelihood ratio, doubled, above which a first window holds a ridge"
    )
    going_on: float = _setting(20.0, "the same for a window in which a known ridge is expected to go on")
    distinct: float = _setting(
        100.0, "the same for a whole ridge against a smooth surface, a step or a crease"
    )
    shortest: float = _setting(1.5, "length of the shortest ridge")
    widest: float = _setting(0.5, "width of the widest ridge, in parts of the scan's extent")
    steepest: float = _setting(4.0, "height of the steepest ridge")
    base_chance: float = _setting(
        1e-3,
        "chance at which a flat base is taken for a curved one; 0.5 or more: bases are flat",
    )
    look_ahead: float = _setting(1.0, "how far to look ahead over a weak passage or a gap")
    max_templates: int = _setting(500, "templates in all")

    def __post_init__(self) -> None:
        for f in fields(self):
            value, default = getattr(self, f.name), f.default
            if f.metadata["choices"]:
                _check(
                    value in f.metadata["choices"],
                    f.name,
                    f"one of {', '.join(f.metadata['choices'])}",
                    value,
                )
            elif isinstance(default, bool):
                _check(isinstance(value, bool), f.name, "True or False", value)
            elif isinstance(default, int):
                _check(isinstance(value, int) and value >= 1, f.name, "a whole number above 0", value)
            elif isinstance(default, float):
                _check(_is_positive(value), f.name, "a number above 0", value)
        for name in ("longest", "width_change", "march_width_change", "height_change", "march_height_change"):
            _check(getattr(self, name) >= 1, name, "a factor of at least 1", getattr(self, name))
        _check(self.border > 0.1, "border", "more than 0.1", self.border)
        self._check_optimiser()

    def _check_optimiser(self) -> None:
        import nlopt

        known = self.optimiser == "auto" or (
            self.optimiser.startswith(("LD_", "LN_"))
            and isinstance(getattr(nlopt, self.optimiser, None), int)
        )
        _check(
            known,
            "optimiser",
            "auto or a local NLopt algorithm such as LD_SLSQP or LN_BOBYQA",
            self.optimiser,
        )
        has_what_it_needs = self.measure == "residual" or not self.optimiser.startswith("LD_")
        _check(
            has_what_it_needs,
            "optimiser",
            "auto or an LN_ algorithm for measure M, which has no gradient",
            self.optimiser,
        )

    @property
    def algorithm(self) -> str:
        """The NLopt algorithm in use."""
        if self.optimiser != "auto":
            return self.optimiser
        return "LN_BOBYQA" if self.measure == "M" else "LD_LBFGS"

    @property
    def flat(self) -> bool:
        """Whether every base is taken for flat."""
        return self.base_chance >= 0.5

    def marching(self) -> Settings:
        """The settings for a template whose neighbour is known."""
        return replace(
            self,
            width_change=self.march_width_change,
            height_change=self.march_height_change,
            drift=self.march_drift,
            flips=False,
        )


def _is_positive(value: Any) -> bool:
    return (
        isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value) and value > 0
    )


def _check(good: bool, name: str, expected: str, got: Any) -> None:
    if not good:
        raise ValueError(f"setting {name}: expected {expected}, got {got!r}")
