"""Ctrl-C: one line and exit status 130, whatever is being done.

An interrupt is noted, and ends the work at the next place where nothing is torn by it. It is raised at once
only where nothing is being written and no module imported: native modules do not bear it. A second one ends
the program. This imports little, as it is there before all else.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

TYPE_CHECKING = False

if TYPE_CHECKING:
    from types import FrameType
    from typing import Any

STATUS = 130
_SAME_PRESS = 0.3
"""Seconds within which a second interrupt is the first, sent to the program and to its group."""
_SHOW_CURSOR = "\r\x1b[2K\x1b[?25h"


class _State:
    """What came, and what is being done."""

    def __init__(self) -> None:
        self.came: float | None = None
        self.pending = False  # it has still to be raised
        self.at_once = False
        self.folder = ""
        self.due: list[str] = []
        self.written: list[str] = []
        self.undo: Callable[[], None] = lambda: None


_now = _State()


def listen() -> bool:
    """Take over interrupts; False where they are ignored, taken by others or taken already."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        return False
    try:
        signal.signal(signal.SIGINT, _on_interrupt)
    except ValueError:  # not in the main thread
        return False
    sys.unraisablehook = _unraisable
    return True


def deafen() -> None:
    """Take no notice of interrupts any more: the program is done and ends."""
    if signal.getsignal(signal.SIGINT) is _on_interrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def heard() -> Iterator[None]:
    """Listen for one command, and leave all as it was."""
    mine = listen()
    try:
        yield
    finally:
        if mine:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            sys.unraisablehook = sys.__unraisablehook__
        _now.__init__()  # type: ignore[misc]


@contextmanager
def at_once() -> Iterator[None]:
    """Work that may be left at any moment."""
    check()
    _now.at_once = True
    try:
        yield
    finally:
        _now.at_once = False


def check() -> None:
    """Raises KeyboardInterrupt if one has come that was not raised yet."""
    if _now.pending:
        _now.pending = False
        raise KeyboardInterrupt


def checking(progress: Callable[[Any], None] | None) -> Callable[[Any], None]:
    """The progress with a check."""

    def checked(value: Any) -> None:
        check()
        if progress is not None:
            progress(value)

    return checked


def came() -> bool:
    """Whether there was an interrupt in this command."""
    return _now.came is not None


def writes(folder: str | os.PathLike[str], names: Iterable[str], made: Iterable[os.PathLike[str]]) -> None:
    """Tell which files a command is about to write to a folder; made: folders it made for them."""
    _now.folder, _now.due, made = str(folder), list(names), list(made)
    there = set(os.listdir(folder))

    def undo() -> None:
        for name in set(os.listdir(folder)) - there:
            if _is_part(name, _now.due):
                _remove(os.path.join(folder, name))
        for path in made:
            if os.path.isdir(path) and not os.listdir(path):
                os.rmdir(path)

    _now.undo = undo


def wrote(name: str) -> None:
    """Tell that one of them is there; raises KeyboardInterrupt if that was interrupted."""
    _now.written.append(name)
    check()


def told() -> str:
    """What to say of an interrupt: which files were written and which were not."""
    if not _now.written:
        return "interrupted; no file was written"
    left = [name for name in _now.due if name not in _now.written]
    text = f"interrupted; written to {_now.folder}: {', '.join(_now.written)}"
    return f"{text}; not written: {', '.join(left)}" if left else text


def _on_interrupt(_: int, frame: FrameType | None) -> None:
    now = time.monotonic()
    if _now.came is not None:
        if now - _now.came >= _SAME_PRESS:
            _end()
        return
    _now.came, _now.pending = now, True
    if _now.at_once and not _importing(frame):
        check()


def _importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _unraisable(what: Any) -> None:
    """An interrupt that was raised where nothing can be, as in a finaliser, has still to be raised."""
    if issubclass(what.exc_type, KeyboardInterrupt):
        _now.pending = True
    else:
        sys.__unraisablehook__(what)


def _end() -> None:
    """End here and now, with nothing half written."""
    try:
        _now.undo()
    finally:
        clear = _SHOW_CURSOR if sys.stderr is not None and sys.stderr.isatty() else ""
        os.write(2, f"{clear}ridgefeature: {told()}\n".encode(errors="replace"))
        os._exit(STATUS)


def _is_part(name: str, due: Iterable[str]) -> bool:
    """Whether a file has a name under which those due are begun."""
    return any(
        name.startswith(f".{os.path.splitext(one)[0]}.")
        or (name.startswith((one, f".{one}")) and name.endswith(".part"))
        for one in due
    )


def _remove(path: str) -> None:
    if os.path.isdir(path):
        for name in os.listdir(path):
            os.unlink(os.path.join(path, name))
        os.rmdir(path)
    else:
        os.unlink(path)
