"""`Workplane.pasteRidge`, added to CadQuery without importing it, which takes seconds."""

from __future__ import annotations

import sys
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType
from typing import Any

METHOD = "pasteRidge"


def paste_ridge_method(self: Any, feature: Any, tag: str | None = None, **options: Any) -> Any:
    """The chain's solid with a ridge pasted on what is selected; see cad_export.ridge."""
    # Looked up at each call, so that a reload of the package takes effect.
    from cad_export.fluent import paste_ridge

    return paste_ridge(self, feature, tag, **options)


def install(cadquery: ModuleType) -> None:
    """Add the method to cadquery.Workplane, unless there is one."""
    if not hasattr(cadquery.Workplane, METHOD):
        setattr(cadquery.Workplane, METHOD, paste_ridge_method)


def install_when_loaded() -> None:
    """Install now, or right after cadquery has been imported. A second call changes nothing."""
    cadquery = sys.modules.get("cadquery")
    if cadquery is not None and hasattr(cadquery, "Workplane"):
        install(cadquery)
    elif not any(type(finder).__name__ == _Finder.__name__ for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())


class _Finder(MetaPathFinder):
    """Finds cadquery as it is found anyway, with a loader that installs; it is gone after that."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        if name != "cadquery":
            return None
        sys.meta_path.remove(self)
        spec = find_spec(name)
        if spec is not None and spec.loader is not None:
            spec.loader = _Loader(spec.loader)
        return spec


class _Loader(Loader):
    def __init__(self, loader: Any) -> None:
        self._loader = loader

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        module: ModuleType | None = self._loader.create_module(spec)
        return module

    def exec_module(self, module: ModuleType) -> None:
        self._loader.exec_module(module)
        install(module)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._loader, name)
