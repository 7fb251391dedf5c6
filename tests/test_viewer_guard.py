"""Nobody but this machine's own browser, with the token, gets anything from the page."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("aiohttp")

from aiohttp import ClientSession, CookieJar, web
from yarl import URL

from ridgefeature.viewer.guard import LOOPBACK, add_headers, guard, refusal
from ridgefeature.viewer.routes import routes

TOKEN, LIMIT = "a-long-secret", 1000
Talk = Callable[[ClientSession, str], Awaitable[Any]]


def talk(tmp_path: Path, what: Talk, opened: list[bytes] | None = None) -> Any:
    """Run `what` against a server with the page's guard and routes, as a browser would."""

    async def opens(path: Path, name: str) -> None:
        data = path.read_bytes()
        if data == b"damaged":
            raise ValueError(f"{path}: expected points")
        (opened if opened is not None else []).append(data)

    async def takes(kind: str, name: str, folder: Path) -> Path:
        if kind != "step":
            raise ValueError(f"expected step, got {kind}")
        path = folder / "ridge-1.step"
        path.write_text(name)
        return path

    async def run() -> Any:
        app = web.Application(middlewares=[guard(TOKEN, LIMIT)])
        app.on_response_prepare.append(add_headers)
        app.add_routes(routes(SimpleNamespace(open=opens, take=takes), tmp_path, LIMIT))  # type: ignore[arg-type]
        own = tmp_path / "www"
        own.mkdir()
        (own / "index.html").write_text("the page")
        app.router.add_static("/", own)
        runner = web.AppRunner(app)
        await runner.setup()
        site = web.TCPSite(runner, "127.0.0.1", 0)
        await site.start()
        address = f"http://127.0.0.1:{runner.addresses[0][1]}"
        try:
            async with ClientSession(cookie_jar=CookieJar(unsafe=True)) as browser:
                return await what(browser, address)
        finally:
            await runner.cleanup()

    return asyncio.run(run())


async def logged_in(browser: ClientSession, address: str) -> None:
    async with browser.get(f"{address}/?token={TOKEN}") as answer:
        assert answer.status == 200 and await answer.text() == "the page"
        assert "token" not in str(answer.url), "the address that stays in the history has no token"


async def status(browser: ClientSession, url: str, **how: Any) -> int:
    async with browser.request(how.pop("method", "GET"), URL(url, encoded=True), **how) as answer:
        return answer.status


def test_the_token_opens_the_page_and_a_cookie_keeps_it_open(tmp_path: Path) -> None:
    async def what(browser: ClientSession, address: str) -> None:
        await logged_in(browser, address)
        [cookie] = browser.cookie_jar
        assert cookie["httponly"] and cookie["samesite"] == "Strict"
        async with browser.get(f"{address}/index.html") as answer:
            assert answer.status == 200
            assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]

    talk(tmp_path, what)


@pytest.mark.parametrize(
    "path", ["/", "/index.html", "/take?kind=step&ridge=x", "/?token=", "/?token=another"]
)
def test_without_the_token_nothing_is_given(tmp_path: Path, path: str) -> None:
    assert talk(tmp_path, lambda browser, address: status(browser, address + path)) == 403


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},
        {"Host": "evil.example"},
        {"Host": "127.0.0.1"},
    ],
)
def test_other_origins_and_names_are_refused_token_or_not(tmp_path: Path, headers: dict[str, str]) -> None:
    async def what(browser: ClientSession, address: str) -> None:
        await logged_in(browser, address)
        assert await status(browser, f"{address}/index.html", headers=headers) == 403
        post = {"method": "POST", "data": b"x", "headers": headers}
        assert await status(browser, f"{address}/open?name=a.xyz", **post) == 403

    talk(tmp_path, what)


@pytest.mark.parametrize(
    "path",
    ["/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/..%2f..%2fetc%2fpasswd", "/take/../../etc/passwd"],
)
def test_no_path_leads_out(tmp_path: Path, path: str) -> None:
    async def what(browser: ClientSession, address: str) -> None:
        await logged_in(browser, address)
        assert await status(browser, address + path) in (403, 404)

    talk(tmp_path, what)


def test_names_of_sent_files_do_not_lead_out(tmp_path: Path) -> None:
    opened: list[bytes] = []

    async def what(browser: ClientSession, address: str) -> None:
        await logged_in(browser, address)
        for name in ("..%2f..%2fevil.xyz", "%2fetc%2fevil.xyz", "..%5cevil.xyz"):
            assert await status(browser, f"{address}/open?name={name}", method="POST", data=b"1 2 3") == 200
        for name in ("", "..", "%2f"):
            assert await status(browser, f"{address}/open?name={name}", method="POST", data=b"1 2 3") == 400

    talk(tmp_path, what, opened)
    assert opened == [b"1 2 3"] * 3
    assert not list(tmp_path.parent.glob("evil*")) and {p.name for p in tmp_path.iterdir()} == {"www"}


def test_files_that_are_too_large_are_refused_before_they_are_read(tmp_path: Path) -> None:
    opened: list[bytes] = []

    async def endless() -> Any:
        for _ in range(50):
            yield b"x" * 100

    async def what(browser: ClientSession, address: str) -> None:
        await logged_in(browser, address)
        host = address.removeprefix("http://").split(":")
        reader, writer = await asyncio.open_connection(host[0], int(host[1]))
        [cookie] = browser.cookie_jar
        writer.write(
            f"POST /open?name=a.ply HTTP/1.1\r\nHost: {host[0]}:{host[1]}\r\n"
            f"Cookie: {cookie.key}={cookie.value}\r\nContent-Length: {2 * 2**30}\r\n\r\n".encode()
        )
        assert b" 413 " in await reader.readline(), "2 GB, of which nothing was sent"
        writer.close()
        how = {"method": "POST", "data": endless()}
        assert await status(browser, f"{address}/open?name=a.ply", **how) == 413, (
            "which does not say how long it is"
        )

    talk(tmp_path, what, opened)
    assert opened == []


def test_damaged_files_and_unknown_kinds_are_told(tmp_path: Path) -> None:
    async def what(browser: ClientSession, address: str) -> None:
        await logged_in(browser, address)
        async with browser.post(f"{address}/open?name=a.ply", data=b"damaged") as answer:
            assert answer.status == 400 and await answer.text() == "a.ply: expected points"
        assert await status(browser, f"{address}/take?kind=x") == 400
        async with browser.get(f"{address}/take?kind=step&ridge=seam") as answer:
            assert answer.headers["Content-Disposition"] == 'attachment; filename="ridge-1.step"'
            assert await answer.text() == "seam"

    talk(tmp_path, what)


@pytest.mark.parametrize(
    ("host", "origin", "allowed"),
    [
        ("127.0.0.1:80", None, True),
        ("localhost:80", "http://localhost:80", True),
        ("LOCALHOST", "http://127.0.0.1", True),
        ("[::1]:80", None, True),
        ("localhost:81", None, False),
        ("localhost:80", "https://localhost:80", False),
        ("localhost:80", "http://localhost:81", False),
        ("localhost.evil.example", None, False),
        ("", None, False),
    ],
)
def test_names_under_which_the_page_is_asked(host: str, origin: str | None, allowed: bool) -> None:
    assert (refusal(host, origin, LOOPBACK, 80) == "") is allowed
