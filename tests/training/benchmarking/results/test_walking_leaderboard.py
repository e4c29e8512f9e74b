"""training/benchmarking/results/walking_leaderboard.py: the page of controllers that walk."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from poise.configs.errors import ConfigError
from poise.training.benchmarking.results.leaderboard import write_leaderboard
from poise.training.benchmarking.results.summary import read_summary
from poise.training.benchmarking.results.walking_leaderboard import walking_leaderboard
from poise.training.cli.entry import main

ROOT = Path(__file__).parents[4]
ONE = ROOT / "docs/results/walkers-walk.json"
OTHER = ROOT / "docs/results/walkers-walk-spring.json"


def changed(path: Path, source: Path, change: Any) -> Path:
    """A copy of a result, changed."""
    data = json.loads(source.read_text())
    change(data)
    path.write_text(json.dumps(data))
    return path


def rows(text: str) -> list[list[str]]:
    """The cells of all rows of tables."""
    return [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]


@pytest.mark.parametrize("page", sorted(ROOT.glob("docs/walking-leaderboard*.md")))
def test_the_committed_page_is_generated(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A page is what the command that it names makes of the results that it names."""
    monkeypatch.chdir(ROOT)
    (command,) = re.findall("`poise leaderboard ([^`]+)`", page.read_text())
    assert write_leaderboard(command.split(), tmp_path / "page.md").read_text() == page.read_text()


def test_a_folder_of_results_is_all_of_them(tmp_path: Path) -> None:
    """The same tables as by naming each; an empty folder is refused by its name."""
    folder = tmp_path / "walkers"
    folder.mkdir()
    with pytest.raises(ConfigError, match="walkers"):
        write_leaderboard([folder])
    for k, result in enumerate((ONE, OTHER)):
        (folder / f"{k}.json").write_bytes(result.read_bytes())
    whole, named = (write_leaderboard(of, tmp_path / f"{len(of)}.md").read_text()
                    for of in ([folder], [ONE, OTHER]))  # fmt: skip
    assert rows(whole) == rows(named) and f"`poise leaderboard {folder}`" in whole


def test_walks_are_ranked_by_j50_whatever_the_order_of_results(tmp_path: Path) -> None:
    """By the command; the same page but for its sources; falls are summed over the commands."""
    pages = []
    for k, order in enumerate(((ONE, OTHER), (OTHER, ONE))):
        pages.append(tmp_path / f"{k}.md")
        assert main(["leaderboard", *map(str, order), "--page", str(pages[-1])]) == 0
    first, second = (rows(page.read_text()) for page in pages)
    assert first == second
    places = {row[1]: row for row in first if row[0] in ("1", "2")}
    entry = read_summary(OTHER)["controllers"]["walk-spring"]
    assert float(places["`walk`"][2].split()[0]) > float(places["`walk-spring`"][2].split()[0])
    walks = [level for level in entry["walks"] if level["part"] == "walk"]
    fallen = sum(w["fallen"] for w in walks)
    assert fallen > 0 and places["`walk-spring`"][6] == f"{fallen}/{6 * len(walks)}"


def test_one_without_a_j50_comes_last_without_a_rank(tmp_path: Path) -> None:
    """Its other columns stay."""

    def forget(data: dict[str, Any]) -> None:
        entry = data["controllers"]["walk"]
        for key in [key for key in entry if key.startswith(("j50", "eta", "j90", "dir"))]:
            del entry[key]

    page = tmp_path / "page.md"
    write_leaderboard([changed(tmp_path / "a.json", ONE, forget), OTHER], page)
    ranked = [row[:3] for row in rows(page.read_text())[2:4]]
    assert [row[:2] for row in ranked] == [["1", "`walk-spring`"], ["–", "`walk`"]]
    assert ranked[1][2] == "–"


def test_the_page_says_what_j50_is_of() -> None:
    """The command, and how long a push takes, of those that say it."""
    first, second = read_summary(ONE), read_summary(OTHER)
    pushes = "J50 is of pushes while it walks (ahead 0.5)"

    def told(*durations: float | None) -> str:
        for summary, duration in zip((first, second), durations, strict=True):
            (entry,) = summary["controllers"].values()
            entry.pop("push_duration", None)
            if duration is not None:
                entry["push_duration"] = duration
        (line,) = [line for line in walking_leaderboard({"a": first, "b": second}).splitlines()
                   if line.startswith("J50 is")]  # fmt: skip
        return line

    assert told(None, None) == f"{pushes}."
    assert told(0.2, 0.2) == f"{pushes}, of 0.2 s."
    assert told(0.1, None) == f"{pushes}, of 0.1 s for `walk`."
    assert told(0.2, 0.1) == f"{pushes}, of 0.1 s for `walk-spring`, of 0.2 s for `walk`."


