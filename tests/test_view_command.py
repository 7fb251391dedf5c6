"""`ridgefeature view` as it is typed: it serves until it is interrupted, and tells what is wrong before."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path

import pytest
from browser_page import served, write_scan
from cli_helpers import fails, run


def test_it_serves_until_it_is_interrupted(tmp_path: Path) -> None:
    write_scan(tmp_path)
    command = [sys.executable, "-u", "-m", "ridgefeature", "view", "clay.npy", "--no-browser"]
    process = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    assert process.stdout is not None
    first = process.stdout.readline()
    assert first.startswith("The page is at http://127.0.0.1:") and "?token=" in first
    assert process.stdout.readline() == "Ctrl-C ends it.\n"
    process.send_signal(signal.SIGINT)
    told, _ = process.communicate(timeout=60)
    assert (process.returncode, told) == (0, "")


def test_without_the_token_there_is_no_page(tmp_path: Path) -> None:
    with served(tmp_path, "--upload", "1") as address:
        bare = address.split("?")[0]
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(bare)
        opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        with opener.open(address) as answer:
            assert b"<html" in answer.read().lower()
        with pytest.raises(urllib.error.HTTPError, match="403"):
            opener.open(
                urllib.request.Request(bare + "index.html", headers={"Origin": "http://evil.example"})
            )
        with pytest.raises(urllib.error.HTTPError, match="413"):
            opener.open(urllib.request.Request(bare + "open?name=a.ply", data=bytes(2**20 + 1)))
        for path in ("own/../../../etc/passwd", "own/%2e%2e/%2e%2e/serve.py", "../../etc/passwd"):
            with pytest.raises(urllib.error.HTTPError, match=r"40[34]"):
                opener.open(bare + path)


def test_a_file_that_is_no_scan_is_told_and_ends_it(tmp_path: Path) -> None:
    (tmp_path / "here.npy").write_bytes(b"")
    result = run("view", "--no-browser", tmp_path / "here.npy")
    assert result.exit_code == 2
    [line] = result.stderr.splitlines()
    assert line.startswith("ridgefeature: ") and "here.npy: " in line


def test_a_port_that_is_in_use_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        fails(
            run("view", "--no-browser", "--port", port), 2, f"--port: expected a free one, {port} is in use"
        )


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["nothere.npy"], "nothere.npy: No such file or directory"),
        (["here.npy", "--unit", "parsec"], "expected a length unit"),
        (["--port", "99999"], "99999"),
        (["--upload", "0"], "0"),
    ],
)
def test_what_is_wrong_is_told_before_there_is_a_page(tmp_path: Path, words: list[str], told: str) -> None:
    (tmp_path / "here.npy").write_bytes(b"")
    words = [str(tmp_path / w) if w.endswith(".npy") else w for w in words]
    fails(run("view", "--no-browser", *words), 2, told)
