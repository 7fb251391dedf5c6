"""Who may talk to the page: this machine's own browser, with the token that its address had.

A page of another site can send requests to a loopback address, too. It knows no token, its `Origin` is
another, and a name that it has made lead here is told by `Host`.
"""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable
from urllib.parse import urlsplit

from aiohttp import web

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; worker-src 'self' blob:; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self' ws: wss:; frame-ancestors 'none'; form-action 'self'; base-uri 'self'"
)
HEADERS = {
    "Content-Security-Policy": _POLICY,
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


def refusal(host: str, origin: str | None, names: tuple[str, ...], port: int) -> str:
    """Why a request is refused by the names it was sent to and from; "" if it is not.

    host, origin: its headers; names: under which the page may be reached, at a port.
    """
    allowed = {f"{name}:{port}" for name in names} | (set(names) if port == 80 else set())
    if host.lower() not in allowed:
        return (
            f"expected to be asked as {names[0]}:{port}, was as {host!r}; open the address that was printed"
        )
    if origin is not None and (
        urlsplit(origin).scheme != "http" or urlsplit(origin).netloc.lower() not in allowed
    ):
        return f"another origin, {origin!r}, may not ask here"
    return ""


def guard(
    token: str, limit: int, names: tuple[str, ...] = LOOPBACK
) -> Callable[..., Awaitable[web.StreamResponse]]:
    """Middleware for aiohttp that lets through who has the token, and no more bytes than `limit`.

    The token comes in the address first, `?token=...`, and in a cookie from then on, which no other site's
    request carries.
    """

    @web.middleware
    async def check(request: web.Request, handler: Handler) -> web.StreamResponse:
        port = int(request.get_extra_info("sockname", ("", 0))[1])
        why = refusal(request.headers.get("Host", ""), request.headers.get("Origin"), names, port)
        if why:
            raise web.HTTPForbidden(text=why)
        cookie = f"ridgefeature-{port}"
        given = request.query.get("token", "")
        if hmac.compare_digest(given.encode(), token.encode()):
            answer = web.HTTPFound("/index.html" if request.path == "/" else request.path)
            answer.set_cookie(cookie, token, httponly=True, samesite="Strict")
            raise answer
        if not hmac.compare_digest(request.cookies.get(cookie, "").encode(), token.encode()):
            raise web.HTTPForbidden(
                text="expected the token of this page; open the address that was printed, with all of it"
            )
        if (request.content_length or 0) > limit:
            raise web.HTTPRequestEntityTooLarge(
                limit, request.content_length or 0, text=f"expected a file of at most {limit:,} bytes"
            )
        return await handler(request)

    return check


async def add_headers(_: web.Request, response: web.StreamResponse) -> None:
    """Headers that keep the page to itself: nothing is fetched from elsewhere, nobody frames it."""
    for name, value in HEADERS.items():
        response.headers.setdefault(name, value)
