"""Words of a script with their places, and errors that say line and column."""

import re
from collections.abc import Iterable
from typing import NamedTuple

from poise.configs.errors import ConfigError, shown

MOST_CHARACTERS = 10_000
SIGNS = ("->", "|", "(", ")", "<", ">", "*", "@", "[", "]", ":", ",", "{", "}", "=", ";")
_PATTERN = re.compile(
    r"(?P<blank>\s+|#[^\n]*)"
    r'|(?P<string>"[^"\n]*")'
    r"|(?P<number>[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<name>[^\W\d]\w*)"
    r"|(?P<sign>->|[|()<>*@\[\]:,{}=;])"
)


class Token(NamedTuple):
    """A word: its kind (string, number, name, sign or end), its text and where it begins."""

    kind: str
    text: str
    at: int


def tokens(text: str, source: str) -> list[Token]:
    """The words of a script, and an end; blanks and what follows a `#` on its line are left out.

    Raises ConfigError for more than 10,000 characters, an open quote, and what is no word.
    """
    if len(text) > MOST_CHARACTERS:
        raise ConfigError(f"has {len(text)} characters, more than {MOST_CHARACTERS}", source=source)
    found, at = [], 0
    while at < len(text):
        match = _PATTERN.match(text, at)
        if match is None:
            raise _unknown(text, at, source)
        if match.lastgroup != "blank":
            found.append(Token(str(match.lastgroup), match.group(), at))
        at = match.end()
    return [*found, Token("end", "", len(text.rstrip()))]


def wrong(
    message: str, text: str, at: int, source: str, choices: Iterable[object] | None = None
) -> ConfigError:
    """The error of a place in a text: its line and column count from 1."""
    line = text.count("\n", 0, at) + 1
    column = at - (text.rfind("\n", 0, at) + 1) + 1
    return ConfigError(message, source=source, field=f"line {line}, column {column}",
                       choices=choices)  # fmt: skip


def _unknown(text: str, at: int, source: str) -> ConfigError:
    if text[at] == '"':
        return wrong("the quote is not closed on its line", text, at, source)
    paths = "; quote the path of a file" if text[at] in "/\\.~" else ""
    return wrong(f"{shown(text[at])} means nothing in a script{paths}", text, at, source, SIGNS)
