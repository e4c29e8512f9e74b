"""viser's server: on which address, which web pages may talk to it, and what it prints.

These are its own pages, and no other that is open in a browser.
"""

from __future__ import annotations

import contextlib
import http
import io
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from poise.configs.errors import ConfigError, PoiseError
from poise.configs.extras import how_to_install
from poise.training.running.stopping import stop_code

if TYPE_CHECKING:
    import viser
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

LOOPBACK = ("127.0.0.1", "localhost", "::1")
Answer = Callable[["ServerConnection", "Request"], "Response | None"]
STOPPING = 0.3  # [s] that a server is given to end; then the end of the process ends it


def check_installed() -> None:
    """Raises PoiseError, which says how to install them, without viser and mjviser."""
    try:
        import mjviser  # noqa: F401
        import viser  # noqa: F401
    except ImportError as error:
        raise PoiseError(
            f"poise view needs the packages viser and mjviser ({error}): {how_to_install('view')}; "
            "or --native, MuJoCo's window"
        ) from None


def check_port(host: str, port: int) -> None:
    """Raises ConfigError where nothing can listen there; port 0 is any that is free."""
    if not 0 <= port <= 65535:
        raise ConfigError(f"must be from 0 to 65535, not {port}", field="port")
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except socket.gaierror as error:
        raise ConfigError(f"no such address: {host} ({error.strerror})", field="host") from None
    except OSError as error:
        reason = f"{port} on {host} cannot be had ({error.strerror}); give another, or 0 for any"
        raise ConfigError(reason, field="port") from None


def own_page(origin: str | None, host: str | None, loopback: bool) -> bool:
    """Whether a request comes from a page of the server that it asks.

    A browser names the page in `origin` and the server in `host`; a program that is no browser
    names no page. At a loopback address the server has a name of this machine alone: another one
    that leads here was made to.
    """
    if loopback and urlsplit(f"//{host}").hostname not in LOOPBACK:
        return False
    return origin is None or urlsplit(origin).netloc == host


class Visits:
    """Who is told of a page that is opened: `opened(query)` of its address, in any thread.

    What it raises as PoiseError is the answer instead of the page.
    """

    def __init__(self) -> None:
        self.opened: Callable[[str], object] = lambda query: None

    def refusal(self, request: Request) -> str | None:
        """Tell of a request if it opens the page, not one of its files; what is wrong with it."""
        path, headers = urlsplit(request.path), request.headers
        page = path.path in ("/", "/index.html") and "Upgrade" not in headers
        # a picture in somebody else's page is none that a user has opened
        if not page or headers.get("Sec-Fetch-Dest", "document") != "document":
            return None
        try:
            self.opened(path.query)
        except PoiseError as error:
            return f"{error}\n"
        return None


@contextlib.contextmanager
def own_pages_only(loopback: bool, visits: Visits) -> Iterator[None]:
    """Have servers that are started meanwhile refuse what is not of their own pages, by 403.

    `visits` is told of pages that are opened; what it refuses is answered by 404.

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


@contextlib.contextmanager
def serving(host: str, port: int, visits: Visits | None = None) -> Iterator[viser.ViserServer]:
    """A server that ends with the block; raises ConfigError as `check_port`.

    `visits` is told of pages that are opened.
    """
    check_port(host, port)
    import viser

    with _silent(), own_pages_only(host in LOOPBACK, visits or Visits()):
        server = viser.ViserServer(host, port, label="Poise", verbose=False)
    # A page could ask for a tunnel to the outside; nobody but the user decides who may look on.
    server.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]
    try:
        yield server
    finally:
        with _silent():
            ending = threading.Thread(target=server.stop, daemon=True)
            ending.start()
            ending.join(STOPPING)


@contextlib.contextmanager
def until_ctrl_c() -> Iterator[None]:
    """Ctrl-C ends the block, as it is meant to be ended; SIGTERM ends the command."""
    try:
        yield
    except KeyboardInterrupt:
        if stop_code() == 128 + signal.SIGTERM:
            raise


def greeting(host: str, port: int, link: str = "") -> list[str]:
    """What is said at the start: the address, who can reach it, and how from elsewhere.

    `link` is what stands in the address behind the server.
    """
    url = f"http://{f'[{host}]' if ':' in host else host}:{port}{link}"
    if host not in LOOPBACK:
        return [url, f"reachable by everybody who can reach {host}: there is no password"]
    return [
        url,
        "reachable from this machine alone; from another one: "
        f"ssh -L {port}:localhost:{port} THIS_MACHINE, then http://localhost:{port} there",
    ]


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """viser prints what `greeting` says better."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
