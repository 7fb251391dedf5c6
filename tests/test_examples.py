"""Every example runs as a user would run it; each asserts its own figures."""

from __future__ import annotations

from pathlib import Path

import pytest
from example_runner import FOLDER, run_example, run_example_afresh

SCRIPTS = sorted(path.name for path in FOLDER.glob("*.py") if "__main__" in path.read_text())
# Those that make a part run where others open its file.
HERE = [name for name in SCRIPTS if "[FOLDER]" not in (FOLDER / name).read_text()]


def test_the_examples_are_there() -> None:
    asked = {"spiral.py", "constant_bead.py", "clay.py", "mountain_ridge.py", "resize_and_export.py"}
    asked |= {"grip.py", "panel_bead.py", "spiral_on_cylinder.py", "laser_bead.py"}
    assert asked <= set(SCRIPTS)


@pytest.mark.parametrize("name", sorted({*HERE} - {"clay.py"}))
def test_example(name: str, tmp_path: Path) -> None:
    run_example(name, tmp_path)


def test_an_example_runs_in_a_process_of_its_own(tmp_path: Path) -> None:
    """One that imports from the file beside it."""
    run_example_afresh("clay.py", tmp_path)


def test_the_panel_is_a_script_with_parameters() -> None:
    """In a CQGI host, h and w are parameters, and the part follows them."""
    from cadquery import cqgi

    model = cqgi.parse((FOLDER / "panel_bead.py").read_text())
    assert {"h", "w"} <= set(model.metadata.parameters)
    heights = []
    for h in (1.0, 2.0):
        built = model.build({"h": h})
        assert built.success, built.exception
        heights.append(built.results[0].shape.val().BoundingBox().zmax - 0.75)
    assert heights[1] == pytest.approx(2 * heights[0], rel=1e-3)
