"""What cannot be written is told by the name that was given, not by that of the file written first."""

from __future__ import annotations

import errno
import tempfile
from pathlib import Path
from typing import Any

import cadquery as cq
import pytest

import cad_export as cx
from ridgefeature.commands.folder import output_folder
from ridgefeature.plot.files import new_figure, save


@pytest.mark.parametrize("suffix", [".png", ".step", ".stl"])
def test_a_name_that_leaves_no_room_for_one_beside_it(suffix: str, tmp_path: Path) -> None:
    target = tmp_path / ("x" * (254 - len(suffix)) + suffix)
    with pytest.raises(OSError, match="too long") as told:
        if suffix == ".png":
            save(new_figure(10, 10), target)
        else:
            cx.write(cq.Workplane().box(1, 1, 1), target)
    assert told.value.filename == str(target)


def test_a_folder_that_may_not_be_written_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def denied(dir: Path) -> Any:
        raise PermissionError(errno.EACCES, "Permission denied", str(dir / "tmp1"))

    monkeypatch.setattr(tempfile, "TemporaryFile", denied)
    with pytest.raises(PermissionError) as told, output_folder(tmp_path, []):
        pass
    assert told.value.filename == str(tmp_path)
