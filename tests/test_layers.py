"""Imports go down only, and heavy libraries are imported where they are used."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import ridgefeature

PACKAGE = Path(ridgefeature.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))

CAD = {"cad_export", "OCP", "cadquery"}
HEAVY = {
    *CAD, "matplotlib", "vtk", "vtkmodules", "pyvista", "trimesh", "laspy", "pye57", "pypcd4", "rich",
    "click", "scipy",
}  # fmt: skip
PLAIN = {"math", "typing", "functools", "__future__"}
AT_THE_TOP = ("plot", "cli", "commands", "viewer", "io", "__main__")
"""First parts of the modules above the ridge."""


def module_of(path: Path) -> str:
    """Dotted name inside the package: kernels.grid, io (for io/__init__.py), cli."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(path: Path, everywhere: bool) -> Iterator[str]:
    """Dotted names that a file imports as it loads, or anywhere; not what only type checkers see."""
    waiting: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            package = [*path.relative_to(PACKAGE.parent).parts[: -node.level or None]] if node.level else []
            base = ".".join([*package, *([node.module] if node.module else [])])
            yield from (f"{base}.{alias.name}" for alias in node.names)
        is_function = isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
        typing_only = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        if not typing_only and (everywhere or not is_function):
            waiting.extend(ast.iter_child_nodes(node))


def own(names: Iterator[str]) -> set[str]:
    """Which of the package's modules these are."""
    known = {module_of(f) for f in FILES}
    inner = {n.removeprefix("ridgefeature.") for n in names if n.startswith("ridgefeature.")}
    return {n if n in known else n.rpartition(".")[0] for n in inner} & known


def roots(names: Iterator[str]) -> set[str]:
    return {n.partition(".")[0] for n in names}


GRAPH = {
    module_of(f): own(imports(f, everywhere=False))
    for f in FILES
    if f.parent != PACKAGE or f.stem != "__init__"
}


def test_the_parser_sees_imports_as_it_should():
    assert "kernels.algebra" in GRAPH["kernels.appraise"]
    assert "ridge" in GRAPH["registration"]
    assert "numba" in roots(imports(PACKAGE / "kernels" / "grid.py", everywhere=False))
    assert "OCP" in roots(imports(PACKAGE / "io" / "cad.py", everywhere=True))


def test_kernels_know_numpy_numba_and_each_other_only():
    for path in (PACKAGE / "kernels").glob("*.py"):
        outside = roots(imports(path, everywhere=True)) - {"numpy", "numba"} - PLAIN
        assert outside <= {"ridgefeature"}, path.name
        assert all(m.startswith("kernels") for m in own(imports(path, everywhere=True))), path.name


def test_modules_import_each_other_without_cycles():
    waiting = {m: set(deps) - {m} for m, deps in GRAPH.items()}
    while waiting:
        free = {m for m, deps in waiting.items() if not deps & waiting.keys()}
        assert free, f"cycle among {sorted(waiting)}"
        for m in free:
            del waiting[m]


LAYERS = [
    ["basis"], ["bspline"], ["section"], ["template", "scan", "grid"], ["window", "distance"],
    ["optimise"], ["improve"], ["starts", "march"], ["guess"], ["ends"], ["settle"], ["stations", "merge"],
    ["base"], ["on_base", "fitting"], ["ridge"], ["registration"],
]  # fmt: skip


@pytest.mark.parametrize("level", range(len(LAYERS)), ids=lambda i: "+".join(LAYERS[i]))
def test_a_layer_imports_nothing_from_the_layers_above(level):
    above = {m for layer in LAYERS[level + 1 :] for m in layer}
    for module in LAYERS[level]:
        assert not GRAPH[module] & above, module


def test_the_core_does_not_import_what_stands_on_it():
    for module, deps in GRAPH.items():
        if not module.startswith(AT_THE_TOP):
            assert not {d for d in deps if d.startswith(AT_THE_TOP)}, module


def test_cad_is_imported_by_cad_reading_commands_and_viewer_only():
    for path in FILES:
        module = module_of(path)
        allowed = module == "io.cad" or module.startswith(("cli", "commands", "viewer"))
        assert allowed or not roots(imports(path, everywhere=True)) & CAD, module
        assert not roots(imports(path, everywhere=False)) & CAD, f"{module}, as it loads"


def test_heavy_libraries_are_imported_where_they_are_used():
    for path in FILES:
        module, loaded = module_of(path), roots(imports(path, everywhere=False))
        if not module.startswith(("plot", "cli", "commands", "viewer")):
            assert not loaded & HEAVY, module


def test_importing_the_package_loads_neither_cad_nor_pictures():
    code = "import sys, ridgefeature; print(*sorted({m.partition('.')[0] for m in sys.modules}))"
    loaded = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert "ridgefeature" in loaded
    assert not set(loaded) & {"OCP", "cadquery", "vtk", "vtkmodules", "matplotlib", "trimesh", "cad_export"}


# Size


def test_files_stay_short():
    lengths = {module_of(f): len(f.read_text(encoding="utf-8").splitlines()) for f in FILES}
    assert {m: n for m, n in lengths.items() if n > 300} == {}


def test_functions_stay_short():
    long = {}
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                lines = node.end_lineno - node.lineno + 1
                if lines > 60:
                    long[f"{module_of(path)}.{node.name}"] = lines
    assert long == {}


def test_kernels_that_kernels_call_are_inlined():
    """Else which of several compiled copies is linked, and so the last bit, depends on what was loaded first:
    the same scan would give another ridge in the process that compiled the kernels."""
    kernels: dict[str, tuple[str, set[str]]] = {}
    for path in FILES:
        if path.parent.name != "kernels":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.decorator_list:
                called = {ast.unparse(c.func) for c in ast.walk(node) if isinstance(c, ast.Call)}
                kernels[node.name] = ast.unparse(node.decorator_list[0]), called - {node.name}
    called = set().union(*(calls for _, calls in kernels.values()))
    assert len(kernels) > 100
    assert {name for name, (how, _) in kernels.items() if "OPTIONS" in how and name in called} == set()
