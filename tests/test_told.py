"""What the summary of a ridge tells its reader, at the command line and as figures."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli_helpers import run
from oracles import spiral_ridge

import ridgefeature as rf
from ridgefeature import plot
from ridgefeature.commands import output
from ridgefeature.curvilinear import templates_on


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    return spiral_ridge()


def told(ridge: rf.Ridge) -> dict[str, str]:
    return dict(output.rows(ridge))


def test_a_groove_is_called_one_and_a_ridge_too(ridge: rf.Ridge) -> None:
    groove = ridge.resized(h=-1)
    assert (ridge.groove, groove.groove) == (False, True)
    assert (ridge.summary()["groove"], groove.summary()["groove"]) == (False, True)
    assert told(ridge)["kind"] == "ridge, up is 0 0 1"
    assert told(groove)["kind"] == "groove, up is 0 0 1"


def test_which_way_is_up_tells_a_ridge_from_a_groove_seen_from_below(ridge: rf.Ridge) -> None:
    below = replace(ridge, normal=-ridge.normal)
    assert told(below)["kind"] == "ridge, up is 0 0 -1"
    round_a_pipe = np.where(np.arange(len(ridge.normal))[:, None] % 2, ridge.normal, -ridge.normal)
    assert told(replace(ridge, normal=round_a_pipe))["kind"] == "ridge"


def test_the_title_says_groove(ridge: rf.Ridge, capsys: pytest.CaptureFixture[str]) -> None:
    found = rf.diagnose(ridge, ridge.surface().grid(200, 40).reshape(-1, 3))
    output.show(ridge.resized(h=-1), {}, found)
    assert capsys.readouterr().out.startswith("groove")


def test_table_and_picture_count_the_same_templates(ridge: rf.Ridge, tmp_path: Path) -> None:
    whole, short = len(ridge.templates), ridge.stretched(0.5 * ridge.length, "trim")
    on = len(templates_on(short)[0])
    assert on < whole
    assert told(ridge)["templates"] == f"{whole}"
    assert told(short)["templates"] == f"{whole}, {on} of them on the finished ridge"
    for one, said in ((ridge, f" {whole} templates"), (short, f" {on} of {whole} templates")):
        figure = plot.view(one.surface().grid(100, 20).reshape(-1, 3), one, tmp_path / "view.png")
        assert any(said in text.get_text() for text in figure.texts)


def test_info_says_where_the_unit_is_assumed(tmp_path: Path) -> None:
    points = np.random.default_rng(0).normal(size=(50, 3))
    np.save(tmp_path / "a.npy", points)
    assumed = "mm, assumed: such files are read without one; --unit gives another"
    assert assumed in run("info", tmp_path / "a.npy").stdout
    assert json.loads(run("info", tmp_path / "a.npy", "--json").stdout)["unit_assumed"] is True
    given = run("info", tmp_path / "a.npy", "--unit", "mm")
    assert "mm" in given.stdout and "assumed" not in given.stdout
    assert (
        json.loads(run("info", tmp_path / "a.npy", "--unit", "cm", "--json").stdout)["unit_assumed"] is False
    )
