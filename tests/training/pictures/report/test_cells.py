"""training/pictures/report/cells.py."""

from __future__ import annotations

import base64
import csv
import gzip
import io

from poise.training.pictures.report.cells import (
    Cell,
    Table,
    Text,
    cell,
    download,
    number_text,
    p_cell,
)
from poise.training.running.columns import Figure

COLUMNS = [Text("name", "Name"), Figure("x", "X", ".1f", "m", ends="x_ci95"), Text("none", "None")]
TABLE = Table(
    "some",
    "A caption.",
    COLUMNS,
    [
        [Cell("a, b", "a, b", head=True), cell(1 / 3, ".1f", (-0.25, 0.5)), cell(None)],
        [Cell("ü", "ü", head=True), cell(None), cell(None)],
    ],
)


def test_the_csv_has_the_numbers_in_full() -> None:
    """Every digit, intervals in two columns of their own, nothing where there is nothing."""
    lines = list(csv.reader(io.StringIO(TABLE.csv())))
    assert lines[0] == ["name", "x", "x_low", "x_high", "none"]
    assert lines[1] == ["a, b", str(1 / 3), "-0.25", "0.5", ""]
    assert lines[2] == ["ü", "", "", "", ""]


def test_what_is_shown_is_short() -> None:
    """Rounded, with a real minus; tiny p-values are a bound; nothing is a dash."""
    shown = cell(1 / 3, ".1f", (-0.25, 0.5))
    assert (shown.text, shown.ends_text) == ("0.3", "−0.2 to 0.5")
    assert cell(None).text == "–" and cell(None).sort_key == ""
    assert cell(7.0, ".1f", sign="≥ ").text == "≥ 7.0"
    assert p_cell(1e-9) == Cell(1e-9, "< 0.001") and p_cell(0.25).text == "0.250"


def test_empty_columns_are_left_out() -> None:
    """A column without any value is not shown."""
    short = TABLE.without_empty()
    assert [column.key for column in short.columns] == ["name", "x"]
    assert all(len(row) == 2 for row in short.rows)


def test_a_download_holds_the_file() -> None:
    """The data URI is the text, packed or not, and the same every time."""
    text = "a,b\n1,ü\n"
    plain, packed = download("x.csv", text), download("x.csv", text, pack=True)
    assert plain.name == "x.csv" and packed.name == "x.csv.gz"
    head, body = plain.url.split(";base64,")
    assert head == "data:text/csv;charset=utf-8" and base64.b64decode(body) == text.encode()
    content = base64.b64decode(packed.url.split(";base64,")[1])
    assert gzip.decompress(content) == text.encode() and packed.size == len(content)
    assert packed == download("x.csv", text, pack=True)


def test_a_minus_is_one_and_none_stands_before_a_zero() -> None:
    assert [number_text(v, ".1f") for v in (-1.25, -0.01, 0.0, 3.0)] == [
        "−1.2",
        "0.0",
        "0.0",
        "3.0",
    ]
