"""Folders of results, one file of which is changed, and all that reads them."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from poise.training.benchmarking.evaluation.folder import read_settings
from poise.training.benchmarking.results.compare import compare, print_comparison
from poise.training.benchmarking.results.leaderboard import write_leaderboard
from poise.training.benchmarking.results.read import load_results
from poise.training.benchmarking.results.replay import replay
from poise.training.pictures.report.page import write_report
from poise.training.running.terminal import terminal

from .samples import copy_sample, samples
from .texts import Draw, changed
from .values import NUMBERS, TEXTS, Json, decode, packed

FILES = {
    "evaluation": ("settings.yaml", "summary.json", "trials.csv", "trials.jsonl"),
    "benchmark": ("settings.yaml", "summary.json", "trials.csv", "trials.jsonl"),
}
FORMS = {".yaml": "yaml", ".json": "json", ".csv": "csv", ".jsonl": "lines"}


def _compared(path: Path, first: bool) -> None:
    other = samples() / path.name
    pair = (path, other) if first else (other, path)
    print_comparison(compare(*pair), *pair, terminal())


READERS: dict[str, Callable[[Path], Any]] = {
    "results": load_results,
    "settings": read_settings,
    "compare": lambda path: _compared(path, True),
    "compare with": lambda path: _compared(path, False),
    "leaderboard": lambda path: write_leaderboard([path], path.parent / "page.md"),
    "replay": lambda path: replay(path, 0),
    "replay of pd": lambda path: replay(path, 1, "pd"),
    "report": lambda path: write_report(path, films=False),
}
INSTEAD: dict[str, Callable[[Path], Any]] = {  # of a file
    "pipe": os.mkfifo,
    "folder": Path.mkdir,
    "link outside": lambda file: file.symlink_to("/etc/passwd"),
    "link to a device": lambda file: file.symlink_to("/dev/zero"),
    "circle": lambda file: file.symlink_to(file),
}
#: what a spreadsheet, a page, a terminal or Markdown would take for more than a text
TEXTS_THAT_ACT = ("=1+1", "@SUM(A1)", "\x1b]0;a\x07", "<img src=q onerror=a()>", "`${a()}`",
                  "[a](javascript:a())", "{{7*7}}")  # fmt: skip
SELDOM = ("report", "replay", "replay of pd")  # tenths of a second each


@cache
def _file(result: str, name: str) -> bytes:
    return (samples() / result / name).read_bytes()


def _changed_cell(draw: Draw, content: bytes) -> bytes:
    """A table with one cell changed, or a line or a column too many or too few."""
    rows = list(csv.reader(io.StringIO(content.decode())))
    row = draw(st.integers(0, len(rows) - 1))
    column = draw(st.integers(0, len(rows[0]) - 1))
    how = draw(st.sampled_from(["cell", "cell", "cell", "drop", "twice", "longer", "shorter"]))
    if how == "cell":
        junk = st.sampled_from([str(n) for n in NUMBERS if not isinstance(n, dict)] + TEXTS)
        rows[row][column] = draw(
            st.one_of(junk, st.sampled_from(["nan", "-inf", "[{}]", "[1]", *TEXTS_THAT_ACT]))
        )
    elif how == "drop":
        del rows[row]
    elif how == "twice":
        rows.insert(row, rows[row])
    else:
        rows[row] = [*rows[row], "a"] if how == "longer" else rows[row][:-1]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode(errors="replace")


@st.composite
def cases(draw: Draw) -> Json:
    """Which result, which of its files, how it reads then, and who reads it."""
    result = draw(st.sampled_from(sorted(FILES)))
    name = draw(st.sampled_from(FILES[result]))
    form = FORMS[Path(name).suffix]
    if form == "csv" and draw(st.booleans()):
        content = _changed_cell(draw, _file(result, name))
    else:
        content = changed(draw, _file(result, name), form)
    often = [reader for reader in READERS if reader not in SELDOM]
    reader = draw(st.sampled_from(often * 3 + list(SELDOM)))
    kind = draw(st.sampled_from(["file"] * 12 + sorted(INSTEAD)))
    return {"result": result, "file": name, "content": packed(content), "reader": reader,
            "as": kind}  # fmt: skip


def play(case: Json, folder: Path) -> None:
    """Read it."""
    path = copy_sample(case["result"], folder)
    file = path / case["file"]
    file.write_bytes(decode(case["content"]))
    if case.get("as", "file") != "file":
        file.unlink()
        INSTEAD[case["as"]](file)
    READERS[case["reader"]](path)