def by_falls(data: dict[str, Any]) -> None:
    """Make it a result of today."""
    for entry in data["controllers"].values():
        entry["criterion"] = "not fallen"


def test_older_verdicts_are_not_ranked_among_newer_ones(tmp_path: Path) -> None:
    """A J50 that counts walks off their command as lost has no place beside those by falls; the
    page says which it is."""
    pages = []
    for name, changes in (("old", (None, None)), ("mixed", (None, by_falls)),
                          ("new", (by_falls, by_falls))):  # fmt: skip
        sources = [
            source if change is None else changed(tmp_path / f"{name}{k}.json", source, change)
            for k, (source, change) in enumerate(zip((ONE, OTHER), changes, strict=True))
        ]
        page = tmp_path / f"{name}.md"
        write_leaderboard(sources, page)
        pages.append(page.read_text())
    old, mixed, new = pages
    assert "These results are older" in old and "goes by falls" not in old
    assert rows(old) == rows(new) and "goes by falls" in new and "are older" not in new
    assert "because their results are older and count walks off their command as lost: `walk`." in (
        mixed
    )
    ranked = {row[1]: row for row in rows(mixed)[2:4]}
    assert ranked["`walk-spring`"][0] == "1" and ranked["`walk`"][0] == "–"
    assert ranked["`walk`"][2] == "–" and "/48" in ranked["`walk`"][5]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d: d.update(seed=22), "seed: is not that of"),
        (lambda d: d["robot"].update(mass=41.0), "robot.mass: is not that of"),
        (
            lambda d: d["controllers"]["walk-spring"]["walks"].pop(0),
            "controllers.walk-spring: has no walks of the commands of",
        ),
        (lambda d: d["controllers"]["walk-spring"].update(walks=[]), "suite: is not of walks"),
    ],
)
def test_results_that_do_not_fit_are_named(tmp_path: Path, change: Any, says: str) -> None:
    """The file and the field; the page stays as it was."""
    page = tmp_path / "page.md"
    page.write_text("before")
    with pytest.raises(ConfigError, match=says) as error:
        write_leaderboard([ONE, changed(tmp_path / "b.json", OTHER, change)], page)
    assert str(tmp_path / "b.json") in str(error.value) and page.read_text() == "before"


def test_kicks_have_a_column_each_and_levels_tables_of_their_own(tmp_path: Path) -> None:
    """Who stays upright after a kick; a result of `field` neither replaces nor ranks with one of
    `ideal`, whatever the names."""

    def kicked(data: dict[str, Any]) -> None:
        walks = data["controllers"]["walk"]["walks"]
        for size, fallen in (("1 m/s", 2), ("3 m/s", 15)):
            walks.append({**walks[0], "part": "walk_kick", "level": size,
                          "trials": 20, "fallen": fallen})  # fmt: skip

    def later(data: dict[str, Any]) -> None:
        data["realism"] = "field"

    page = tmp_path / "page.md"
    one = changed(tmp_path / "a.json", ONE, kicked)
    namesake = tmp_path / "namesake.json"
    namesake.write_text(OTHER.read_text().replace('"walk-spring"', '"walk"'))
    write_leaderboard([one, OTHER, changed(tmp_path / "b.json", namesake, later)], page)
    ideal, field = page.read_text().split("## Realism level `field`")
    head, _, *ranked = rows(ideal)
    assert head[5:7] == ["kicked 1 m/s", "kicked 3 m/s"]
    assert {row[1]: row[6:8] for row in ranked[:2]} == {
        "`walk`": ["18/20", "5/20"], "`walk-spring`": ["–", "–"]}  # fmt: skip
    assert [row[:2] for row in rows(field)[2:3]] == [["1", "`walk`"]]
    assert rows(field)[2][2] == ranked[1][2] and "kicked" not in field


def test_a_controller_that_stands_where_it_is_to_walk_has_no_rank(tmp_path: Path) -> None:
    """It falls less than one that walks, and comes last; a fall is no standing."""

    def stand(data: dict[str, Any]) -> None:
        for level in data["controllers"]["walk"]["walks"]:
            level["step_length"], level["fallen"] = None, 0

    def fall(data: dict[str, Any]) -> None:
        stand(data)
        data["controllers"]["walk"]["walks"][0]["fallen"] = 1

    for change, order in ((stand, {"1": "`walk-spring`", "–": "`walk`"}),
                          (fall, {"1": "`walk`", "2": "`walk-spring`"})):  # fmt: skip
        standing = changed(tmp_path / "standing.json", ONE, change)
        page = write_leaderboard([standing, OTHER], tmp_path / "page.md")
        assert {row[0]: row[1] for row in rows(page.read_text()) if row[0] in order} == order
