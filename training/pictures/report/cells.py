"""A table of the report: what is shown, and the same numbers in full as CSV."""

from __future__ import annotations

import base64
import csv
import gzip
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, cast

from markupsafe import Markup

from poise.training.benchmarking.results.read import Results
from poise.training.running.columns import NONE, P_VALUE, Entry, Figure
from poise.training.running.summary import both_ends


@dataclass(frozen=True)
class Text:
    """A column of texts; one of numbers is a `Figure`.

    Attributes:
        key: in an entry, whose value is a text or a `Cell`; and its name in the CSV.
        heading, words: as of a figure.
        head: whether it says what the row is of.
    """

    key: str
    heading: str
    words: str = ""
    head: bool = False
    csv: ClassVar[str] = ""
    ends: ClassVar[str] = ""


Column = Figure | Text
CONTROLLER = Text("controller", "controller", head=True)


class Cell(NamedTuple):
    """A value, how it is written, and its 95 % interval if it has one.

    `head` marks what the row is of: the name of a controller.
    """

    value: float | str | None
    text: str
    ends: tuple[float, float] | None = None
    ends_text: str = ""
    head: bool = False

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

    def csv(self) -> str:
        """Return the numbers as they are, not as they are shown."""
        header = []
        for column in self.columns:
            name = column.csv or column.key
            header += [name, f"{name}_low", f"{name}_high"] if column.ends else [name]
        lines = []
        for row in self.rows:
            line: list[float | str | None] = []
            for column, cell in zip(self.columns, row, strict=True):
                line.append(cell.value)
                if column.ends:
                    line += cell.ends or (None, None)
            lines.append(line)
        return cells_csv(header, lines)

    @property
    def download(self) -> Download:
        """The CSV as a link."""
        return download(f"{self.name}.csv", self.csv())

    def without_empty(self) -> Table:
        """Return the table less the columns in which no row has a value."""
        count = len(self.columns)
        kept = [k for k in range(count) if any(row[k].value is not None for row in self.rows)]
        rows = [[row[k] for k in kept] for row in self.rows]
        return Table(self.name, self.caption, [self.columns[k] for k in kept], rows)


class Download(NamedTuple):
    """A file inside the page."""

    name: str
    url: str
    size: int  # [bytes] of the file


def download(name: str, text: str, pack: bool = False) -> Download:
    """Return a file as a data URI, packed by gzip (with .gz at its name) if `pack`."""
    content = text.encode()
    kind = "text/csv;charset=utf-8"
    if pack:
        content, name, kind = gzip.compress(content, 9, mtime=0), f"{name}.gz", "application/gzip"
    url = f"data:{kind};base64,{base64.b64encode(content).decode()}"
    return Download(name, Markup(url), len(content))


def cells_csv(header: Sequence[str], lines: Sequence[Sequence[object]]) -> str:
    """CSV with a header; None is an empty field."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(lines)
    return text.getvalue()


def number_text(value: float, form: str) -> str:
    """Return a number for people: with a real minus, and none before a zero."""
    text = format(value, form)
    return (text if set(text) & set("123456789") else text.lstrip("-")).replace("-", "−")


def cell(
    value: float | None, form: str = "g", ends: tuple[float, float] | None = None, sign: str = ""
) -> Cell:
    """Return a number with its interval, written by a format; `sign` before it, as in ≥ 25."""
    if value is None:
        return Cell(None, NONE)
    shown = f"{number_text(ends[0], form)} to {number_text(ends[1], form)}" if ends else ""
    return Cell(value, f"{sign}{number_text(value, form)}", ends, shown)


def p_cell(value: float | None) -> Cell:
    """Return a p-value; how small it is below 0.001 says nothing to people."""
    text = NONE if value is None else "< 0.001" if value < 0.001 else f"{value:.3f}"
    return Cell(value, text)


def entry_table(
    name: str, caption: str, columns: Sequence[Column], entries: Sequence[Entry]
) -> Table | None:
    """A row for each entry, without columns in which none has a value; None without any figure."""
    rows = [[_cell_of(each, entry) for each in columns] for entry in entries]
    figures = [k for k, each in enumerate(columns) if isinstance(each, Figure)]
    if all(row[k].value is None for row in rows for k in figures):
        return None
    return Table(name, caption, columns, rows).without_empty()


def entries_of(results: Results, order: Sequence[str], key: str) -> list[Entry]:
    """The entries that the controllers have under a key such as "walks", with their names."""
    return [
        {**entry, "controller": name}
        for name in order
        for entry in cast(Sequence[Entry], results.summary["controllers"][name].get(key, ()))
    ]


def _cell_of(column: Column, entry: Entry) -> Cell:
    """What an entry has of a column: a figure in full, and as it is shown."""
    if isinstance(column, Text):
        text = entry[column.key]
        return (
            text if isinstance(text, Cell) else Cell(text or None, text or NONE, head=column.head)
        )
    value, ends = column.value(entry), both_ends(column.interval(entry))
    if value is None or math.isnan(value):
        return cell(None)
    if column is P_VALUE:
        return p_cell(value)
    shown_ends = ends if column.has_range(entry) else None
    around = (column.scale * shown_ends[0], column.scale * shown_ends[1]) if shown_ends else None
    shown = cell(column.scale * value, column.form, around, column.sign(entry))
    return shown._replace(value=value, ends=ends)
