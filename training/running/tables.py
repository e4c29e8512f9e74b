"""Tables in the terminal: names to the left, figures to the right."""

from collections.abc import Iterable, Sequence

from rich.markup import escape
from rich.table import Table

from .columns import Entry, Figure


def text_table(
    title: str, texts: Sequence[str], numbers: Sequence[str], rows: Iterable[Sequence[str]]
) -> Table:
    """Return a table of text columns, then number columns; long cells are folded, not cut."""
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
    """Return a table of the figures of entries; `names` are the headings of the row labels."""
    headings = [each.heading.replace(" [", "\n[") for each in figures]  # narrower columns
    cells = ([*own, *(each.text(entry) for each in figures)] for own, entry in rows)
    return text_table(title, names, headings, cells)


def fact_table(title: str, facts: Iterable[tuple[str, str]]) -> Table:
    """Return a table with a name and a value in each row, without headings."""
    table = Table(title=escape(title), title_justify="left", show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in facts:
        table.add_row(escape(name), escape(value))
    return table
