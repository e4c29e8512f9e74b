"""The leaderboard page: what it adds to the table of the terminal."""

import json
from pathlib import Path

from poise.training.benchmarking.results.leaderboard import leaderboard, write_leaderboard
from poise.training.benchmarking.results.summary import read_summary

RESULT = Path(__file__).parents[4] / "docs/results/booster_t1.json"


def test_levels_of_realism_are_columns(tmp_path: Path) -> None:
    """With what was recovered at each, of those that a suite plays, its own first; without them,
    none."""
    summary = json.loads(RESULT.read_text())
    for entry in summary["controllers"].values():  # as a suite without levels has them
        entry["factors"] = [f for f in entry["factors"] if f["factor"] != "realism"]
    without = tmp_path / "without.json"
    without.write_text(json.dumps(summary))
    for entry in summary["controllers"].values():
        (delays,) = (f for f in entry["factors"] if f["factor"] == "delay")
        levels = [{**cell, "level": name} for cell, name in
                  zip(delays["levels"], ("ideal", "lab", "field"), strict=False)]  # fmt: skip
        levels = [*levels[1:], levels[0]]  # a result has the suite's own level last
        entry["factors"].append({**delays, "factor": "realism", "levels": levels})
    result = tmp_path / "summary.json"
    result.write_text(json.dumps(summary))
    lines = write_leaderboard([result], tmp_path / "page.md").read_text().splitlines()
    head = next(line for line in lines if line.startswith("|  | controller"))
    assert head.endswith("| chatter [1/s] | `ideal` | `lab` | `field` |")
    for name, entry in summary["controllers"].items():
        row = next(line for line in lines if f"| `{name}` |" in line).split(" | ")
        *others, own = entry["factors"][-1]["levels"]
        cells = [own, *others]
        found = [cell.strip(" |") for cell in row[-3:]]
        assert found == [f"{cell['recovered_rate']:.0%}" for cell in cells], name
    plain = write_leaderboard([without], tmp_path / "plain.md").read_text()
    assert "chatter [1/s] |\n" in plain and "`field`" not in plain


def test_the_standard_of_all_factors_is_one_row() -> None:
    """First, and named by every factor; each other level has its own, but for realism."""
    summary = json.loads(RESULT.read_text())
    entry = summary["controllers"][summary["ranking"][0]]
    page = leaderboard({"a": read_summary(RESULT)})
    table = page.partition("| factor | level |")[2].split("\n")[2:]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table if line]
    levels = [(f["factor"], cell) for f in entry["factors"] for cell in f["levels"]]
    own = [cell for _, cell in levels if cell["standard"]]
    assert len(own) == len(entry["factors"]) > 3 and len({c["recovered_rate"] for c in own}) == 1
    assert rows[0][0] == "standard" and rows[0][1].count(",") == len(own) - 1
    assert rows[0][2] == f"{own[0]['recovered_rate']:.0%}"
    others = [each for each in levels if not each[1]["standard"] and each[0] != "realism"]
    assert [row[:3] for row in rows[1:]] == [
        [factor, str(cell["level"]), f"{cell['recovered_rate']:.0%}"] for factor, cell in others
    ]


def test_factors_of_the_first_controllers_only() -> None:
    """Eight columns and the two before them; the line above says how many, and of more only."""
    names = ("leaderboard.json", "unitree_h1.json", "unitree_g1-velocity.json")
    for result in map(RESULT.with_name, names):
        summary = read_summary(result)
        page = leaderboard({str(result): summary})
        head = next(line for line in page.splitlines() if line.startswith("| factor | level |"))
        shown = [cell.strip(" `") for cell in head.strip("|").split("|")][2:]
        assert shown == summary["ranking"][:8]
        assert ("of the first 8 controllers" in page) == (len(summary["ranking"]) > 8)
