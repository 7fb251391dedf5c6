"""The README is true: its code runs, its commands run, and its tables name what there is."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from ridgefeature import cli
from ridgefeature.io.read import FORMATS
from ridgefeature.section import SECTIONS
from ridgefeature.settings import Settings

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)


SET_UP = [block.strip() for block in blocks("sh") if ".venv" in block]
COMMANDS = [line for block in blocks("sh") if ".venv" not in block for line in block.splitlines()]


def arguments(line: str) -> list[str]:
    """Of a command line of ridgefeature."""
    name, *words = shlex.split(line)
    assert name == "ridgefeature", line
    return words


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder in which the demo has run, in a process of its own, and what it printed."""
    folder = tmp_path_factory.mktemp("readme")
    done = subprocess.run(
        [sys.executable, "-m", "ridgefeature", *arguments(SET_UP[0].split(".venv/bin/")[-1])],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


@pytest.fixture
def demo(shown: tuple[Path, str], monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder in which the demo has run; it is the working directory."""
    monkeypatch.chdir(shown[0])
    return shown[0]


def test_two_commands_do_all_the_set_up() -> None:
    assert len(SET_UP) == 2
    assert all("\n" not in line for line in SET_UP)
    assert SET_UP[0].endswith(".venv/bin/ridgefeature demo")
    assert SET_UP[1].endswith(".venv/bin/pytest")


def test_ci_runs_the_test_command_word_for_word() -> None:
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    pattern = re.search(r"test_command=\$\(grep -m 1 '(.*)' README\.md\)", script)
    assert pattern is not None
    found = next(line for line in TEXT.splitlines() if re.search(pattern[1], line))
    assert found == SET_UP[1]
    assert '\nbash -euo pipefail -c "$test_command"\n' in script


def test_the_demo_ends_by_naming_files_that_are_there(shown: tuple[Path, str]) -> None:
    folder = shown[0] / "ridge-demo"
    pictures = {"profile.png", "view.png", "deviation.png"}
    names = {"spiral.npy", "feature.ridge.json", "ridge.step", "ridge_h1.5.step", *pictures}
    assert {p.name for p in folder.iterdir()} == names
    truth, _, after = shown[1].partition("Against the truth")[2].partition("Open next")
    errors = [float(line.split()[1]) for line in truth.splitlines() if line.startswith(("height", "width"))]
    assert len(errors) == 2 and max(errors) < 5
    named = [Path(line.split("  ")[0]) for line in after.splitlines() if line.startswith("ridge-demo")]
    assert len(named) == 5 and all((shown[0] / path).is_file() for path in named)


def test_the_python_blocks_run(demo: Path) -> None:
    names: dict[str, object] = {}
    assert len(blocks("python")) >= 3
    for block in blocks("python"):
        exec(compile(block, "README.md", "exec"), names)
    for name in ("taller.ridge.json", "taller.step", "part.step", "higher.glb", "ridge.FCMacro"):
        assert (demo / name).stat().st_size > 1000


def test_the_command_lines_run(demo: Path) -> None:
    assert len(COMMANDS) >= 3
    for line in COMMANDS:
        result = CliRunner().invoke(cli.main, arguments(line))
        assert result.exit_code == 0, result.stderr
        assert result.stdout.strip(), line
    assert {p.name for p in (demo / "ridge-out").iterdir()} == {
        "deviation.png",
        "feature.ridge.json",
        "profile.png",
        "ridge.step",
        "view.png",
    }


def test_every_command_and_option_is_named() -> None:
    assert isinstance(cli.main, click.Group)
    settings = {f.name for f in fields(Settings)}
    for name, entry in cli.main.commands.items():
        assert f"`ridgefeature {name} " in TEXT, name
        for option in entry.params:
            if isinstance(option, click.Option) and option.name not in {*settings, "unit"}:
                assert any(f"`{flag}" in TEXT or f" {flag} " in TEXT for flag in option.opts), option.opts


def test_every_format_and_section_is_named() -> None:
    for suffix in FORMATS:
        assert f"`{suffix}`" in TEXT, suffix
    for name, make in SECTIONS.items():
        row = next((line for line in TEXT.splitlines() if line.startswith(f"| `{name}` |")), None)
        assert row is not None, name
        assert float(row.split("|")[3]) == pytest.approx(make().half_height_width, abs=6e-4)


def settings_table() -> str:
    rows = ["| setting | default | meaning |", "|---|---|---|"]
    for f in fields(Settings):
        choices = ", ".join(f.metadata.get("choices", ()))
        text = f.metadata["help"] + (f": {choices}" if choices and f.name != "measure" else "")
        rows.append(f"| `{f.name}` | {f.default} | {text} |")
    return "\n".join(rows)


def test_the_settings_are_those_of_the_program() -> None:
    assert settings_table() in TEXT, f"the table of settings should read\n{settings_table()}"


def test_pictures_and_links_are_there() -> None:
    links = re.findall(r"\]\(([^)#:]+)\)", TEXT) + re.findall(r'src="([^"]+)"', TEXT)
    assert {"docs/view.png", "docs/panel.png"} <= set(links)
    for link in links:
        assert (ROOT / link).is_file(), link
        assert (ROOT / link).stat().st_size < 400_000, link
