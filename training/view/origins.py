"""Which web pages may talk to the server: its own, and no other that is open in a browser."""

from __future__ import annotations

import contextlib
import http
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

LOOPBACK = ("127.0.0.1", "localhost", "::1")
Answer = Callable[["ServerConnection", "Request"], "Response | None"]


def own_page(origin: str | None, host: str | None, loopback: bool) -> bool:
    """Whether a request comes from a page of the server that it asks.

    A browser names the page in `origin` and the server in `host`; a program that is no browser
    names no page. At a loopback address the server has a name of this machine alone: another one
    that leads here was made to.
    """
    if loopback and urlsplit(f"//{host}").hostname not in LOOPBACK:
        return False
    return origin is None or urlsplit(origin).netloc == host


@contextlib.contextmanager
def own_pages_only(loopback: bool) -> Iterator[None]:
    """Have servers that are started meanwhile refuse what is not of their own pages, by 403.

    viser has no such setting: it calls `websockets.asyncio.server.serve`, which is wrapped here for
    as long as a server starts.
    """
    from websockets.asyncio import server

    serve = server.serve

    def guarded(*arguments: Any, process_request: Answer | None = None, **settings: Any) -> Any:
        def answer(connection: ServerConnection, request: Request) -> Response | None:
            origin, host = (request.headers.get(name) for name in ("Origin", "Host"))
            if not own_page(origin, host, loopback):
                return connection.respond(http.HTTPStatus.FORBIDDEN, "this is another's page\n")
            return None if process_request is None else process_request(connection, request)

        return serve(*arguments, process_request=answer, **settings)

    server.serve = guarded  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        server.serve = serve  # type: ignore[misc]
