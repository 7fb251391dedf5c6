"""All tunables of the registration, in one place. The command line derives its options from these fields."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace


def _setting(default: float | int | str | bool, text: str) -> object:
    return field(default=default, metadata={"help": text})


@dataclass(frozen=True)
class Settings:
    """Tunables; lengths are parts of the local width unless said otherwise."""

    measure: str = _setting("residual", "what a template minimises: residual, or M for the paper's mean distance")  # type: ignore[assignment]
    k: int = _setting(2, "nearest points averaged in M")  # type: ignore[assignment]
    optimiser: str = _setting("auto", "name of an NLopt algorithm; auto: LD_SLSQP for residual, LN_BOBYQA for M")  # type: ignore[assignment]
    loss: str = _setting("tukey", "robust loss of the final fit: tukey, huber, cauchy, square")  # type: ignore[assignment]
    tuning: float = _setting(5.0, "tuning constant of the loss, in units of the noise scale")  # type: ignore[assignment]
    section: str = _setting("auto", "cross-section: auto, bell, cosine, plateau, dome, learned")  # type: ignore[assignment]
    length: float = _setting(0.8, "length of a template")  # type: ignore[assignment]
    longest: float = _setting(2.0, "factor by which templates grow longer where the data are poor")  # type: ignore[assignment]
    wanted_error: float = _setting(0.08, "relative error of the width above which templates grow longer")  # type: ignore[assignment]
    flank: float = _setting(0.3, "breadth of each flat flank")  # type: ignore[assignment]
    border: float = _setting(0.5, "breadth of the finished surface outside each foot")  # type: ignore[assignment]
    max_evaluations: int = _setting(80, "evaluations allowed for one optimisation")  # type: ignore[assignment]
    tolerance: float = _setting(1e-5, "step that ends an optimisation, in units of one noise scale")  # type: ignore[assignment]
    march_width_change: float = _setting(1.5, "largest factor by which the width may change from template to template")  # type: ignore[assignment]
    march_height_change: float = _setting(2.0, "largest factor by which the height may rise from template to template")  # type: ignore[assignment]
    drift: float = _setting(0.25, "relative change of the width between templates that is expected; of the height, twice")  # type: ignore[assignment]
    width_change: float = _setting(2.0, "largest factor by which one fit may change the width")  # type: ignore[assignment]
    flips: bool = _setting(True, "let a fit turn a ridge into a groove")  # type: ignore[assignment]
    height_change: float = _setting(4.0, "largest factor by which one fit may raise the height")  # type: ignore[assignment]
    evidence: float = _setting(25.0, "log likelihood ratio, doubled, above which a first window holds a ridge")  # type: ignore[assignment]
    going_on: float = _setting(20.0, "the same for a window in which a known ridge is expected to go on")  # type: ignore[assignment]
    look_ahead: float = _setting(1.0, "how far to look ahead over a weak passage")  # type: ignore[assignment]
    max_templates: int = _setting(500, "templates in all")  # type: ignore[assignment]

    def marching(self) -> Settings:
        """The settings for a template whose neighbour is known."""
        return replace(self, width_change=self.march_width_change, height_change=self.march_height_change, flips=False)

    @classmethod
    def names(cls) -> list[str]:
        """Names of all settings."""
        return [f.name for f in fields(cls)]
