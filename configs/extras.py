"""The extras of the package, and how they are installed."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import ConfigError


def how_to_install(extra: str) -> str:
    """Return the command that installs an extra such as "view", for a message or a docstring.

    Poise is on no index yet: it runs in the checkout that Poise is installed from.
    """
    return f"pip install -e '.[{extra}]' in the checkout of Poise"


@contextmanager
def needing(extra: str, source: str | Path | None = None) -> Iterator[None]:
    """Import an extra's packages in the block; raise ConfigError with the install command.

    `source` is what the error is of.
    """
    try:
        yield
    except ImportError as error:
        raise ConfigError(
            f"needs the package {error.name or error}: {how_to_install(extra)}", source=source
        ) from None
