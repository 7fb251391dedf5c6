"""What the page fetches and sends besides its state: files that are opened, and files that are taken away."""

from __future__ import annotations

import tempfile
from pathlib import Path, PurePath

from aiohttp import web

from ridgefeature.viewer.work import Work

_CHUNK = 2**20


def routes(work: Work, folder: Path, limit: int) -> list[web.RouteDef]:
    """POST /open and GET /take. folder: where files are kept while they are needed; limit: bytes of one."""

    async def open_file(request: web.Request) -> web.Response:
        """A file's bytes, to be parsed as any other; ?name= tells its format."""
        name = PurePath(request.query.get("name", "").replace("\\", "/")).name
        if name in ("", ".", ".."):
            raise web.HTTPBadRequest(text="expected the file's name, got none; send ?name=scan.ply")
        with tempfile.TemporaryDirectory(dir=folder) as own:
            path = Path(own) / name
            await _receive(request, path, limit)
            try:
                if request.query.get("for") == "host":
                    await work.preview.open_host(path, name)
                else:
                    await work.open(path, name)
            except (ValueError, OSError) as error:
                raise web.HTTPBadRequest(text=str(error).replace(own, "").lstrip("/")) from error
        return web.json_response({"opened": name})

    async def take(request: web.Request) -> web.StreamResponse:
        """A file to take away: ?kind= one of takeaway.KINDS, "page" or "part"; ?ridge= its name."""
        own = Path(tempfile.mkdtemp(dir=folder))
        try:
            path = await work.take(request.query.get("kind", ""), request.query.get("ridge", ""), own)
            response = web.StreamResponse(
                headers={
                    "Content-Disposition": f'attachment; filename="{path.name}"',
                    "Content-Type": "application/octet-stream",
                    "Content-Length": str(path.stat().st_size),
                }
            )
            await response.prepare(request)
            with path.open("rb") as file:
                while chunk := file.read(_CHUNK):
                    await response.write(chunk)
            await response.write_eof()
            return response
        except (ValueError, OSError) as error:
            raise web.HTTPBadRequest(text=str(error)) from error
        finally:
            for left in own.iterdir():
                left.unlink()
            own.rmdir()

    return [
        web.post("/open", open_file),
        web.get("/take", take),
        web.post("/paraview/", _session),
    ]


async def _session(request: web.Request) -> web.Response:
    """Where the page's client finds its session: it asks for a launcher's first."""
    return web.json_response({"sessionURL": f"ws://{request.host}/ws"})


async def _receive(request: web.Request, path: Path, limit: int) -> None:
    """The body of a request, as a file. Refused when it is longer than it may be, whatever it said before."""
    size = 0
    with path.open("wb") as file:
        async for chunk in request.content.iter_chunked(_CHUNK):
            size += len(chunk)
            if size > limit:
                raise web.HTTPRequestEntityTooLarge(limit, size, text=f"expected at most {limit:,} bytes")
            file.write(chunk)
