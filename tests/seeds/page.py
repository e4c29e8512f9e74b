"""docs/seeds.md, made from docs/seeds.yaml."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import jinja2

from .rows import ROOT, STATES, Document, Figure, Row

PAGE = ROOT / "docs" / "seeds.md"
TEMPLATE = Path(__file__).with_name("seeds.md.j2")


def page_of(documents: Sequence[Document]) -> str:
    """The whole page."""
    environment = jinja2.Environment(
        keep_trailing_newline=True, undefined=jinja2.StrictUndefined, trim_blocks=True
    )
    environment.filters |= {"cell": cell, "shown": shown, "here": here}
    counts = Counter(row.state for document in documents for row in document.rows)
    template = environment.from_string(TEMPLATE.read_text())
    return template.render(documents=documents, counts=counts, states=STATES)


def cell(text: str) -> str:
    """Text that a cell of a table takes."""
    return text.replace("|", "\\|").replace("\n", " ").strip()


def here(row: Row) -> str:
    """The last cell of a row: its figures, and what bounds it."""
    figures = ", ".join(dict.fromkeys(shown(figure) for figure in row.figures))
    return "; ".join(filter(None, (figures, row.bound.strip())))


def shown(figure: Figure) -> str:
    """A figure with its unit."""
    return f"{figure.is_:g} {figure.unit}".strip()
