"""Which web pages may talk to the server: its own, and no other that is open in a browser."""

from __future__ import annotations

import contextlib
import http
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from poise.configs.errors import PoiseError

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

LOOPBACK = ("127.0.0.1", "localhost", "::1")
Answer = Callable[["ServerConnection", "Request"], "Response | None"]


def own_page(origin: str | None, host: str | None, loopback: bool) -> bool:
    """Return whether a request comes from a page of the server that it asks.

    A browser names the page in `origin` and the server in `host`; a program that is no browser
    names no page. At a loopback address the server has a name of this machine alone: another one
    that leads here was made to.
    """
    if loopback and urlsplit(f"//{host}").hostname not in LOOPBACK:
        return False
    return origin is None or urlsplit(origin).netloc == host


class Visits:
    """Called for a page that is opened: `opened(query)` with its address, in any thread.

    What it raises as PoiseError is the answer instead of the page.
    """

    def __init__(self) -> None:
        self.opened: Callable[[str], object] = lambda query: None

    def refusal(self, request: Request) -> str | None:
        """Tell of a request if it opens the page, not one of its files; what is wrong with it."""
        path, headers = urlsplit(request.path), request.headers
        page = path.path in ("/", "/index.html") and "Upgrade" not in headers
        # a frame embedded in another site's page was not opened by the user
        if not page or headers.get("Sec-Fetch-Dest", "document") != "document":
            return None
        try:
            self.opened(path.query)
        except PoiseError as error:
            return f"{error}\n"
        return None


@contextlib.contextmanager
def own_pages_only(loopback: bool, visits: Visits) -> Iterator[None]:
    """Make servers started in the block answer 403 to requests from other pages.

    `visits` is called for pages that are opened; one that it refuses is answered by 404.

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
            if (refusal := visits.refusal(request)) is not None:
                return connection.respond(http.HTTPStatus.NOT_FOUND, refusal)
            return None if process_request is None else process_request(connection, request)

        return serve(*arguments, process_request=answer, **settings)

    server.serve = guarded  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        server.serve = serve  # type: ignore[misc]
