"""Untrusted texts, shown verbatim in pages, Markdown and terminals.

A name may come from an untrusted file, folder or result. Where it goes into Markdown it is
`plain` or `code`; Rich's tables take it escaped (`rich.markup.escape`), templates of pages escape
by themselves, and a `Terminal` prints what cannot be printed as an escape.
"""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from .errors import ConfigError, one_line, shown

LONGEST = 4096  # characters: as many as a path may have
#: of Markdown, of HTML, of expressions in MDX; not an underscore within a word
_MARKUP = re.compile(r"[!\"#$&'*;<>?\[\\\]^`{|}~]|(?<![^\W_])_|_(?![^\W_])")


def plain(text: object) -> str:
    """Markdown of one line that shows `text` as it is: nothing in it is markup, HTML or code."""
    return _MARKUP.sub(lambda mark: f"&#{ord(mark[0])};", one_line(str(text)))


def code(text: object) -> str:
    """Return the same as code; without, where code would end within the text, or a table's cell."""
    line = one_line(str(text))
    return plain(line) if not line or set(line) & set("`|") else f"`{line}`"


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown, of cells that are `plain`, `code` or our own."""
    cells = ([cell.replace("|", "\\|") for cell in line] for line in (head, *rows))
    first, *others = (f"| {' | '.join(line)} |\n" for line in cells)
    return "".join([first, "|" + "---|" * len(head) + "\n", *others])


def markdown_page(package: str, template: str, **values: object) -> str:
    """A page by a template in the folder `templates` of a package, which knows `plain` and `code`.

    Nothing is escaped: what a stranger may have written passes one of these.
    """
    import jinja2  # when it is needed: most commands write no page

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(package, "templates"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"code": code, "plain": plain}
    return environment.get_template(template).render(values)


def printable(text: str) -> str:
    """The text for a terminal: what does not print, such as the beginning of a command to it, is
    shown as Python writes it. Lines and tabs stay."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else ascii(c)[1:-1] for c in text)


def check_shown(text: str, source: str | Path | None = None, field: str | None = None) -> None:
    """Raise ConfigError for a name, or another text of a result, that no honest one has.

    It is longer than a path may be, or cannot be printed: it holds a line's end, a command to a
    terminal, or what turns the order of letters around.
    """
    if len(text) > LONGEST:
        problem = f"must be of at most {LONGEST} characters, not {len(text)}"
    elif not text.isprintable():
        problem = f"has characters that cannot be printed: {shown(text)}"
    else:
        return
    raise ConfigError(problem, source=source, field=field)
