"""training/benchmark: results/compare.py, results/leaderboard.py, learning/seeds.py and
benchmark/tick_times.py.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from poise.configs.errors import ConfigError
from poise.configs.schema import to_yaml
from poise.training.benchmark.case import Case, Result, failed
from poise.training.benchmark.figures import controller_figures, pair_figures, paired
from poise.training.evaluation.tick_times import tick_times
from poise.training.cli.commands import main
from poise.training.results.benchmark import read_summary
from poise.training.results.compare import compare, print_comparison
from poise.training.results.leaderboard import leaderboard, write_leaderboard
from poise.training.trials.players import Player, load_player
from tests.support.shared import robot
from tests.training.benchmark.test_cases import small
from tests.training.evaluation.test_folder import OUTCOME

WON = Result(OUTCOME, sway=0.1, sway_recovery=1.0)
LOST = failed(RuntimeError("no"))


def rate(won: int, trials: int) -> dict[str, Any]:
    share = won / trials
    return {"recovered": won, "trials": trials, "recovered_rate": share,
            "recovered_ci95": [share - 0.1, share + 0.1]}  # fmt: skip


def write_result(folder: Path, recovered: dict[str, list[bool]], **j50: float) -> Path:
    """A benchmark's folder with a mix of these outcomes, as far as comparisons read it."""
    folder.mkdir()
    names = list(recovered)
    entries = {
        name: {
            "trials": 4, "errors": 0, "root_force_max": 3.0, "tick_us": 80.0,
            "j50_mean": j50.get(name, 10.0),
            "j50_mean_ci95": [j50.get(name, 10.0) - 1, j50.get(name, 10.0) + 1], "j50_bounded": 0,
            "eta_mean": 0.7, "eta_mean_ci95": [0.6, 0.8], "eta_min": 0.5,
            "mix": rate(sum(recovered[name]), 4),
            "factors": [{"factor": "delay", "standard": "0", "levels": [
                {"level": "0", "standard": True, **rate(8, 10)},
                {"level": "0.02", "standard": False, **rate(4, 10)},
            ]}],
            "directions": [{"direction": 0.0, "j50": 9.0, "j50_ci95": [8.0, 10.0], "eta": 0.66}],
        }
        for name in names
    }  # fmt: skip
    summary = {
        "benchmark": 1, "suite": "quick", "seed": 0, "robot": {"name": "humanoid"},
        "reference": names[0], "ranking": sorted(names, key=lambda n: -entries[n]["j50_mean"]),
        "controllers": entries, "seeds": [], "commit": "0123456789abcdef",
        "versions": {"poise": "0.1.0", "mujoco": "3.17.0"},
        "machine": {"processor": "abacus", "cores": 2},
        "pairs": [{"b": n, "mix": {"only_a": 1, "only_b": 2, "p_mcnemar": 1.0}} for n in names[1:]],
    }  # fmt: skip
    (folder / "summary.json").write_text(json.dumps(summary))
    (folder / "settings.yaml").write_text(
        to_yaml({"seed": 0, "controllers": {name: f"{j50.get(name)}" for name in names}})
    )
    lines = ["trial,controller,seed,stage,part,factor,level,impulse,recovered"]
    for name, outcomes in recovered.items():
        lines += [f"{k},{name},{k},1,mix,,,{k}.5,{won}" for k, won in enumerate(outcomes)]
    (folder / "trials.csv").write_text("\n".join(lines) + "\n")
    return folder


YES, NO = [True] * 4, [True, False, False, False]


def test_a_comparison_says_what_changed(tmp_path: Path) -> None:
    """Rates in pairs, with lost and won; J50 by its intervals; what is alike is only named."""
    a = write_result(tmp_path / "a", {"pd": YES, "abe07": NO, "old": YES})
    b = write_result(tmp_path / "b", {"pd": YES, "abe07": YES, "new": YES}, abe07=15.0)
    found = compare(a, b)
    assert (found.only_a, found.only_b, found.identical) == (("old",), ("new",), ("pd",))
    assert found.changed == ("abe07",) and not found.settings
    changes = {change.figure: change for change in found.changes}
    assert {change.controller for change in found.changes} == {"abe07"}
    j50 = changes["mean J50 [N·s]"]
    assert (j50.change, j50.low, j50.high) == pytest.approx((5.0, 5 - 2**0.5, 5 + 2**0.5))
    assert j50.certain and not changes["mean η"].certain
    mix = changes["recovered of the mix"]
    assert mix.change == 0.75 and mix.note == "0 lost, 3 won, p = 0.25"
    assert changes["delay 0.02"].note == "" and changes["delay 0.02"].change == 0.0
    assert "J50 at 0° [N·s]" in changes


