"""OCCT's settings and messages are global: they are changed for one job and put back."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from OCP.Interface import Interface_Static
from OCP.Message import Message
from OCP.STEPControl import STEPControl_Controller

_LOCK = threading.RLock()  # jobs nest


@contextmanager
def quiet(settings: dict[str, str]) -> Iterator[None]:
    """OCCT with these settings and without its chatter; both as they were afterwards."""
    with _LOCK:
        STEPControl_Controller.Init_s()  # defines the settings
        before = {key: Interface_Static.CVal_s(key) for key in settings}
        messenger = Message.DefaultMessenger_s()
        printers = list(messenger.Printers())
        try:
            for printer in printers:
                messenger.RemovePrinter(printer)
            for key, value in settings.items():
                if not Interface_Static.SetCVal_s(key, value):
                    raise ValueError(f"OCCT does not take {value!r} for {key}")
            yield
        finally:
            for key, value in before.items():
                Interface_Static.SetCVal_s(key, value)
            for printer in printers:
                messenger.AddPrinter(printer)
