"""docs/seeds.yaml and the page that is made of it: rows are whole, what they name exists, and their
commands print their figures: some every day, all in `make weekly`."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from poise.training.running.columns import J50_SCALED, PERFORMED
from tests.integration.test_docs import folder, parsed  # noqa: F401
from tests.seeds.page import PAGE, page_of
from tests.seeds.rows import ROOT, STATES, Document, Figure, Row, Run, load_documents
from tests.seeds.running import faults, prepare, run_alone, run_here, runs_of

DOCUMENTS = load_documents()
ROWS = [row for document in DOCUMENTS for row in document.rows]
DAILY = runs_of(ROWS, daily=True)
LINK = re.compile(r"\]\(([^)#]*)(?:#([^)]+))?\)")
MOST_WORDS = 2500


def anchors(page: Path) -> set[str]:
    """Of the headings of a page, as GitHub and the site make them."""
    titles = re.findall(
        r"^#+ (.*)$", re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S), re.M
    )
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


def test_the_page_is_made_of_the_data_and_short() -> None:
    """`python -m tests.seeds --write` makes it."""
    text = page_of(DOCUMENTS)
    assert PAGE.read_text() == text
    assert len(text.split()) < MOST_WORDS


def test_every_document_has_its_rows_and_every_row_what_its_state_asks_for() -> None:
    assert [document.key for document in DOCUMENTS] == ["000", "001", "003", "004"]
    assert len({(row.document, row.part, row.what) for row in ROWS}) == len(ROWS)
    for row in ROWS:
        assert row.what and row.there and row.state in STATES, row
        tests = [shlex.split(run.run)[:3] == ["python", "-m", "pytest"] for run in row.runs]
        assert (row.state == "outside") == (not row.runs), row
        assert (row.state in ("bounded", "outside")) == bool(row.bound), row
        assert row.state != "tested" or all(tests), row
        assert row.state != "works" or not all(tests), row
        assert bool(row.code) == (row.state != "outside"), row


def test_figures_say_what_they_are_and_how_near_they_must_be() -> None:
    """No tolerance is wider than a third of its figure, but of small counts."""
    for row in ROWS:
        for figure in row.figures:
            assert figure.reads.count("{}") == 1 and figure.unit, row
            assert figure.within <= max(abs(figure.is_) / 3.0, 1.0), row


def test_files_tests_and_anchors_that_rows_name_exist() -> None:
    for row in ROWS:
        for path in row.code.split():
            assert (ROOT / path).exists(), path
        for run in row.runs:
            for path in re.findall(r"\btests/\S+", run.run):
                assert (ROOT / path).exists(), path
    for file, anchor in LINK.findall(PAGE.read_text()):
        page = PAGE.parent / file if file else PAGE
        assert page.exists(), file
        assert not anchor or anchor in anchors(page), f"{file}#{anchor}"


def test_commands_parse(parsed: list[str]) -> None:  # noqa: F811
    """With every option, but not run."""
    from poise.training.cli.entry import main

    runs = [run for run in runs_of(ROWS) if run.run.startswith("poise ")]
    for run in runs:
        assert main(shlex.split(run.run)[1:]) == 0, run.run
    assert len(parsed) == len(runs)


def test_figures_are_read_and_compared() -> None:
    """A number where the text is, also across lines and columns; one off by more is a fault."""
    figure = Figure("speed: {} m/s", 0.5, 0.02, "m/s")
    assert figure.read("x\nspeed:\t0.513\n m/s") == 0.513
    assert Figure("│ pd │ {} │", 0.0, 0.0, "").read("│ 1 │ pd   │   0.44 │ 3 │") == 0.44
    assert figure.holds(0.519) and not figure.holds(0.521) and not figure.holds(0.47)
    with pytest.raises(ValueError, match="no 'speed"):
        figure.read("velocity: 0.5 m/s")
    run = next(run for run in DAILY if run.exit == 0)
    assert list(faults(run, 1, "")) and list(faults(run, 0, "nothing"))


def test_j50_is_read_as_evaluate_prints_it() -> None:
    """Of controllers named in a command, which `make weekly` alone runs."""
    entry = {"fraction50": 1.0, "fraction50_ci95": (0.9, 1.2)}
    figures = [figure for row in ROWS for figure in row.figures if "J50" in figure.unit]
    for figure in figures:
        name = figure.reads.split()[1]
        bound = {"fraction50_bound": "lower"} if "≥" in figure.reads else {}
        assert figure.read(f"│ 1 │ {name} │ {J50_SCALED.text(entry | bound)} │") == 1.0
    assert len(figures) >= 12


def test_errors_of_a_motion_are_read_by_the_words_of_their_columns() -> None:
    reads = [figure.reads for row in ROWS for run in row.runs for figure in run.figures
             if run.run.startswith("poise motion follow") and "│" in figure.reads]  # fmt: skip
    assert {text.removesuffix(" │ {}") for text in reads} <= {each.words for each in PERFORMED}


def test_a_command_of_two_rows_has_the_figures_of_both() -> None:
    one, other = Figure("a {}", 1.0, 0.0, ""), Figure("b {}", 2.0, 0.0, "")
    rows = [Row("000", "", name, "", "works", runs=(Run("poise demo", figures=(figure,)),))
            for name, figure in (("x", one), ("y", other), ("z", one))]  # fmt: skip
    assert [run.figures for run in runs_of(rows)] == [(one, other)]


@pytest.mark.parametrize("run", DAILY[::3], ids=[run.run for run in DAILY[::3]])
def test_daily_figures_hold(run, tmp_path: Path) -> None:
    """A third of them: the weekly test below has all."""
    code, output = run_here(run, prepare(tmp_path))
    assert list(faults(run, code, output)) == []


@pytest.mark.weekly
@pytest.mark.parametrize("document", DOCUMENTS, ids=[document.key for document in DOCUMENTS])
def test_every_figure_holds(document: Document, tmp_path: Path, can_render: None) -> None:
    """In order, in one folder: a command may need what an earlier one of the document wrote."""
    place = prepare(tmp_path)
    wrong = [
        fault for run in runs_of(document.rows) for fault in faults(run, *run_alone(run, place))
    ]
    assert not wrong, "\n\n".join(wrong)