def test_a_comparison_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By the command; a result with itself has no table."""
    a = write_result(tmp_path / "a", {"pd": YES})
    b = write_result(tmp_path / "b", {"pd": NO}, pd=15.0)
    assert main(["compare", str(a), str(b)]) == 0
    text = capsys.readouterr().out
    assert "3 lost, 0 won" in text and "more" in text and "another version" in text
    print_comparison(compare(a, a), "a", "a", Console(width=120))
    text = capsys.readouterr().out
    assert text.strip() == "the same outcome in every trial: pd"


def test_evaluations_are_compared_alike(tmp_path: Path) -> None:
    """Without parts; trials with other pushes are no pairs, their rates are compared apart."""
    folders = []
    for name, outcomes in (("a", YES), ("b", NO), ("c", NO)):
        folder = write_result(tmp_path / name, {"pd": outcomes})
        summary = json.loads((folder / "summary.json").read_text())
        del summary["benchmark"]
        summary["controllers"]["pd"] = rate(sum(outcomes), 4)
        (folder / "summary.json").write_text(json.dumps(summary))
        folders.append(folder)
    other = (folders[2] / "trials.csv").read_text()
    (folders[2] / "trials.csv").write_text(other.replace(".5,", ".7,"))
    (change,) = compare(folders[0], folders[1]).changes
    assert (change.figure, change.change) == ("recovered", -0.75)
    assert change.note == "3 lost, 0 won, p = 0.25"
    (apart,) = compare(folders[0], folders[2]).changes
    assert apart.change == -0.75 and not apart.note
    assert (apart.low, apart.high) == pytest.approx((-0.75 - 0.02**0.5, -0.75 + 0.02**0.5))


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("summary.json", None, "summary.json: cannot be read .*: not a finished result"),
        ("summary.json", "{}", "summary.json: is no summary"),
        ("summary.json", '{"controllers": {}}', "one is a benchmark, the other an evaluation"),
        ("trials.csv", "a,b\n1,2\n", "trials.csv: has no column 'recovered'"),
        ("settings.yaml", None, "settings.yaml: cannot be read"),
    ],
)
def test_folders_that_cannot_be_compared(
    tmp_path: Path, name: str, text: str | None, message: str
) -> None:
    """The text names the file."""
    a = write_result(tmp_path / "a", {"pd": YES})
    b = write_result(tmp_path / "b", {"pd": YES})
    (b / name).unlink()
    if text is not None:
        (b / name).write_text(text)
    with pytest.raises(ConfigError, match=message):
        compare(a, b)


def test_the_leaderboard_ranks_and_says_where_it_comes_from(tmp_path: Path) -> None:
    """A page from the folder or its summary, by the command; best first."""
    folder = write_result(tmp_path / "a", {"pd": YES, "abe07": NO}, abe07=15.0)
    page = tmp_path / "docs/leaderboard.md"
    assert main(["leaderboard", str(folder), "--page", str(page)]) == 0
    text = page.read_text()
    assert text.index("| 1 | `abe07` | 15.0 [14.0, 16.0]") < text.index("| 2 | `pd` | 10.0")
    assert "| delay | 0.02 | 40% | 40% |" in text and "`0123456789`" in text
    assert f"poise leaderboard {folder}" in text
    file = folder / "summary.json"
    write_leaderboard([file], page)
    assert page.read_text() == leaderboard({str(file): json.loads(file.read_text())})
    (folder / "summary.json").write_text("{}")
    with pytest.raises(ConfigError, match="is not a benchmark's summary"):
        write_leaderboard([folder], page)
    assert main(["leaderboard", "--page", str(page)]) == 2


def test_later_results_take_their_rows(tmp_path: Path) -> None:
    """By name, ranked anew, said where from; not the reference's, and not from another suite."""
    a = write_result(tmp_path / "a", {"pd": YES, "abe07": NO, "lip-mpc": NO}, abe07=15.0)
    b = write_result(tmp_path / "b", {"pd": NO, "abe07": YES}, abe07=8.0, pd=50.0)
    page = tmp_path / "page.md"
    write_leaderboard([a, b], page)
    text = page.read_text()
    assert text.index("`pd` | 10.0 [") < text.index("`abe07` | 8.0 [")
    assert f"poise leaderboard {a} {b}`" in text and "15.0" not in text and "50.0" not in text
    (line,) = (line for line in text.splitlines() if line.startswith("Played later"))
    assert line.endswith("cores: `abe07`.")
    data = json.loads((b / "summary.json").read_text())
    (b / "summary.json").write_text(json.dumps({**data, "seed": data["seed"] + 1}))
    with pytest.raises(ConfigError, match="is not that of") as error:
        write_leaderboard([a, b], page)
    assert error.value.field == "seed" and page.read_text() == text


