"""The app's server: loopback only, and only for pages that know the token."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import socket
import time
import webbrowser
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from typing import Any

from unbend._memory import available_memory
from unbend.app._session import Session, remove_dead
from unbend.errors import InputError, MissingExtraError

_SHARE_OF_MEMORY = 0.8
_CLOSED_SECONDS, _SILENT_SECONDS = 8.0, 600.0


def serve(
    paths: Sequence[str],
    *,
    port: int = 0,
    collection: str | None = None,
    ready: Callable[[str], object] = webbrowser.open,
) -> None:
    """Run the app until Ctrl-C, or until its last page has been closed.

    It begins with the shapes in some files, and searches the collection in a folder. The port is
    one of 127.0.0.1; 0 takes any that is free. Once the server listens, `ready` is called with its
    address. Raises InputError if the port is taken, and MissingExtraError if Starlette or uvicorn
    is not installed.
    """
    try:
        import starlette  # noqa: F401
        import uvicorn

        from unbend.app._routes import make_app
    except ImportError:
        raise MissingExtraError("uvicorn", "starlette") from None
    remove_dead()
    try:
        listener = socket.create_server(("127.0.0.1", port))
    except (OSError, OverflowError):
        raise InputError(f"port {port} is in use, or not allowed; leave out --port") from None
    with listener:
        port = listener.getsockname()[1]
        token = secrets.token_urlsafe(24)
        address = f"http://127.0.0.1:{port}/{token}/"
        session = Session(port, int(_SHARE_OF_MEMORY * (available_memory() or 2**34)), collection)
        try:
            for path in paths:
                session.add(Path(path).absolute(), Path(path).name)
            tabs: dict[str, float] = {}

            @contextlib.asynccontextmanager
            async def lifetime(app: Any) -> AsyncIterator[None]:
                opening = asyncio.create_task(asyncio.to_thread(ready, address))
                watch = asyncio.create_task(_stop_when_closed(server, tabs))
                yield
                watch.cancel()
                opening.cancel()
                session.close()  # before the signal that ended the server is raised again

            settings = uvicorn.Config(
                make_app(session, tabs, token, port, lifetime),
                ws="none",
                log_level="warning",
                access_log=False,
                server_header=False,
                timeout_graceful_shutdown=1,
            )
            server = uvicorn.Server(settings)
            with contextlib.suppress(KeyboardInterrupt):
                server.run(sockets=[listener])
        finally:
            session.close()


async def _stop_when_closed(server: Any, tabs: dict[str, float]) -> None:
    """End the server some seconds after the last page was closed; `tabs` has when it spoke."""
    heard = time.monotonic()
    while True:
        await asyncio.sleep(0.5)
        now = time.monotonic()
        if not tabs or max(tabs.values()) > now - _SILENT_SECONDS:
            heard = now
        if now - heard > _CLOSED_SECONDS:
            server.should_exit = True
