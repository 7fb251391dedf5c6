"""One table with what was asked beside what was measured."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field

Check = Callable[[float], bool]


def at_most(limit: float) -> tuple[str, Check]:
    return f"<= {limit:g}", lambda value: value <= limit


def at_least(limit: float) -> tuple[str, Check]:
    return f">= {limit:g}", lambda value: value >= limit


def between(low: float, high: float) -> tuple[str, Check]:
    return f"{low:g} to {high:g}", lambda value: low <= value <= high


@dataclass
class Report:
    """Rows as they are measured; each is shown on stderr at once, the table on stdout at the end."""

    rows: list[tuple[str, str, str, str]] = field(default_factory=list)

    def add(self, figure: str, asked: tuple[str, Check], value: float, note: str = "") -> None:
        """A figure that was asked for, and whether it is met."""
        words, check = asked
        self._row(figure, words, f"{value:.3g} {note}".rstrip(), "yes" if check(value) else "NO")

    def tell(self, figure: str, measured: str) -> None:
        """A figure that was not asked for."""
        self._row(figure, "", measured, "")

    def _row(self, *row: str) -> None:
        self.rows.append((row[0], row[1], row[2], row[3]))
        print(" | ".join(row), file=sys.stderr, flush=True)

    def show(self) -> None:
        """The table in Markdown."""
        rows = [("figure", "asked", "measured", "met"), *self.rows]
        breadth = [max(len(row[i]) for row in rows) for i in range(4)]
        for n, row in enumerate(rows):
            print("| " + " | ".join(text.ljust(b) for text, b in zip(row, breadth, strict=True)) + " |")
            if n == 0:
                print("|" + "|".join("-" * (b + 2) for b in breadth) + "|")
