"""docs/seeds.yaml: a row for each thing that a document describes, with its command and figure."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[2]
DATA = ROOT / "docs" / "seeds.yaml"
STATES = ("works", "tested", "bounded", "outside")
NUMBER = r"\s*(-?\d+(?:\.\d+)?)\s*"


@dataclass(frozen=True)
class Figure:
    """A number that a command prints.

    `reads` is a part of the output with {} in the number's place, in which any white space stands
    for any other. The command holds the row while the number is `is_` ± `within`.
    """

    reads: str
    is_: float
    within: float
    unit: str
    daily: bool = False

    def read(self, output: str) -> float:
        """The number of the first such part of an output.

        Raises ValueError if it has none.
        """
        head, tail = (r"\s+".join(map(re.escape, part.split())) for part in self.reads.split("{}"))
        found = re.search(f"{head}{NUMBER}{tail}", output)
        if found is None:
            raise ValueError(f"no {self.reads!r} in {output[-1500:]!r}")
        return float(found[1])

    def holds(self, value: float) -> bool:
        """Whether a number is near enough."""
        return abs(value - self.is_) <= self.within


@dataclass(frozen=True)
class Run:
    """A command, its exit code, and the figures that it prints."""

    run: str
    exit: int = 0
    figures: tuple[Figure, ...] = ()

    @property
    def daily(self) -> bool:
        """Whether a figure of it is looked at every day."""
        return any(figure.daily for figure in self.figures)


@dataclass(frozen=True)
class Row:
    """What a document describes: where, by which code, in which state, and what shows it.

    `note` is for readers of the data; `bound` is the reason of what is bounded or outside.
    """

    document: str
    part: str
    what: str
    there: str
    state: str
    code: str = ""
    runs: tuple[Run, ...] = ()
    note: str = ""
    bound: str = ""

    @property
    def figures(self) -> list[Figure]:
        """Of all commands."""
        return [figure for run in self.runs for figure in run.figures]


@dataclass(frozen=True)
class Part:
    """Rows under one heading."""

    title: str
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class Document:
    """A document: its key, the title of its section, what is said before its rows."""

    key: str
    title: str
    is_: str
    reference: str
    lead: str
    parts: tuple[Part, ...] = field(default_factory=tuple)

    @property
    def anchor(self) -> str:
        """Of its heading, as GitHub and the site make it."""
        return re.sub(r"[^\w -]", "", f"{self.key}: {self.title}".lower()).replace(" ", "-")

    @property
    def rows(self) -> list[Row]:
        """Of all parts."""
        return [row for part in self.parts for row in part.rows]


def load_documents(path: Path = DATA) -> list[Document]:
    """The documents of the file, in order."""
    content = yaml.safe_load(path.read_text())
    return [_document(each) for each in content["documents"]]


def _document(each: dict[str, Any]) -> Document:
    parts = [
        Part(part["title"], tuple(_row(each["key"], part["title"], row) for row in part["rows"]))
        for part in each["parts"]
    ]
    return Document(each["key"], each["title"], each["is"], each["reference"], each["lead"],
                    tuple(parts))  # fmt: skip


def _row(document: str, part: str, values: dict[str, Any]) -> Row:
    runs = tuple(_run(run) for run in values.pop("runs", ()))
    return Row(document, part, runs=runs, **values)


def _run(values: dict[str, Any]) -> Run:
    figures = [
        Figure(**{("is_" if key == "is" else key): value for key, value in figure.items()})
        for figure in values.pop("figures", ())
    ]
    return Run(figures=tuple(figures), **values)
