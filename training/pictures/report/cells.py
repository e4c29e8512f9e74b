"""A table of the report: what is shown, and the same numbers in full as CSV."""

from __future__ import annotations

import base64
import csv
import gzip
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, cast

from markupsafe import Markup

from poise.training.benchmarking.results.read import Results
from poise.training.running.columns import Entry, Figure, known
from poise.training.running.summary import both_ends


class Column(NamedTuple):
    """A column.

    Attributes:
        key: its name in the CSV.
        title: its heading.
        note: what it means, in a few words; shown when it is pointed at.
        interval: whether its cells have one; the CSV then has key_low and key_high too.
    """

    key: str
    title: str
    note: str = ""
    interval: bool = False


class Cell(NamedTuple):
    """A value, how it is written, and its 95 % interval if it has one.

    `series` marks the name of a controller, which is shown with its sign.
    """

    value: float | str | None
    text: str
    ends: tuple[float, float] | None = None
    ends_text: str = ""
    series: int | None = None

    @property
    def sort_key(self) -> str:
        """The text that the page sorts by; nothing sorts last."""
        return "" if self.value is None else str(self.value)


@dataclass(frozen=True)
class Table:
    """Rows of cells under columns.

    Attributes:
        name: of the CSV file, without its ending.
        caption: what it shows.
    """

    name: str
    caption: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell]]
    notes: Sequence[str] = field(default_factory=tuple)

    def csv(self) -> str:
        """The numbers as they are, not as they are shown."""
        header = []
        for column in self.columns:
            header.append(column.key)
            if column.interval:
                header += [f"{column.key}_low", f"{column.key}_high"]
        lines = []
        for row in self.rows:
            line: list[float | str | None] = []
            for column, cell in zip(self.columns, row, strict=True):
                line.append(cell.value)
                if column.interval:
                    line += cell.ends or (None, None)
            lines.append(line)
        return csv_text(header, lines)

    @property
    def download(self) -> Download:
        """The CSV as a link."""
        return download(f"{self.name}.csv", self.csv())

    def without_empty(self) -> Table:
        """The table less the columns in which no row has a value."""
        count = len(self.columns)
        kept = [k for k in range(count) if any(row[k].value is not None for row in self.rows)]
        rows = [[row[k] for k in kept] for row in self.rows]
        return Table(self.name, self.caption, [self.columns[k] for k in kept], rows, self.notes)


class Download(NamedTuple):
    """A file inside the page."""

    name: str
    url: str
    size: int  # [bytes] of the file


def download(name: str, text: str, pack: bool = False) -> Download:
    """A file as a data URI, packed by gzip (with .gz at its name) if `pack`."""
    content = text.encode()
    kind = "text/csv;charset=utf-8"
    if pack:
        content, name, kind = gzip.compress(content, 9, mtime=0), f"{name}.gz", "application/gzip"
    url = f"data:{kind};base64,{base64.b64encode(content).decode()}"
    return Download(name, Markup(url), len(content))


def csv_text(header: Sequence[str], lines: Sequence[Sequence[object]]) -> str:
    """CSV with a header; None is an empty field."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(lines)
    return text.getvalue()


def number_text(value: float, form: str) -> str:
    """A number for people: with a real minus, and none before a zero."""
    text = format(value, form)
    return (text if set(text) & set("123456789") else text.lstrip("-")).replace("-", "−")


def cell(
    value: float | None, form: str = "g", ends: tuple[float, float] | None = None, sign: str = ""
) -> Cell:
    """A number with its interval, written by a format; `sign` before it, as in ≥ 25."""
    if value is None:
        return Cell(None, "–")
    shown = f"{number_text(ends[0], form)} to {number_text(ends[1], form)}" if ends else ""
    return Cell(value, f"{sign}{number_text(value, form)}", ends, shown)


def p_cell(value: float | None) -> Cell:
    """A p-value; how small it is below 0.001 says nothing to people."""
    text = "–" if value is None else "< 0.001" if value < 0.001 else f"{value:.3f}"
    return Cell(value, text)


def name_cell(name: str, series: int) -> Cell:
    """A controller's name with its sign."""
    return Cell(name, name, series=series)


def figure_column(figure: Figure) -> Column:
    """The column of a figure."""
    return Column(figure.csv or figure.key, figure.heading, figure.words, bool(figure.ends))


def figure_cell(figure: Figure, entry: Entry) -> Cell:
    """A figure of an entry with its interval: in full, and as it is shown."""
    value, ends, scale = figure.value(entry), both_ends(figure.interval(entry)), figure.scale
    if value is None:
        return cell(None)
    around = (scale * ends[0], scale * ends[1]) if ends else None
    shown = cell(scale * value, figure.form, around, figure.sign(entry))
    return shown._replace(value=value, ends=ends)


def figure_table(
    results: Results,
    order: Sequence[str],
    key: str,
    table: Table,
    figures: Sequence[Figure],
    first: Callable[[Any], list[Cell]],
) -> Table | None:
    """A table of the entries that the controllers have under `key`; None without any.

    Args:
        results, order: the controllers, in this order.
        key: of a list of entries of a controller, such as "walks".
        table: name, caption, and the columns between the controller and the figures.
        figures: the columns after them; those that no entry has are left out.
        first: the cells of the table's own columns, from an entry.
    """
    rows = [
        (name, entry)
        for name in order
        for entry in cast(Sequence[Entry], results.summary["controllers"][name].get(key, ()))
    ]
    shown = known(figures, [entry for _, entry in rows])
    if not shown:
        return None
    columns = [Column("controller", "controller"), *table.columns, *map(figure_column, shown)]
    cells = [
        [name_cell(name, results.controllers.index(name)), *first(entry),
         *(figure_cell(each, entry) for each in shown)]
        for name, entry in rows
    ]  # fmt: skip
    return Table(table.name, table.caption, columns, cells)
