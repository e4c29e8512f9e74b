"""viser's server: on which address, and what it prints."""

from __future__ import annotations

import contextlib
import io
import signal
import socket
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING

from poise.configs.errors import ConfigError, PoiseError
from poise.configs.extras import how_to_install
from poise.configs.problems import out_of_range
from poise.training.running.stopping import stop_code

from .origins import LOOPBACK, Visits, own_pages_only

if TYPE_CHECKING:
    import viser

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
        raise out_of_range(port, field="port", least=0, most=65535)
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


@contextlib.contextmanager
def serving(host: str, port: int, visits: Visits | None = None) -> Iterator[viser.ViserServer]:
    """A server that ends with the block; raises ConfigError as `check_port`.

    `visits` is called for pages that are opened.
    """
    check_port(host, port)
    import viser

    with _silent(), own_pages_only(host in LOOPBACK, visits or Visits()):
        server = viser.ViserServer(host, port, label="Poise", verbose=False)
    # A page could request a tunnel to the outside; only the user may allow other viewers.
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
    """Suppress viser's own greeting; `greeting` replaces it."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
