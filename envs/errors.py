"""Exceptions that a user of Poise may catch; all share one base class."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path


class PoiseError(Exception):
    """Base class of every error that Poise raises on purpose.

    Its text is one line for a person to read; the command line prints it and exits with code 2.
    """


class ConfigError(PoiseError):
    """A file, a field or a value given by the user is not valid.

    The text names the file, the field, what is wrong, and the valid choices, in this order.

    Args:
        message: what is wrong.
        source: the file, or another name of the place that the value came from.
        field: dotted path of the field, such as ``weights.com``.
        choices: the values that would have been valid.
    """

    def __init__(
        self,
        message: str,
        *,
        source: str | Path | None = None,
        field: str | None = None,
        choices: Iterable[object] | None = None,
    ) -> None:
        self.message = " ".join(message.split())
        self.source = None if source is None else str(source)
        self.field = field
        self.choices = None if choices is None else tuple(str(choice) for choice in choices)
        text = ": ".join(part for part in (self.source, self.field, self.message) if part)
        if self.choices is not None:
            text += f" (choices: {', '.join(self.choices) or 'none'})"
        super().__init__(text)
