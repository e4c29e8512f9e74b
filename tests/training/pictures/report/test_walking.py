"""training/pictures/report/walking.py: walks by command, and J50 by phase."""

from __future__ import annotations

import csv
import dataclasses
import io
from typing import Any

import pytest

from poise.training.benchmarking.results.read import Results, load_results
from poise.training.pictures.report import walking
from poise.training.pictures.report.cells import Table
from poise.training.pictures.report.page import render
from tests.support.report_folders import finished


@pytest.fixture(scope="module")
def results() -> Results:
    return load_results(finished("walk"))


def rows(table: Table | None) -> list[dict[str, str]]:
    assert table is not None
    return list(csv.DictReader(io.StringIO(table.csv())))


def test_every_command_has_a_row(results: Results) -> None:
    """With what was reached, and with its steps; both as trials.csv has them."""
    stand, back, pushed = rows(walking.walk_table(results, ["walk"]))
    assert [row["level"] for row in (stand, back, pushed)] == ["stand", "ahead -0.3", "ahead 0.4"]
    assert [row["part"] for row in (stand, back, pushed)] == ["walk", "walk", "pushed"]
    (line,) = [r.line for r in results.records if r.line["level"] == "ahead -0.3"]
    assert float(back["speed_ahead"]) == pytest.approx(float(line["speed_ahead"]), abs=1e-6)
    assert float(back["speed_ahead"]) == pytest.approx(-0.3, abs=0.03)
    assert stand["speed_ahead"] == "" and int(pushed["trials"]) == 8  # of the first stage
    met = [r for r in results.records if r.part == "walk_push" and r.met_by_all]
    lost = [r for r in met if r.fallen]
    assert len(met) == 8
    assert int(pushed["fallen"]) == len(lost)
    costs = rows(walking.cost_table(results, ["walk"]))
    assert float(costs[1]["step_time"]) == pytest.approx(float(line["step_time"]), abs=1e-6)


def test_a_page_of_walks(results: Results) -> None:
    """A section of its own, with a minus that is one, and no minus before a zero."""
    page = render(results, films=False)
    section = page[page.index('<section id="walks"') : page.index('<section id="origin"')]
    assert "ahead −0.3" in section and "−0.000" not in section
    assert section.count("<title>walk: ") >= len(results.summary["controllers"]["walk"]["phases"])
    assert 'download="walks.csv"' in page and 'download="phases.csv"' in page
    assert "walking as commanded in the last two strides" in page


def test_edges_are_of_walks_on_a_terrain(results: Results) -> None:
    """Not of level ground, where none could be touched."""
    level, *others = results.summary["controllers"]["walk"]["walks"]
    stairs: Any = {**level, "part": "terrains", "surfaces_passed": 8.5, "edge_contacts": 0.25}
    entry: Any = {**results.summary["controllers"]["walk"], "walks": [stairs, *others]}
    made = dataclasses.replace(results, summary={**results.summary, "controllers": {"walk": entry}})
    assert all(other["edge_contacts"] == 0.0 for other in others)
    found = rows(walking.walk_table(made, ["walk"]))
    assert [(row["part"], row["surfaces_passed"], row["edge_contacts"]) for row in found] == [
        ("terrain", "8.5", "0.25"), ("walk", "", ""), ("pushed", "", "")
    ]  # fmt: skip
    assert "edge_contacts" not in rows(walking.walk_table(results, ["walk"]))[0]


def phases(*found: tuple[float, float, float, str | None]) -> list[dict[str, Any]]:
    return [
        {"phase": phase, "trials": 9, "recovered": 4, "j50": j50, "j50_ci95": (j50 - 1.0, high),
         "j50_bound": bound}
        for phase, j50, high, bound in found
    ]  # fmt: skip


def test_j50_over_the_phase(results: Results) -> None:
    """A mark, an interval and a row for each phase of each controller, in its place."""
    found = phases((0.0625, 20.0, 21.0, None), (0.5625, 10.0, 12.0, "lower"))
    entry: Any = {**results.summary["controllers"]["walk"], "phases": found}
    other: Any = {**entry, "phases": []}
    made = dataclasses.replace(
        results, summary={**results.summary, "controllers": {"walk": entry, "zero": other}}
    )
    table = walking.phase_table(made, ["zero", "walk"])
    assert table is not None and table.rows[1][-1].text == "≥ 10.0"
    assert [row[-1].ends_text for row in table.rows] == ["19.0 to 21.0", ""]
    assert [row["j50_high"] for row in rows(table)] == ["21.0", "12.0"]
    picture = walking.phase_plot(made, ["zero", "walk"])
    assert picture is not None and "walk 10.0 to 20.0" in picture
    assert "<title>walk: 20.0 (19.0 to 21.0)</title>" in picture
    assert "<title>walk: at least 10.0</title>" in picture  # the interval of a bound is none
    assert picture.count('fill="var(--card)"') == 1  # the bound is hollow, as in the envelope


def test_what_does_not_walk_has_none_of_it() -> None:
    """Nor a section."""
    results = load_results(finished("random"))
    order = results.summary["ranking"]
    assert walking.walk_table(results, order) is None
    assert walking.cost_table(results, order) is None
    assert walking.phase_table(results, order) is None
    assert walking.phase_plot(results, order) is None
    assert 'id="walks"' not in render(results, films=False)
