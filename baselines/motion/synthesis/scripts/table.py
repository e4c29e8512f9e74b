"""A script's table, as `printer.to_csv` writes it, read back after it was edited [Semakin04]."""

import csv
import io
from pathlib import Path

from poise.configs.errors import ConfigError
from poise.configs.reading import read_text

from .parser import MOST_BYTES, parse
from .tree import Script


def read_table(path: str | Path) -> Script:
    """The script of a .csv file.

    Rows of two cells that end the first with `=` are definitions. Then comes a row whose first cell
    is empty, with the arrow into each further column, and below it a term in each cell; what is in
    a column happens at once, from above.

    Raises:
        ConfigError: as `parse`; a file without a row of arrows, an arrow over no column, a column
            without a term.
    """
    rows = list(csv.reader(io.StringIO(read_text(path, MOST_BYTES))))
    return parse(text_of_table(rows, str(path)), str(path))


def begins_with_number(path: str | Path) -> bool:
    """Whether the first cell of a .csv file is a number, as in a clip; False without the file."""
    try:
        with Path(path).open(encoding="utf-8", errors="replace") as file:
            first = file.readline(MOST_BYTES).split(",")[0]
    except OSError:
        return False
    try:
        float(first)
    except ValueError:
        return False
    return True


def text_of_table(rows: list[list[str]], source: str = "table") -> str:
    """The script of a table's rows as text; raises ConfigError for what is no table."""
    cells = [[cell.strip() for cell in row] for row in rows if any(cell.strip() for cell in row)]
    defines = []
    while cells and cells[0][0].endswith("="):
        name, *body = cells.pop(0)
        defines.append(f"{name} {' '.join(filter(None, body))};")
    if len(cells) < 2 or cells[0][0]:
        # one column has no arrow, and its row of arrows is empty
        if not cells or len(_width(cells)) > 1:
            raise ConfigError(
                "needs a row of arrows, whose first cell is empty, and terms below it",
                source=source,
                field="table",
            )
        arrows = [""]
    else:
        arrows = cells.pop(0)
    count = max(len(_width(cells)), len(_width([arrows])))
    columns = []
    for j in range(count):
        terms = [row[j] for row in cells if j < len(row) and row[j]]
        arrow = arrows[j] if j < len(arrows) else ""
        if not terms or (j > 0 and not arrow):
            missing = "a term" if not terms else "an arrow"
            raise ConfigError(f"column {j + 1} has not {missing}", source=source, field="table")
        columns.append(f"{arrow} {' | '.join(terms)}".strip())
    return "\n".join([*defines, " ".join(columns)]) + "\n"


def _width(rows: list[list[str]]) -> range:
    """The columns up to the last one with a text."""
    return range(max((j + 1 for row in rows for j, cell in enumerate(row) if cell), default=0))
