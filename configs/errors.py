"""Exceptions that a user of Poise may catch; all share one base class."""

import difflib
import re
import reprlib
import sysconfig
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path

LONGEST_TEXT = 1220  # characters of each part of an error
LONGEST_VALUE = 160  # characters of a value in an error
MOST_CHOICES = 90
_BREAKS = re.compile(r"\s*[\n\r\v\f\x1c-\x1e\x85\u2028\u2029]\s*")


def one_line(text: str, limit: int = LONGEST_TEXT) -> str:
    """The text in one line that can be printed, its middle left out beyond `limit` characters."""
    if len(text) > limit:
        text = f"{text[: 2 * limit // 3]} … {text[-(limit // 3) :]}"
    text = _BREAKS.sub(" ", text)
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def shown(value: object) -> str:
    """The value for an error, as `repr` but short, and quick for whatever anybody may give."""
    return one_line(_short.repr(value), LONGEST_VALUE)


def meant(name: object, names: Iterable[str]) -> str:
    """What an error about `name` adds: the one of the valid `names` that it looks like, if any.

    A word of a name will do: ``g1`` is ``unitree_g1``.
    """
    names, text = list(names), str(name)[:LONGEST_VALUE]
    near = difflib.get_close_matches(text, names, n=1)
    near = near or [each for each in names if text.lower() in re.split(r"\W|_", each.lower())]
    return f", did you mean {one_line(near[0], LONGEST_VALUE)}?" if near else ""


def raised(error: BaseException) -> str:
    """Return an exception of user code in one line: its class, its text, its place.

    The place, ``file.py:12``, is the last line that ran of code that is neither of Poise nor of an
    installed library; of a class that is itself installed, the line that Poise called.
    """
    text = one_line(f"{type(error).__name__}: {error}")
    frames = [
        (frame.f_code.co_filename, line)
        for frame, line in traceback.walk_tb(error.__traceback__)
        if str(frame.f_globals.get("__name__")).partition(".")[0] != "poise"
    ]
    own = [each for each in frames if not _INSTALLED.search(each[0]) and _STDLIB not in each[0]]
    if not frames:
        return text
    file, line = own[-1] if own else frames[0]
    return f"{text} ({one_line(Path(file).name)}:{line})"


#: files of libraries, and what has no file
_INSTALLED, _STDLIB = re.compile(r"[/\\](site|dist)-packages[/\\]|^<"), sysconfig.get_path("stdlib")


class _Short(reprlib.Repr):
    """Three levels of a value, the first few entries of each."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxstring, self.maxother = 3, 100, 140

    def repr_int(self, x: int, level: int) -> str:
        digits = int(x.bit_length() * 0.30103) + 1  # log10(2)
        return repr(x) if digits <= 40 else f"a whole number of about {digits} digits"


_short = _Short()


class PoiseError(Exception):
    """Base class of every error that Poise raises on purpose.

    Its text is one line for a person to read; the command line prints it and exits with code 2.
    """

    def __init__(self, text: object = "") -> None:
        super().__init__(one_line(str(text), 4 * LONGEST_TEXT))


class WriteError(PoiseError):
    """A file or a folder cannot be written.

    Args:
        path: of the file or folder.
        reason: the operating system's, or what it is instead.
    """

    def __init__(self, path: str | Path, reason: str | None) -> None:
        self.path, self.reason = str(path), reason
        super().__init__(f"{path}: cannot be written ({reason})")

    def __reduce__(self) -> tuple[type, tuple[str, str | None]]:
        return type(self), (self.path, self.reason)


class PoiseWarning(UserWarning):
    """Something of a user's file is not used as it is written; the text says what instead."""


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
        self.message = one_line(message)
        self.source = None if source is None else str(source)
        self.field = field
        self.choices = None if choices is None else tuple(str(choice) for choice in choices)
        parts = (self.source, self.field, self.message)
        text = ": ".join(one_line(part) for part in parts if part)
        if self.choices is not None:
            text += f" (choices: {_listed(self.choices)})"
        super().__init__(text)


def _listed(choices: tuple[str, ...]) -> str:
    names = [one_line(choice, LONGEST_VALUE) for choice in islice(choices, MOST_CHOICES)]
    more = [f"and {len(choices) - MOST_CHOICES} more"] if len(choices) > MOST_CHOICES else []
    return one_line(", ".join(names + more) or "none")


@contextmanager
def naming(source: str | Path | None = None, field: str | None = None) -> Iterator[None]:
    """Let a `ConfigError` that names no source name this one, and this field if it has none."""
    try:
        yield
    except ConfigError as error:
        if error.source is not None:
            raise
        raise ConfigError(
            error.message, source=source, field=error.field or field, choices=error.choices
        ) from None


@contextmanager
def below(*fields: str) -> Iterator[None]:
    """Let an error of a part name its whole: `fields` come before the field of a `ConfigError`."""
    try:
        yield
    except ConfigError as error:
        field = ".".join(part for part in (*fields, error.field) if part)
        raise ConfigError(error.message, field=field, choices=error.choices) from None
