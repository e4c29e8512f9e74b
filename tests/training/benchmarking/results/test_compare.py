"""results/compare.py and leaderboard.py, metrics/entry.py, pairs.py and
tick_times.py.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, TypedDict

import pytest
from rich.console import Console

from poise.configs.errors import ConfigError
from poise.configs.schema import to_yaml
from poise.training.benchmarking.evaluation.folder import Settings
from poise.training.benchmarking.evaluation.tables import ranked
from poise.training.benchmarking.evaluation.tick_times import tick_times
from poise.training.benchmarking.metrics.entry import controller_entry
from poise.training.benchmarking.metrics.pairs import alike, pair_figures, paired
from poise.training.benchmarking.results.compare import compare, print_comparison
from poise.training.benchmarking.results.leaderboard import leaderboard, write_leaderboard
from poise.training.benchmarking.results.summary import read_summary
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.trials.agents import Agent, load_agent
from poise.training.benchmarking.trials.table import COLUMNS, trial_row
from poise.training.benchmarking.trials.trial import Trial, failed_trial
from poise.training.cli.entry import main
from poise.training.running.files import csv_text
from poise.training.running.provenance import Circumstances
from poise.training.running.summary import Entry, Summary
from poise.training.running.trial_figures import Rate
from tests.support.refused import invalid
from tests.support.shared import robot
from tests.training.benchmarking.evaluation.test_folder import OUTCOME
from tests.training.benchmarking.suites.test_factors import part, small, won_below

WON = replace(OUTCOME, sway=0.1, sway_recovery=1.0)
LOST = failed_trial(RuntimeError("no"))


CIRCUMSTANCES: Circumstances = {
    "command": "poise", "versions": {"poise": "0.1.0", "mujoco": "3.17.0"},
    "machine": {"system": "Linux", "processor": "abacus", "cores": 2}, "workers": 2,
    "backend": "local", "commit": "0123456789abcdef", "seconds": 1.0,
}  # fmt: skip


def rate(won: int, trials: int) -> Rate:
    share = won / trials
    return {"recovered": won, "trials": trials, "recovered_rate": share,
            "recovered_ci95": (max(share - 0.1, 0.0), min(share + 0.1, 1.0))}  # fmt: skip


class Compared(TypedDict):
    lost: int
    won: int
    p_mcnemar: float


def entry(outcomes: list[bool], j50: float) -> Entry:
    compared: Compared = {"lost": 0, "won": 0, "p_mcnemar": 1.0}
    return {
        **rate(sum(outcomes), len(outcomes)),
        "evaluated": 4, "errors": 0, "root_force_max": 0.5, "tick_us": 80.0, "fingerprint": "0",
        "j50_mean": j50, "j50_mean_ci95": (j50 - 1, j50 + 1), "j50_mean_per_mass": j50 / 40,
        "j50_min": 9.0, "j50_bounded": 0,
        "eta_mean": 0.7, "eta_mean_ci95": (0.6, 0.8), "eta_min": 0.5,
        "factors": [{"factor": "delay", "standard": "0", "levels": [
            {"level": "0", "standard": True, **rate(8, 10), **compared},
            {"level": "0.02", "standard": False, **rate(4, 10), **compared},
        ]}],
        "directions": [{"direction": 0.0, "trials": 4, "recovered": 2, "j50": 9.0,
                        "j50_ci95": (8.0, 10.0), "ankle_limit": 13.0, "eta": 0.66}],
    }  # fmt: skip


def write_result(folder: Path, recovered: dict[str, list[bool]], **j50: float) -> Path:
    """A finished folder with a mix of these outcomes."""
    folder.mkdir()
    names = list(recovered)
    entries = {name: entry(recovered[name], j50.get(name, 10.0)) for name in names}
    summary: Summary = {
        "format": 2, "suite": "quick", "seed": 0,
        "robot": {"name": "humanoid", "mass": 40.0, "height_com": 0.8, "omega": 3.5,
                  "human_com_height": 1.0, "ankle_limit": [(0.0, 13.0)]},
        "rated": "mix", "scale": "ankle limit", "reference": names[0],
        "ranking": ranked(entries),
        "controllers": entries, "seeds": [], "step_limits": [],
        "pairs": [{"a": names[0], "b": n, "both": 0, "only_a": 1, "only_b": 2, "neither": 1,
                   "p_mcnemar": 1.0} for n in names[1:]], **CIRCUMSTANCES,
    }  # fmt: skip
    marks = {name: f"{j50.get(name)}" for name in names}
    settings = Settings(2, "quick", {}, "humanoid", "abc", 0, None, {}, marks)
    rows = [
        trial_row(Trial(k, k, part="mix"), name, replace(OUTCOME, recovered=won))
        for name, outcomes in recovered.items() for k, won in enumerate(outcomes)
    ]  # fmt: skip
    (folder / "summary.json").write_text(json.dumps(summary))
    (folder / "settings.yaml").write_text(to_yaml(settings))
    (folder / "trials.csv").write_text(csv_text(rows, COLUMNS))
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
    assert j50.certain and not changes["η mean"].certain
    mix = changes["recovered, mix"]
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


def test_trials_with_other_pushes_are_no_pairs(tmp_path: Path) -> None:
    """Nor are those of other seeds or worlds: rates are then compared by their intervals."""
    folders = [write_result(tmp_path / name, {"pd": outcomes})
               for name, outcomes in (("a", YES), ("b", NO), ("c", NO))]  # fmt: skip
    for folder in folders:
        summary = json.loads((folder / "summary.json").read_text())
        (whole,) = summary["controllers"].values()
        keys = ("trials", "recovered", "recovered_rate", "recovered_ci95", "evaluated", "errors")
        summary["controllers"]["pd"] = {key: whole[key] for key in keys}
        (folder / "summary.json").write_text(json.dumps(summary | {"rated": None}))
    lines = (folders[2] / "trials.csv").read_text().splitlines()
    other = [line.replace(",0.0,0.0,", ",0.0,0.1,", 1) for line in lines]  # the error of the masses
    assert other != lines
    (folders[2] / "trials.csv").write_text("\n".join(other) + "\n")
    (change,) = compare(folders[0], folders[1]).changes
    assert (change.figure, change.change) == ("recovered", -0.75)
    assert change.note == "3 lost, 0 won, p = 0.25"
    (apart,) = compare(folders[0], folders[2]).changes
    assert apart.change == -0.75 and not apart.note
    assert (apart.low, apart.high) == pytest.approx((-0.75 - 0.1, -0.75 + 0.02**0.5))


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("summary.json", None, "no finished result: summary.json missing"),
        ("summary.json", "{}", "summary.json: .*is of an older Poise"),
        ("summary.json", '{"format": 2}', "summary.json: .* is missing"),
        ("trials.csv", "a,b\n1,2\n", "trials.csv: lacks the columns trial, controller"),
        ("settings.yaml", None, "settings.yaml missing"),
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
    data = json.loads(file.read_text())
    for key in [key for key in data["controllers"]["pd"] if key.startswith(("j50", "eta", "dir"))]:
        del data["controllers"]["pd"][key]
    data["ranking"].reverse()  # without a common J50 the rate decides
    file.write_text(json.dumps(data))
    with invalid("controllers.pd"):
        write_leaderboard([folder], page)
    (folder / "summary.json").write_text("{}")
    with invalid("format"):
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
    (line,) = (line for line in text.splitlines() if line.startswith("Run later"))
    assert line.endswith("cores: `abe07`.")
    data = json.loads((b / "summary.json").read_text())
    (b / "summary.json").write_text(json.dumps({**data, "seed": data["seed"] + 1}))
    with invalid("seed") as error:
        write_leaderboard([a, b], page)
    assert error.value.field == "seed" and page.read_text() == text


def test_the_ankle_limit_may_be_told_in_more_directions(tmp_path: Path) -> None:
    """Later results have its corners, too; where both tell it, it is the same."""
    a = write_result(tmp_path / "a", {"pd": YES, "abe07": NO})
    b = write_result(tmp_path / "b", {"pd": NO, "abe07": YES}, abe07=8.0)
    page, file = tmp_path / "page.md", b / "summary.json"
    data = json.loads(file.read_text())
    limit = data["robot"]["ankle_limit"]
    limit.insert(1, [limit[0][0] + 0.5, 20.0])
    file.write_text(json.dumps(data))
    write_leaderboard([a, b], page)
    assert "`abe07` | 8.0 [" in page.read_text()
    limit[0][1] += 1.0
    file.write_text(json.dumps(data))
    with invalid("robot") as error:
        write_leaderboard([a, b], page)
    assert error.value.field == "robot"


def every(plan: TrialPlan, edge: float = 1e9) -> list[Trial]:
    """All trials of a controller that recovers pushes below an impulse in the first stage."""
    return plan.trials(won_below(plan, edge))[plan.names[0]]


def test_levels_are_compared_with_the_standard_case_on_the_same_trials() -> None:
    """A level that loses one and wins none of its trials; errors count as not recovered."""
    plan = small()
    lost = {trial.number for trial in every(plan) if trial.factor == "delay" or trial.level == "3"}
    played = [(trial, LOST if trial.number in lost else WON) for trial in every(plan)]
    played[1] = (played[1][0], replace(OUTCOME, root_force=12.5))  # outside of the mix
    entry = controller_entry(played, plan)
    assert entry["root_force_max"] == 12.5 and entry["trials"] == 2
    assert entry["errors"] == len(lost) and entry["evaluated"] == len(played)
    (delay,) = (f for f in entry["factors"] if f["factor"] == "delay")
    standard, level = delay["levels"]
    assert (standard["level"], standard["recovered_rate"]) == ("0", 1.0)
    assert (level["lost"], level["won"], level["recovered_rate"]) == (1, 0, 0.0)
    assert entry["eurobench"]["body_sway_mean"] == pytest.approx(0.1, abs=0.1)
    assert entry["eurobench"]["margins"][0]["impulse"] is None  # one run is no level


def test_margins_are_normalised_by_size() -> None:
    """The largest level with less than 30 % falls, as force and energy of a 0.1 s push."""
    plan = small(margin={"directions": [90], "levels": [0.5, 1.0], "runs": 10})
    margin = part(plan, "margin")
    fallen = {trial.number for trial in margin[10:13]} | {margin[0].number}
    played = [(trial, LOST if trial.number in fallen else WON) for trial in every(plan)]
    (found,) = controller_entry(played, plan)["eurobench"]["margins"]
    impulse = 0.5 * plan.limits.ankle(90, 0.1)
    assert found["impulse"] == pytest.approx(impulse) and not found["largest_tried"]
    assert found["force"] == pytest.approx(10 * impulse)
    assert found["energy"] == pytest.approx(impulse**2 / 2 / robot().mass)
    # half the mass of the human, its lower CoM: the same push means more to a human
    assert found["force_normalised"] > found["force"]


def test_pairs_are_trials_alike_in_all() -> None:
    """Second stages have the same numbers but other pushes: they are no pairs."""
    plan = small(mix=None, factors=None, margin=None)
    one = [(trial, WON) for trial in every(plan)]
    other = [(trial, LOST) for trial in every(plan, edge=0.0)]
    met = alike(one, other)
    found = paired(met)
    assert found is not None
    assert [found[k] for k in ("both", "only_a", "only_b", "neither")] == [0, 4, 0, 0]
    assert found["rate_gain"] == -1.0 and not alike(one, [(Trial(99, 1), WON)])
    assert paired([]) is None
    entries: Any = {name: {"j50_mean": 10.0, "j50_mean_ci95": (9.0, 11.0)} for name in "ab"}
    pair = pair_figures("a", "b", {"a": one, "b": other}, entries)
    assert pair["all"] == found and not pair["identical"] and "directions" not in pair
    assert pair["j50_gain"] == pytest.approx(0.0)


def test_ticks_are_timed_and_leave_no_trace() -> None:
    """A number for each, none for one that raises; the controller is in its place again."""
    agents = {name: load_agent(name, robot(), pushes=None) for name in ("momentum-qp", "zero")}

    def broken(observation: object) -> None:
        raise RuntimeError

    env = load_agent("pd", robot(), pushes=None).env
    agents["broken"] = Agent("broken", env, broken, "")
    inner = agents["momentum-qp"].env.controller
    times = tick_times(agents)
    assert 5.0 < times["momentum-qp"] < 1e5 and times["broken"] is None
    assert 0.0 < times["zero"] < times["momentum-qp"]
    assert agents["momentum-qp"].env.controller is inner and agents["momentum-qp"].env._compiled


def test_the_committed_leaderboard_is_generated() -> None:
    """docs/leaderboard.md is what the command that it names makes of the results that it names."""
    root = Path(__file__).parents[4]
    text = (root / "docs/leaderboard.md").read_text()
    (command,) = re.findall("`poise leaderboard ([^`]+)`", text)
    assert leaderboard({name: read_summary(root / name) for name in command.split()}) == text
