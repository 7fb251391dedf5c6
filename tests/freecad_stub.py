"""A stand-in for as much of FreeCAD as the macro uses, so that its plain Python runs without FreeCAD."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any


class StubObject:
    def __init__(self) -> None:
        self.PropertiesList: list[str] = []
        self.tips: dict[str, str] = {}
        self.Proxy: Any = None
        self.Shape: Any = None

    def addProperty(self, kind, name, group="", tip="", attributes=0, read_only=False, hidden=False):
        self.PropertiesList.append(name)
        self.tips[name] = tip

    def touch(self) -> None:
        pass


class StubDocument:
    def __init__(self) -> None:
        self.Objects: list[StubObject] = []

    def addObject(self, kind: str, name: str) -> StubObject:
        self.Objects.append(StubObject())
        return self.Objects[-1]

    def openTransaction(self, name: str) -> None:
        pass

    def commitTransaction(self) -> None:
        pass

    def recompute(self) -> None:
        for one in self.Objects:
            one.Proxy.execute(one)


class StubSpline:
    def buildFromPolesMultsKnots(self, *given: Any) -> None:
        self.given = given

    def toShape(self) -> tuple[Any, ...]:
        return self.given


def run_stubbed(macro: Path, document: StubDocument | None = None) -> StubDocument:
    """Run a macro in a document of a FreeCAD that is not there."""
    document = document or StubDocument()
    stubs = {"FreeCAD": ModuleType("FreeCAD"), "Part": ModuleType("Part")}
    stubs["FreeCAD"].__dict__.update(Vector=lambda *xyz: xyz, ActiveDocument=document, GuiUp=False)
    stubs["Part"].__dict__.update(BSplineSurface=StubSpline)
    before = {name: sys.modules.get(name) for name in stubs}
    sys.modules.update(stubs)
    try:
        exec(compile(macro.read_text(encoding="ascii"), macro.name, "exec"), {"__name__": "__main__"})
    finally:
        sys.modules.update({name: module for name, module in before.items() if module is not None})
        for name in (name for name, module in before.items() if module is None):
            del sys.modules[name]
    return document
