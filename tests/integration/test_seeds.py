"""docs/seeds.md: its rows are whole, what they name exists, and (weekly) every command in it runs.

That its commands parse is one of the tests of all pages, in test_docs.py.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "seeds.md"
DOCUMENTS = ("000", "001", "003", "004")
#: a command, and the exit code that it is to have if that is not 0
COMMAND = re.compile(r"`((?:poise|python -m) [^`]+)`(?: \(exit code (\d)\))?")
LINK = re.compile(r"\]\(([^)#]*)(?:#([^)]+))?\)")


class Row(NamedTuple):
    """A row of a table: its document, and its columns."""

    document: str
    described: str
    there: str
    ours: str
    state: str
    command: str
    here: str


def rows() -> list[Row]:
    """All of the tables that begin with `described`, in order."""
    found, document, table = [], "", False
    for line in PAGE.read_text().splitlines():
        if match := re.match(r"## (\d{3}): ", line):
            document = match[1]
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if table and cells and set(cells[0]) != {"-"}:
            assert len(cells) == len(Row._fields) - 1, line
            found.append(Row(document, *cells))
        table = bool(cells) and (table or cells[0] == "described")
    return found


def commands(document: str) -> list[tuple[str, int]]:
    """Of a document's rows: each once, with its exit code."""
    text = "\n".join(row.command for row in rows() if row.document == document).replace("\\|", "|")
    return list({words: int(code or 0) for words, code in COMMAND.findall(text)}.items())


def anchors(page: Path) -> set[str]:
    """Of the headings of a page, as GitHub and the site make them."""
    titles = re.findall(
        r"^#+ (.*)$", re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S), re.M
    )
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


def test_every_document_has_its_rows_and_every_row_its_columns() -> None:
    assert {row.document for row in rows()} == set(DOCUMENTS)
    for row in rows():
        assert (
            row.described and row.there and row.state in ("works", "tested", "partial", "outside")
        ), row
        assert (row.state == "outside") == (not row.command), row
        assert COMMAND.sub("", row.command).strip(" ;") == "", row
        assert (row.state == "tested") == row.command.startswith("`python -m pytest"), row
        if row.state == "partial":
            assert "(log/" in row.here, row  # where its bound is
        if row.state == "outside":
            assert row.here, row  # the reason
        else:
            assert row.ours.startswith("`"), row


def test_the_count_at_the_top_is_that_of_the_rows() -> None:
    states = [row.state for row in rows()]
    told = re.search(
        r"(\d+) rows: (\d+) work, (\d+) are tested, (\d+) are partial, (\d+) are outside",
        PAGE.read_text(),
    )
    assert told is not None
    counts = [len(states), *(states.count(s) for s in ("works", "tested", "partial", "outside"))]
    assert [int(number) for number in told.groups()] == counts


def test_files_tests_and_anchors_that_rows_name_exist() -> None:
    for row in rows():
        for path in re.findall(r"`([^`]+)`", row.ours):
            assert (ROOT / path).exists(), path
        for words, _ in COMMAND.findall(row.command):
            for path in re.findall(r"\btests/\S+", words):
                assert (ROOT / path).exists(), path
    for file, anchor in LINK.findall(PAGE.read_text()):
        page = PAGE.parent / file if file else PAGE
        assert page.exists(), file
        assert not anchor or anchor in anchors(page), f"{file}#{anchor}"


@pytest.mark.weekly
@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_command_runs(document: str, tmp_path: Path, can_render: None) -> None:
    """In order, in one folder: a command may need what an earlier one of the document wrote."""
    for folder in ("configs", "docs", "tests"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    poise = str(Path(sys.executable).with_name("poise"))
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    wrong = []
    for command, code in commands(document):
        words = shlex.split(command)
        program = [poise] if words[0] == "poise" else [sys.executable]
        place = ROOT if words[1:3] == ["-m", "pytest"] else tmp_path
        done = subprocess.run(
            [*program, *words[1:]],
            cwd=place,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != code:
            wrong.append(f"{command}: {done.returncode}\n{done.stdout[-500:]}{done.stderr[-1500:]}")
    assert not wrong, "\n\n".join(wrong)
