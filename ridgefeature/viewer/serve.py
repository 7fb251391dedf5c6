"""The page's server: on the loopback address, for who has the token in its address."""

from __future__ import annotations

import asyncio
import os
import secrets
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ridgefeature.scan import MILLIMETRES
from ridgefeature.viewer.guard import LOOPBACK, add_headers, guard
from ridgefeature.viewer.page import HINT, TOLD, Page
from ridgefeature.viewer.routes import routes
from ridgefeature.viewer.scene import Scene
from ridgefeature.viewer.sizes import FIELDS
from ridgefeature.viewer.work import Work

UPLOAD = 2**30
"""Bytes of the largest file that the page takes."""
_SOON = 1.0
"""Seconds for which the page waits for its first scan."""
_HERE = Path(__file__).parent


def serve(
    scan: Path | None = None,
    unit: str | None = None,
    host: str = "127.0.0.1",
    port: int = 0,
    upload: int = UPLOAD,
    ready: Callable[[str], None] = print,
) -> None:
    """Serve the page until it is interrupted.

    scan: a file to open first; host, port: address, 0 for a free port; upload: bytes of the largest file that
    may be sent; ready: called with the page's address, once it is there. Raises ValueError or OSError where
    the scan is none.
    """
    os.environ.setdefault("WSLINK_READY_MSG", "")  # which else is printed
    from trame.app import get_server

    server = get_server("ridgefeature", client_type="vue3")
    scene, token = Scene(), secrets.token_urlsafe(24)
    page = Page(server.state, scene, lambda: view.update())
    work = Work(page, Path.cwd())
    view = _markup(server, scene, work.files())
    for name, what in triggers(page, work).items():
        server.controller.trigger(name)(what)

    _watch(server, page, work)
    wrong: list[Exception] = []
    with tempfile.TemporaryDirectory(prefix="ridgefeature-") as folder:
        names = LOOPBACK if host in ("127.0.0.1", "localhost", "::1") else (*LOOPBACK, host)

        def bind(web: Any) -> None:
            web.app.middlewares.append(guard(token, upload, names))
            web.app.on_response_prepare.append(add_headers)
            web.app.add_routes(routes(work, Path(folder), upload))

        async def begun(**_: Any) -> None:
            asyncio.get_running_loop().set_exception_handler(_unless_gone)
            try:
                await _opened(work, scan, unit, lambda: ready(f"http://{host}:{server.port}/?token={token}"))
            except Exception as error:  # whatever it is, there is no page to tell it on
                wrong.append(error)
                await server.stop()
                return
            await work.warm()

        server.controller.on_server_bind.add(bind)
        server.controller.on_server_ready.add_task(begun)
        server.start(
            host=host,
            port=port,
            timeout=0,
            open_browser=False,
            show_connection_info=False,
            disable_logging=True,
        )
    if wrong:
        raise wrong[0]


async def _opened(work: Work, scan: Path | None, unit: str | None, show: Callable[[], None]) -> None:
    """Open the first scan, and show the page; what is soon found to be no scan has none shown."""
    if scan is None:
        show()
        return
    opening = asyncio.ensure_future(work.open(scan, scan.name, unit))
    await asyncio.wait({opening}, timeout=_SOON)
    if not opening.done() or not opening.exception():
        show()
    await opening


def _watch(server: Any, page: Page, work: Work) -> None:
    """Follow what is changed on the page besides what it asks for."""

    @server.state.change(*FIELDS)
    def edited(**told: Any) -> None:
        if page.sizes.edited({field: told[field] for field in FIELDS}):
            work.preview.again()

    @server.state.change("host", "part_turn")
    def placed(**_: Any) -> None:
        work.preview.again()


def _markup(server: Any, scene: Scene, files: list[str]) -> Any:
    """Lay the page out; returns its view. files: those of the working folder that it may open."""
    from trame.ui.html import DivLayout
    from trame.widgets import html
    from trame.widgets import vtk as vtk_widgets

    own = {"naming": "", "units": list(MILLIMETRES), "trame__title": "ridgefeature"}
    server.state.update(TOLD | own | {"files": files})
    server.state.client_only("naming")
    server.enable_module(
        {"serve": {"own": str(_HERE / "assets")}, "scripts": ["own/page.js"], "styles": ["own/page.css"]}
    )
    with DivLayout(server) as layout:
        view = vtk_widgets.VtkRemoteView(
            scene.window, ref="view", interactive_quality=70, still_quality=92, interactive_ratio=1,
            style="width: 100%; height: 100%;",
        )  # fmt: skip
        markup = view.html
        layout.root.clear()
        text = (_HERE / "page.html").read_text(encoding="utf-8")
        html.Div(text.replace("<!--view-->", markup))
    return view


def triggers(page: Page, work: Work) -> dict[str, Callable[..., None]]:
    """All that the page may ask for. What takes long is begun, and asked for by nobody twice."""

    def begin(what: Callable[..., Any]) -> Callable[..., None]:
        def begun(*values: Any) -> None:
            asyncio.get_running_loop().create_task(_reported(page, what, *values))

        return begun

    def then_pasted(what: Callable[..., None]) -> Callable[..., None]:
        def done(*values: Any) -> None:
            _told(page, what, *values)
            if what in changing:
                work.preview.again()

        return done

    sizes = page.sizes
    changing = (
        sizes.reset,
        sizes.stretch,
        sizes.bound,
        sizes.whole,
        page.undo,
        page.redo,
        page.choose,
        page.remove,
    )
    return {
        **{name: then_pasted(what) for name, what in page.triggers().items()},
        "click": begin(work.click),
        "paste": begin(work.preview.paste),
        "leave": work.preview.leave,
        "stop": work.stop,
        "failed": lambda text: page.say(str(text), bad=True),
        "sending": lambda name, size: page.say(f"Sending {name}, {int(size):,} bytes"),
        "open": begin(work.open_by_name),
    }


def _unless_gone(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """A page that was closed while a picture was on its way is no fault."""
    if not isinstance(context.get("exception"), ConnectionError):
        loop.default_exception_handler(context)


def _told(page: Page, what: Callable[..., None], *values: Any) -> None:
    """Done; what was wrong with it is told on the page, until something goes right."""
    told, wrong = page.tell.hint, page.tell.bad
    quiet = what in (page.hover, page.away, page.point, page.rest)
    page.tell.bad = wrong and quiet
    try:
        what(*values)
    except (ValueError, TypeError, KeyError) as error:
        page.say(str(error), bad=True)
    else:
        if wrong and not quiet and not page.tell.bad and page.tell.hint == told:
            page.say("" if page.tell.pasting else HINT)


async def _reported(page: Page, what: Callable[..., Any], *values: Any) -> None:
    try:
        await what(*values)
    except (ValueError, TypeError, OSError) as error:
        page.say(str(error), bad=True)
    finally:
        page.tell.flush()
