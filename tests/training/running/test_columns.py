"""training/running/columns.py: what figures are called, and how they are written."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import is_typeddict

import pytest

import poise.training
from poise.training.running import columns, summary
from poise.training.running.columns import NONE, Figure, known


def figures() -> Iterator[Figure]:
    """All that the module describes."""
    for value in vars(columns).values():
        yield from (each for each in (value if isinstance(value, tuple) else (value,))
                    if isinstance(each, Figure))  # fmt: skip


def test_every_figure_is_one_of_a_summary() -> None:
    """Its key, and those of its interval, its whole and its bound."""
    forms = [form for form in vars(summary).values() if is_typeddict(form)]
    keys = {key for form in forms for key in form.__annotations__}
    assert len(keys) > 100
    named = {
        key
        for each in figures()
        for key in (each.key, each.ends, each.of, each.beside, each.bound)
        if key
    }
    assert named <= keys, named - keys


def test_no_table_names_a_figure_on_its_own() -> None:
    """Whatever is described in `columns.py` has no second `Figure` or `Text` in a report."""
    named = {each.csv or each.key for each in figures()}
    sources = [path.read_text("utf-8") for path in Path(poise.training.__path__[0]).rglob("*.py")]
    calls = [
        ast.literal_eval(node.args[0])
        for source in sources
        if "class Figure" not in source
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        if node.func.id in ("Figure", "Text") and node.args
        if isinstance(node.args[0], ast.Constant)
    ]
    assert len(calls) > 20
    assert not named.intersection(calls)


@pytest.mark.parametrize(
    ("entry", "text"),
    [
        ({"j": 12.34, "ends": (11.0, None), "bound": None}, "12.3 [11.0, –]"),
        ({"j": 12.34, "ends": (11.0, 13.0), "bound": "lower"}, "≥ 12.3"),
        ({"j": 12.34, "ends": None, "bound": "upper"}, "≤ 12.3"),
        ({"j": None, "ends": None, "bound": None}, NONE),
        ({}, NONE),
    ],
)
def test_a_figure_has_its_sign_and_its_interval(entry: columns.Entry, text: str) -> None:
    figure = Figure("j", "J50", ".1f", "N·s", ends="ends", bound="bound")
    assert figure.heading == "J50 [N·s]" and figure.text(entry) == text


def test_millimetres_counts_and_what_no_entry_has() -> None:
    """Metres are written as millimetres; a part of a count says of how many."""
    drift, fell = (
        Figure("drift", "drift", ".1f", "mm", scale=1e3),
        Figure("n", "fell", ".0f", of="of"),
    )
    entry = {"drift": 0.0123, "n": 2, "of": 9}
    assert [each.text(entry) for each in (drift, fell)] == ["12.3", "2 of 9"]
    assert drift.value(entry) == 0.0123
    assert known([drift, fell], [{"drift": None}, {"n": 0, "of": 9}]) == [fell]
    assert known([Figure("n", "fell", ".0f", where=lambda each: each["n"])], [{"n": 0}]) == []
