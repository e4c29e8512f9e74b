"""A script as a table, as Semakin's figure 4: columns follow each other, rows happen at once."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence as Rows

from poise.configs.errors import ConfigError

from .parser import parse
from .printer import arrow_text, body_text, sequence_text, term_text
from .tree import Overlay, Script, Sequence


def plain(script: Script) -> Script:
    """The script without brackets that say nothing: a sequence in a sequence, one term alone."""
    return Script(script.defines, _plain(script.sequence), script.text, script.source)


def table_of(script: Script) -> list[list[str]]:
    """Rows of cells. The first has the arrow into each column, the others a term in each cell.

    Before them stands a row of two cells, `NAME =` and a sequence, for each definition.
    """
    sequence = _plain(script.sequence)
    rows = [[f"{body_text(each.clip)} =", sequence_text(each.sequence)] for each in script.defines]
    rows.append(["", *(arrow_text(arrow) for arrow in sequence.arrows)])
    for i in range(max(len(overlay.terms) for overlay in sequence.overlays)):
        rows.append([term_text(o.terms[i]) if i < len(o.terms) else "" for o in sequence.overlays])
    return rows


def script_of(rows: Rows[Rows[str]], source: str = "table") -> Script:
    """The script of a table; the inverse of `table_of` on scripts that are `plain`.

    Raises ConfigError for rows of different lengths, an empty column or gap, a cell that is no
    term.
    """
    count = next((i for i, row in enumerate(rows) if not _is_define(row)), len(rows))
    defines, body = rows[:count], rows[count:]
    if len(body) < 2 or not body[0] or any(len(row) != len(body[0]) for row in body):
        raise ConfigError("must be a row of arrows and one or more rows of terms, all of one "
                          "length", source=source)  # fmt: skip
    arrows, columns = body[0][1:], list(zip(*body[1:], strict=True))
    parts = [_column(column, i, source) for i, column in enumerate(columns)]
    for i, arrow in enumerate(arrows):
        between = _cell(f"x {arrow} x", 2, arrow, f"{source}: arrow {i + 1}").arrows[0]
        parts[i + 1] = f"{arrow_text(between)} {parts[i + 1]}"
    text = [f"{row[0]} {row[1]};" for row in defines]
    return parse("\n".join([*text, " ".join(parts)]), source)


def to_csv(script: Script) -> str:
    """The table as comma-separated values, in which a spreadsheet can edit it."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(table_of(script))
    return text.getvalue()


def from_csv(text: str, source: str = "table") -> Script:
    """The script of `to_csv`; empty cells at the end of definitions' rows are left out.

    Raises ConfigError as `script_of`, and for what is no table.
    """
    try:
        rows = [row for row in csv.reader(io.StringIO(text)) if row]
    except csv.Error as error:
        raise ConfigError(f"is no table: {error}", source=source) from None
    return script_of([row[:2] if _is_define(row) else row for row in rows], source)


def _is_define(row: Rows[str]) -> bool:
    return len(row) > 1 and row[0].endswith("=") and not any(row[2:])


def _column(cells: Rows[str], index: int, source: str) -> str:
    """The overlay of a column: its cells from the top until the first empty one."""
    place = f"{source}: column {index + 1}"
    terms = [cell for cell in cells if cell.strip()]
    if not terms or any(cell.strip() for cell in cells[len(terms) :]):
        raise ConfigError("must have terms from its top on, without a gap", source=place)
    return " | ".join(sequence_text(_cell(cell, 1, cell, place)) for cell in terms)


def _cell(text: str, overlays: int, cell: str, place: str) -> Sequence:
    """What a cell says; raises ConfigError if that is more than one term, or one arrow."""
    script = parse(text, place)
    sequence = script.sequence
    single = all(len(overlay.terms) == 1 for overlay in sequence.overlays)
    if script.defines or len(sequence.overlays) != overlays or not single:
        raise ConfigError(f"must be one {'term' if overlays == 1 else 'arrow'}, not {cell!r}: "
                          "put it in brackets", source=place)  # fmt: skip
    return sequence


def _plain(sequence: Sequence) -> Sequence:
    overlays, arrows = [], []
    for i, overlay in enumerate(sequence.overlays):
        arrows += [sequence.arrows[i - 1]] if i else []
        inner = _alone(overlay)
        overlays += [overlay] if inner is None else list(inner.overlays)
        arrows += [] if inner is None else list(inner.arrows)
    return Sequence(tuple(overlays), tuple(arrows))


def _alone(overlay: Overlay) -> Sequence | None:
    """The sequence in brackets that is all of an overlay, or None."""
    term = overlay.terms[0]
    if len(overlay.terms) > 1 or term.modifiers or not isinstance(term.body, Sequence):
        return None
    return _plain(term.body)
