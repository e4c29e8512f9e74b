"""training/benchmarking/results/scenario_page.py: the page of scenarios."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from poise.configs.errors import ConfigError
from poise.training.benchmarking.results.leaderboard import write_leaderboard
from poise.training.benchmarking.results.scenario_page import scenario_page
from poise.training.benchmarking.results.summary import read_summary
from poise.training.cli.entry import main

ROOT = Path(__file__).parents[4]
ROBOTS = ("unitree_g1", "booster_t1", "unitree_h1")
SOURCES = {name: ROOT / f"docs/results/scenarios-{name}.json" for name in ROBOTS}


def changed(path: Path, change: Any) -> Path:
    """A copy of the G1's result, changed."""
    data = json.loads(SOURCES["unitree_g1"].read_text())
    change(data)
    path.write_text(json.dumps(data))
    return path


def rows(text: str) -> dict[str, list[str]]:
    """name → the cells of its first row."""
    found: dict[str, list[str]] = {}
    for line in text.splitlines():
        if line.startswith("| `"):
            name, *cells = line.strip("| ").split(" | ")
            found.setdefault(name.strip("`"), cells)
    return found


def test_the_committed_page_is_generated() -> None:
    """docs/scenarios.md is what the command that it names makes of the results that it names."""
    text = (ROOT / "docs/scenarios.md").read_text()
    (command,) = re.findall("`poise leaderboard ([^`]+)`", text)
    *sources, flag, page = command.split()
    assert (flag, page) == ("--page", "docs/scenarios.md")
    assert scenario_page({n: read_summary(ROOT / n) for n in sources}, page) == text
    assert [f"## `{name}`" in text for name in ROBOTS] == [True] * 3


def test_cells_are_those_of_the_result(tmp_path: Path) -> None:
    """The best of all but the walk comes first."""
    page = tmp_path / "page.md"
    assert main(["leaderboard", str(SOURCES["unitree_g1"]), "--page", str(page)]) == 0
    found, entries = rows(page.read_text()), read_summary(SOURCES["unitree_g1"])["controllers"]
    together = []
    for name, cells in found.items():
        own = {each["scenario"]: each for each in entries[name]["scenarios"]}
        assert cells[4].startswith(f"{own['arms']['never_fell_rate']:.0%} [")
        if "walk" in own:
            assert cells[6].startswith(f"{own['walk']['never_fell_rate']:.0%} [")
        else:
            assert cells[6] == "–"
        stood, trials = cells[7].split(" [")[0].split(" of ")
        kept = (round(e["never_fell_rate"] * e["trials"]) for n, e in own.items() if n != "walk")
        assert int(stood) == sum(kept) and int(trials) == 88
        together.append(int(stood))
        speed = own.get("walk", {}).get("speed_ahead")
        assert cells[8] == ("–" if speed is None else f"{speed:.2f}")
    assert together == sorted(together, reverse=True) and found.keys() == entries.keys()


def test_a_later_result_takes_the_place_of_an_earlier_one(tmp_path: Path) -> None:
    def fewer(data: dict[str, Any]) -> None:
        only = "walk-off-g1"
        data["controllers"] = {only: data["controllers"][only]}
        data["controllers"][only]["scenarios"][0]["never_fell_rate"] = 0.25
        data["ranking"], data["pairs"], data["reference"] = [only], [], only
        data["step_limits"] = []

    later = changed(tmp_path / "later.json", fewer)
    page = write_leaderboard([SOURCES["unitree_g1"], later], tmp_path / "page.md")
    found = rows(page.read_text())
    assert found["walk-off-g1"][0].startswith("25% [") and len(found) > 10


def test_each_level_has_a_table_of_its_own(tmp_path: Path) -> None:
    later = changed(tmp_path / "later.json", lambda data: data.update(realism="field"))
    sources = [SOURCES["unitree_g1"], later]
    text = write_leaderboard(sources, tmp_path / "page.md").read_text()
    known, in_field = text.split("\n## `unitree_g1`, `field`\n")
    assert rows(known) == rows(in_field) and "\n## `unitree_g1`\n" in known


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda data: data.update(seed=3), "seed: is not that of"),
        (lambda data: data.update(suite="other"), "suite: is not that of"),
        (
            lambda data: data["controllers"]["pd"]["scenarios"][0].update(scenario="storm"),
            "controllers.pd: has other scenarios than",
        ),
        (
            lambda data: [entry.pop("scenarios") for entry in data["controllers"].values()],
            "suite: is not of scenarios as the first is",
        ),
        (
            lambda data: data["controllers"]["pd"]["scenarios"][0].update(trials="many"),
            "controllers.pd.scenarios",
        ),
    ],
)
def test_results_that_do_not_fit_are_named(tmp_path: Path, change: Any, says: str) -> None:
    def renamed(data: dict[str, Any]) -> None:
        data["controllers"]["pd"] = data["controllers"].pop("lqr-lip")
        data["ranking"][data["ranking"].index("lqr-lip")] = "pd"
        data["pairs"], data["step_limits"] = [], []
        change(data)

    path = changed(tmp_path / "changed.json", renamed)
    with pytest.raises(ConfigError, match=re.escape(says)):
        write_leaderboard([SOURCES["unitree_g1"], path], tmp_path / "page.md")
    assert not (tmp_path / "page.md").exists()