def test_levels_are_compared_with_the_standard_case_on_the_same_trials() -> None:
    """A level that loses one and wins none of its trials; errors count as not recovered."""
    cases = small()
    second = cases.second(dict.fromkeys(range(4), True))
    every = [*cases.first, *second, *cases.others]
    lost = {case.number for case in every if case.factor == "delay" or case.level == "3"}
    played = [(case, LOST if case.number in lost else WON) for case in every]
    pulled = Result(replace(OUTCOME, root_force=12.5))  # outside of the mix
    played[1] = (played[1][0], pulled)
    entry = controller_figures(played, cases)
    assert entry["root_force_max"] == 12.5
    assert entry["errors"] == len(lost) and entry["trials"] == len(every)
    (delay,) = (f for f in entry["factors"] if f["factor"] == "delay")
    standard, level = delay["levels"]
    assert (standard["level"], standard["recovered_rate"]) == ("0", 1.0)
    assert (level["lost"], level["won"], level["recovered_rate"]) == (1, 0, 0.0)
    assert entry["eurobench"]["body_sway_mean"] == pytest.approx(0.1)
    assert entry["eurobench"]["margins"][0]["impulse"] is None  # one run is no level


def test_margins_are_normalised_by_size() -> None:
    """The largest level with less than 30 % falls, as force and energy of a 0.1 s push."""
    cases = small(margin={"directions": [90], "levels": [0.5, 1.0], "runs": 10})
    margin = [case for case in cases.others if case.part == "margin"]
    every = [*cases.first, *cases.second(dict.fromkeys(range(4), True)), *cases.others]
    fallen = {case.number for case in margin[10:13]} | {margin[0].number}
    played = [(case, LOST if case.number in fallen else WON) for case in every]
    (found,) = controller_figures(played, cases)["eurobench"]["margins"]
    impulse = 0.5 * cases.limits.ankle(90, 0.1)
    assert found["impulse"] == pytest.approx(impulse) and not found["largest_tried"]
    assert found["force"] == pytest.approx(10 * impulse)
    assert found["energy"] == pytest.approx(impulse**2 / 2 / robot().mass)
    # half the mass of the human, its lower CoM: the same push means more to a human
    assert found["force_normalised"] > found["force"]


def test_pairs_are_trials_alike_in_all() -> None:
    """Second stages have the same numbers but other pushes: they are no pairs."""
    cases = small()
    one = [(case, WON) for case in [*cases.first, *cases.second(dict.fromkeys(range(4), True))]]
    other = [(case, LOST) for case in [*cases.first, *cases.second(dict.fromkeys(range(4), False))]]
    found = paired(one, other)
    assert found is not None
    assert [found[k] for k in ("both", "only_a", "only_b", "neither")] == [0, 4, 0, 0]
    assert found["rate_gain"] == -1.0 and paired(one, [(Case(99, 1), WON)]) is None
    entries = {name: {"j50_mean": 10.0, "j50_mean_ci95": [9.0, 11.0]} for name in "ab"}
    pair = pair_figures("a", "b", {"a": one, "b": other}, entries)
    assert pair["mix"] is None and pair["j50_gain"] == pytest.approx(0.0)


def test_ticks_are_timed_and_leave_no_trace() -> None:
    """A number for each, none for one that raises; the controller is in its place again."""
    players = {name: load_player(name, robot(), pushes=None) for name in ("momentum-qp", "zero")}

    def broken(observation: object) -> None:
        raise RuntimeError

    env = load_player("pd", robot(), pushes=None).env
    players["broken"] = Player("broken", env, broken, "")
    inner = players["momentum-qp"].env.controller
    times = tick_times(players)
    assert 5.0 < times["momentum-qp"] < 1e5 and times["broken"] is None
    assert 0.0 < times["zero"] < times["momentum-qp"]
    assert players["momentum-qp"].env.controller is inner and players["momentum-qp"].env._compiled


def test_the_committed_leaderboard_is_generated() -> None:
    """docs/leaderboard.md is what the command that it names makes of the results that it names."""
    root = Path(__file__).parents[3]
    text = (root / "docs/leaderboard.md").read_text()
    (command,) = re.findall("`poise leaderboard ([^`]+)`", text)
    assert leaderboard({name: read_summary(root / name) for name in command.split()}) == text
