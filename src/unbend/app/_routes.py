"""What the app's server answers, and whom: only pages that know the token.

The page is our own, on Starlette: frameworks such as NiceGUI need what a strict content security
policy forbids.
"""

from __future__ import annotations

import asyncio
import json
import math
import secrets
import time
from importlib.resources import files
from typing import Any

from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route

from unbend.app._session import Session
from unbend.errors import InputError

_MOST_JSON = 2**20  # bytes of a request that is no file
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data: blob:; frame-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
# Pages of results have their own policy in them; in this sandbox they cannot call the app.
_PAGE_POLICY = "sandbox allow-scripts allow-downloads; frame-ancestors 'self'"
_HEADERS = [
    (b"cache-control", b"no-store"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"referrer-policy", b"same-origin"),
    (b"x-content-type-options", b"nosniff"),
]
_ASSETS = {
    "": ("unbend.app", "app.html", "text/html"),
    "app.js": ("unbend.app", "app.js", "text/javascript"),
    "app.css": ("unbend.app", "app.css", "text/css"),
    "page.css": ("unbend.report.pages", "page.css", "text/css"),
}


def make_app(session: Session, tabs: dict[str, float], token: str, port: int, lifetime: Any) -> Any:
    """Make the ASGI application; `tabs` gets when each open page was last heard of."""

    async def asset(request: Request) -> Response:
        package, name, kind = _ASSETS[request.path_params.get("name", "")]
        text = files(package).joinpath(name).read_text("utf-8")
        headers = {"Content-Security-Policy": _POLICY}
        return PlainTextResponse(text, media_type=kind, headers=headers)

    async def state(request: Request) -> Response:
        if tab := request.query_params.get("tab", "")[:40]:
            tabs[tab] = time.monotonic()
        return JSONResponse(session.state(_number(request.query_params.get("seen", ""))))

    async def bye(request: Request) -> Response:
        if (tab := request.query_params.get("tab", "")) in tabs:
            tabs[tab] = -math.inf
        return JSONResponse(None)

    async def upload(request: Request) -> Response:
        asked, values = request.query_params, request.query_params.get("as") == "values"
        size = _number(request.headers.get("content-length", ""))
        path, label, room = session.new_upload(asked.get("name", ""), size, values=values)
        try:
            with path.open("wb") as opened:
                async for chunk in request.stream():
                    room -= len(chunk)
                    if room < 0:
                        raise InputError(f"{label} is too large")
                    opened.write(chunk)
            return JSONResponse({"id": session.add(path, label, values=values)})
        except (InputError, ClientDisconnect):
            path.unlink()
            raise
        except OSError as error:  # the disk is full
            path.unlink(missing_ok=True)
            raise InputError(f"{label} cannot be kept: {error.strerror}") from None

    async def submit(request: Request) -> Response:
        return JSONResponse({"id": session.submit(await _asked(request))})

    async def turn(request: Request) -> Response:
        session.turn((await _asked(request)).get("up"))
        return JSONResponse(None)

    async def open_found(request: Request) -> Response:
        return JSONResponse({"id": session.open_found(**request.path_params)})

    async def remove(request: Request) -> Response:
        await asyncio.to_thread(session.remove, **request.path_params)
        return JSONResponse(None)

    async def page(request: Request) -> Response:
        path, name = session.page(**request.path_params)
        saved = name if "save" in request.query_params else None
        headers = {"Content-Security-Policy": _PAGE_POLICY}
        return FileResponse(path, filename=saved, headers=headers)

    async def file(request: Request) -> Response:
        path, name = session.file(**request.path_params)
        return FileResponse(path, filename=name)

    async def refused(request: Request, error: Exception) -> Response:
        return JSONResponse({"error": str(error)}, status_code=400)

    async def missing(request: Request, error: Exception) -> Response:
        return JSONResponse({"error": "that is not there any more"}, status_code=404)

    routes = [
        Route("/", asset),
        Route("/state", state),
        Route("/bye", bye, methods=["POST"]),
        Route("/up", turn, methods=["PUT"]),
        Route("/files", upload, methods=["PUT"]),
        Route("/jobs", submit, methods=["POST"]),
        Route("/{kind}/{i:int}", remove, methods=["DELETE"]),
        Route("/shapes/{i:int}/{kind}", file),
        Route("/results/{i:int}/page", page),
        Route("/results/{i:int}/found/{n:int}", open_found, methods=["POST"]),
        Route("/results/{i:int}/{kind}/{n:int}", file),
        Route("/{name}", asset),
    ]
    handlers: Any = {InputError: refused, LookupError: missing, RuntimeError: missing}
    mount = Mount(f"/{token}", routes=routes)
    app = Starlette(routes=[mount], exception_handlers=handlers, lifespan=lifetime)
    return _guarded(app, token, port)


def _guarded(app: Any, token: str, port: int) -> Any:
    """Refuse requests of other pages, names and addresses, and add headers to all answers."""
    names = [f"{name}:{port}" for name in ("127.0.0.1", "localhost")]
    hosts = {name.encode(): f"http://{name}".encode() for name in names}

    async def guarded(scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] != "http":
            await app(scope, receive, send)
            return
        given = dict(scope["headers"])
        host, origin = given.get(b"host", b""), given.get(b"origin")
        foreign = origin not in (None, hosts.get(host))
        foreign |= given.get(b"sec-fetch-site", b"none") not in (b"same-origin", b"none")
        changes = scope["method"] not in ("GET", "HEAD")
        first = scope["path"].lstrip("/").split("/")[0]
        known = secrets.compare_digest(first.encode(), token.encode())
        answer, refusal = app, "unbend app: open the address that the command printed"
        if host not in hosts or foreign or (changes and origin is None):
            answer = PlainTextResponse(refusal, 403)
        elif not known:
            answer = PlainTextResponse(refusal, 404)

        async def send_with_headers(message: Any) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *_HEADERS]
            await send(message)

        await answer(scope, receive, send_with_headers)

    return guarded


async def _asked(request: Request) -> Any:
    """Read a JSON object of bounded size."""
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > _MOST_JSON:
            raise InputError("this request is too long")
    try:
        found = json.loads(body)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise InputError("this request is no JSON of the kind that is expected here")
    return found


def _number(text: str) -> int:
    return int(text) if text.isdecimal() and len(text) < 16 else -1
