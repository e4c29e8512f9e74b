"""Tables in the terminal: what each row is of to the left, figures to the right."""

from collections.abc import Iterable, Sequence

from rich.markup import escape
from rich.table import Table

from .columns import Entry, Figure


def text_table(
    title: str, texts: Sequence[str], numbers: Sequence[str], rows: Iterable[Sequence[str]]
) -> Table:
    """Rows under headings of texts and then of numbers; what has no room is folded, not cut."""
    table = Table(title=escape(title) or None, title_justify="left")
    for heading in texts:
        table.add_column(escape(heading), overflow="fold")
    for heading in numbers:
        table.add_column(escape(heading), justify="right", overflow="fold")
    for row in rows:
        table.add_row(*map(escape, row))
    return table


def figure_table(
    title: str,
    names: Sequence[str],
    figures: Sequence[Figure],
    rows: Iterable[tuple[Sequence[str], Entry]],
) -> Table:
    """Figures of entries; `names` are headings of what each row says first of whose they are."""
    headings = [each.heading.replace(" [", "\n[") for each in figures]  # so more have room
    cells = ([*own, *(each.text(entry) for each in figures)] for own, entry in rows)
    return text_table(title, names, headings, cells)


def fact_table(title: str, facts: Iterable[tuple[str, str]]) -> Table:
    """A name and a value a row, without headings."""
    table = Table(title=escape(title), title_justify="left", show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in facts:
        table.add_row(escape(name), escape(value))
    return table
