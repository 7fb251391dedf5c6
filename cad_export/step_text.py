"""Text in STEP files, which are ASCII (ISO 10303-21, 6.4.3)."""

from __future__ import annotations


def directives(text: str) -> str:
    r"""The text in ASCII for a string of a STEP file: other characters as \X2\ and \X4\ directives.

    OCCT writes such directives as they stand, doubles apostrophes and backslashes itself, and reads all of
    them back. Characters that nothing can print become "?".
    """
    return "".join(c if " " <= c <= "~" else _directive(c) for c in text)


def _directive(c: str) -> str:
    if not c.isprintable():
        return "?"
    return rf"\X2\{ord(c):04X}\X0" + "\\" if ord(c) < 0x10000 else rf"\X4\{ord(c):08X}\X0" + "\\"
