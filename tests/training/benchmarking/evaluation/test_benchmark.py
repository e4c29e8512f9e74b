"""`poise benchmark`: evaluation, trials/variants.py and the command."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import poise
from poise.configs.errors import ConfigError
from poise.envs.balance.config import StartNoise
from poise.envs.physics.pushes.push import Push
from poise.envs.sensing.estimator import EstimatedState
from poise.training.benchmarking.evaluation import run
from poise.training.benchmarking.evaluation.evaluate import (
    benchmark,
    default_controllers,
    packaged_policies,
)
from poise.training.benchmarking.evaluation.run import compared
from poise.training.benchmarking.results.read import load_results
from poise.training.benchmarking.results.replay import replay
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.benchmarking.trials.jobs import Job, TrialStage, run_job
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.table import outcome_cells
from poise.training.benchmarking.trials.trial import Conditions, Trial
from poise.training.benchmarking.trials.variants import AgentVariants
from poise.training.cli.entry import main
from poise.training.learning.policy import load_policy
from tests.support.benchmarks_small import TRIALS, InProcessExecutor, play_in_process, write_small
from tests.support.refused import invalid
from tests.support.shared import robot

BOTH = ("momentum-qp", "zero")
FLAKY = """
import numpy as np
class Flaky:
    period = 0.004
    def __init__(self, robot): self.robot = robot
    def reset(self, state): self.ticks = 0
    def torques(self, state, targets):
        self.ticks += 1
        if self.ticks > 60 and state.com_vel[1] > 0.05: raise ArithmeticError("too\\nfast")
        return np.zeros(self.robot.model.nu)
"""


@pytest.fixture(autouse=True)
def in_process(monkeypatch: pytest.MonkeyPatch) -> type[InProcessExecutor]:
    """Trials are played in this process, and ticks are not timed."""
    return play_in_process(monkeypatch)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished benchmark; do not write into it."""
    out = tmp_path_factory.mktemp("benchmark")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "Executor", InProcessExecutor)
        patch.setattr(run, "tick_times", lambda agents: dict.fromkeys(agents, 12.5))
        benchmark(BOTH, write_small(out), out=out / "out", seed=2)
    return out / "out"


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "trials.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_standard_case_is_that_of_an_evaluation() -> None:
    """Bit for bit the outcome of `run_trial`, also after other variants were played."""
    agent = load_agent("momentum-qp", robot(), duration=1.6, pushes=None)
    trial = Trial(0, 5, (Push("torso", 0.1, 0.1, 8.0, 30.0),))
    expected = run_trial(agent, trial)
    variants = AgentVariants(load_agent("momentum-qp", robot(), duration=1.6, pushes=None))
    changes = ({}, {"friction": 0.4}, {"delay": 0.02}, {"mass_error": 0.1}, {})
    several = [Conditions(**each) for each in changes]
    outcomes = [run_trial(variants.under(conditions), trial) for conditions in several]
    assert outcomes[0] == outcomes[-1] == expected
    assert all(outcome != expected for outcome in outcomes[1:-1])


def test_the_realism_is_that_of_the_conditions() -> None:
    """Whatever the environment had before; single factors are fields of it."""
    variants = AgentVariants(load_agent("momentum-qp", robot(), realism={"motors": {"lag": 0.01}}))
    for changes, late, heavier in (
        ({"delay": 0.02}, 0.02, 0.0), ({"mass_error": 0.1}, 0.0, 0.1),
        ({"friction": 0.4}, 0.0, 0.0),
        ({"delay": 0.02, "mass_error": 0.1}, 0.02, 0.1), ({}, 0.0, 0.0),
    ):  # fmt: skip
        env = variants.under(Conditions(**changes)).env
        assert env.realism.latency.sense == late and env.realism.body.scale == heavier
        assert env.realism.motors.lag == 0.0 and env.realism.ground.friction == changes.get(
            "friction"
        )
        assert isinstance(env.state_source, EstimatedState) == bool(changes)


def test_the_summary_has_what_readers_rely_on(finished: Path) -> None:
    """Keys, counts and order of docs/benchmark.md."""
    summary = json.loads((finished / "summary.json").read_text())
    assert {"format", "suite", "seed", "robot", "rated", "scale", "reference", "ranking",
            "controllers", "pairs", "step_limits", "seeds", "command", "versions", "machine",
            "workers", "backend", "commit", "seconds"} == set(summary)  # fmt: skip
    assert summary["ranking"] == list(BOTH) and summary["reference"] == "momentum-qp"
    entry = summary["controllers"]["momentum-qp"]
    assert {"trials", "evaluated", "errors", "root_force_max", "tick_us", "fingerprint", "j50_mean",
            "j50_mean_ci95", "eta_mean", "eta_mean_ci95", "eta_min", "directions", "factors",
            "eurobench"} <= set(entry)  # fmt: skip
    assert entry["evaluated"] == TRIALS and entry["errors"] == 0 and entry["tick_us"] == 12.5
    assert summary["rated"] == "mix" and entry["trials"] == 2
    assert [d["trials"] for d in entry["directions"]] == [4, 4]
    for d in entry["directions"]:
        assert d["eta"] == pytest.approx(d["j50"] / d["ankle_limit"])
        assert d["eta_ci95"] == pytest.approx([x / d["ankle_limit"] for x in d["j50_ci95"]])
    means = [d["eta"] for d in entry["directions"]]
    assert entry["eta_mean"] == pytest.approx(np.mean(means)) and entry["eta_min"] == min(means)
    assert [f["factor"] for f in entry["factors"]] == ["friction", "delay", "mass_error", "pushes"]
    for factor in entry["factors"]:
        (standard,) = (level for level in factor["levels"] if level["standard"])
        assert standard["level"] == factor["standard"] and standard["lost"] == 0
    (pair,) = summary["pairs"]
    assert pair["both"] + pair["only_a"] + pair["only_b"] + pair["neither"] == 2
    # both met all but the second stage, which is each one's own
    assert sum(pair["all"][k] for k in ("both", "only_a", "only_b", "neither")) >= TRIALS - 4


def test_the_table_of_trials_reads_back_exactly(finished: Path) -> None:
    """A row per controller and trial; cases and outcomes to the last bit when played again."""
    results = load_results(finished)
    own = [(record.trial, record.controller) for record in results.records]
    assert own == [(number, name) for number in range(TRIALS) for name in BOTH]
    records = [r for r in results.of("momentum-qp") if r.part in ("factors", "mix")]
    assert len(records) == 7
    for record in records:
        again = replay(results, record.trial, "momentum-qp")
        assert again.trial == results.trial(record) and not again.differences
        texts = {k: "" if v is None else str(v) for k, v in outcome_cells(again.outcome).items()}
        assert texts == {key: record.line[key] for key in texts}
    met = {results.trial(record).conditions for record in records}
    assert {Conditions(friction=0.4), Conditions(delay=0.02), Conditions(mass_error=0.1)} <= met
    last = replay(finished, TRIALS - 1, "zero")
    assert not last.differences and last.trial.number == TRIALS - 1


def test_reading_names_what_is_wrong(finished: Path, tmp_path: Path) -> None:
    """A missing summary, a cut table, other columns, a trial or controller that is not there."""
    copy = tmp_path / "copy"
    copy.mkdir()
    for path in finished.iterdir():
        (copy / path.name).write_bytes(path.read_bytes())
    table = copy / "trials.csv"
    text = table.read_text()
    table.write_text(text[: len(text) // 2])
    with pytest.raises(ConfigError, match=r"trials.csv: line \d+ has another number.*: run the"):
        load_results(copy)
    table.write_text(text[: text.rindex("\n", 0, len(text) // 2) + 1])
    with pytest.raises(ConfigError, match=r"trials.csv: has \d+ trials of .*has 17: cut off"):
        load_results(copy)
    table.write_text(text.replace("mass_error", "weight_error", 1))
    with pytest.raises(ConfigError, match="trials.csv: lacks the columns mass_error"):
        load_results(copy)
    table.unlink()
    with pytest.raises(ConfigError, match="trials.csv missing"):
        load_results(copy)
    table.write_text(text)
    (copy / "summary.json").write_text("{")
    with pytest.raises(ConfigError, match="summary.json: is not valid JSON"):
        load_results(copy)
    data = load_results(finished)
    with pytest.raises(ConfigError, match="numbered from 0 to 16"):
        data.record("zero", 99)
    with pytest.raises(ConfigError, match="'pd' took no part"):
        replay(data, 0, "pd")


def test_a_finished_benchmark_is_not_played_again(
    finished: Path, tmp_path: Path, in_process: type[InProcessExecutor]
) -> None:
    """A lost table is written anew; another controller adds its own trials only."""
    out = tmp_path / "out"
    out.mkdir()
    for path in finished.iterdir():
        (out / path.name).write_bytes(path.read_bytes())
    (out / "trials.csv").unlink()
    suite = finished.parent / "small.yaml"
    benchmark(BOTH, suite, out=out, seed=2)
    assert in_process.played == 0
    assert (out / "trials.csv").read_bytes() == (finished / "trials.csv").read_bytes()
    summary = benchmark(["pd"], suite, out=out, seed=2)
    assert in_process.played == TRIALS and list(summary["controllers"]) == [*BOTH, "pd"]
    before = json.loads((finished / "summary.json").read_text())["controllers"]
    assert {name: summary["controllers"][name] for name in BOTH} == before


def test_a_stopped_benchmark_ends_as_if_it_had_not_been(
    finished: Path, tmp_path: Path, in_process: type[InProcessExecutor]
) -> None:
    """Stopped in the first stage and in the second, cut off in a line: nothing else is repeated."""
    out, suite = tmp_path / "out", finished.parent / "small.yaml"
    for stop in (3, 20):
        in_process.stop_after = stop
        with pytest.raises(KeyboardInterrupt):
            benchmark(BOTH, suite, out=out, seed=2)
        assert {path.name for path in out.iterdir()} == {"settings.yaml", "trials.jsonl"}
    log = out / "trials.jsonl"
    log.write_bytes(log.read_bytes()[:-10])
    in_process.stop_after = None
    benchmark(BOTH, suite, out=out, seed=2)
    assert in_process.played == 2 * TRIALS + 1
    assert (out / "trials.csv").read_bytes() == (finished / "trials.csv").read_bytes()


@pytest.mark.usefixtures("few_frames")
def test_a_controller_that_raises_costs_its_trial_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The trial is recorded with seed and error, the others go on, the exit code is 1."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "flaky.py").write_text(FLAKY)
    suite = write_small(tmp_path)
    command = ["benchmark", "--suite", str(suite), "--out", "out", "--controllers"]
    assert main([*command, "flaky.py:Flaky", "zero"]) == 1
    lines = rows(tmp_path / "out")
    failed = [row for row in lines if row["error"]]
    line = FLAKY[: FLAKY.index("raise")].count("\n") + 1
    error = f"ArithmeticError: too fast (flaky.py:{line})"
    assert failed and all(row["error"] == error for row in failed)
    assert all(row["controller"] == "flaky.py:Flaky" and int(row["seed"]) > 0 for row in failed)
    assert len(failed) < TRIALS and len(lines) == 2 * TRIALS
    assert f"raised an error in {len(failed)} trials" in capsys.readouterr().err
    summary = json.loads((tmp_path / "out/summary.json").read_text())
    assert summary["controllers"]["flaky.py:Flaky"]["errors"] == len(failed)
    assert summary["reference"] == "flaky.py:Flaky"


def test_a_controller_that_cannot_be_loaded_is_no_trial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_process: type[InProcessExecutor]
) -> None:
    """Neither where it is played, nor one that the folder has from before: nothing is recorded."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "flaky.py").write_text(FLAKY)
    suite, out = write_small(tmp_path, mix=None, factors=None), tmp_path / "out"
    in_process.stop_after = 2
    with pytest.raises(KeyboardInterrupt):
        benchmark(["flaky.py:Flaky"], suite, out=out)
    before = (out / "trials.jsonl").read_bytes()
    job = Job(TrialStage("humanoid", 1.6, StartNoise()), "gone.py:Gone", Trial(0, 5))
    with poise.allowing("gone.py:Gone"):
        with pytest.raises(ConfigError, match="gone.py.*cannot be imported"):
            run_job(job)
    (tmp_path / "flaky.py").write_text(FLAKY + "# changed")
    with pytest.raises(ConfigError, match="holds trials of 'flaky.py:Flaky', which has changed"):
        benchmark(["zero"], suite, out=out, allow="flaky.py:Flaky")
    assert (out / "trials.jsonl").read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"controllers": ["zero", "zero"]}, ("controllers", "'zero'")),
        ({"controllers": ["pid"]}, ("controller", "'pid'")),
        ({"suite": "tiny"}, ("suite", "'tiny'", "quick")),
        ({"seed": -1}, ("seed", "0")),
        ({"workers": 0}, ("workers", "1")),
        ({"trials": 0}, ("trials", "1")),
        ({"backend": "dask"}, ("backend", "'dask'", "ray")),
    ],
)
def test_bad_input_is_refused_and_nothing_is_written(
    tmp_path: Path, arguments: dict[str, Any], message: tuple[str, ...]
) -> None:
    """One clear error, before the folder is made."""
    given = {"controllers": ["zero"], "suite": "quick", "out": tmp_path / "out", **arguments}
    with invalid(*message):
        benchmark(**given)
    assert not (tmp_path / "out").exists()


def test_everyone_takes_part_by_default() -> None:
    """The reference first, the packaged policies last."""
    names, policies = default_controllers(), packaged_policies("humanoid")
    walkers = {"residual-walk", "residual-walk-fast", "residual-walk-field"}
    assert walkers <= set(policies) and not {"walk", *walkers} & set(names)
    policies = [name for name in policies if name not in walkers]
    assert names[0] == "momentum-qp" and len(set(names)) == len(names)
    assert "residual" in policies and list(names[-len(policies) :]) == policies
    assert all(load_policy(name).config.robot == "humanoid" for name in policies)
    assert {"pd", "macchietto09", "moskalev24", "lip-mpc"} <= set(names)


@pytest.mark.parametrize(
    "backend", ["local", pytest.param("joblib", marks=pytest.mark.weekly), "ray"]
)
def test_every_backend_gives_the_same_trials(
    backend: str, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """trials.csv has the same bytes from two processes of any backend as from this one."""
    if backend == "ray":
        pytest.importorskip("ray")
    from poise.training.running.executor import Executor

    monkeypatch.setattr(run, "Executor", Executor)
    out = tmp_path / "out"
    threads = os.environ.get("OMP_NUM_THREADS")
    benchmark(BOTH, finished.parent / "small.yaml", out=out, seed=2, workers=2, backend=backend)
    assert (out / "trials.csv").read_bytes() == (finished / "trials.csv").read_bytes()
    assert os.environ.get("OMP_NUM_THREADS") == threads


def test_progress_and_ranking_are_printed(
    finished: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The table has a row for each controller."""
    from rich.console import Console

    from poise.training.benchmarking.evaluation.tables import print_summary

    show: Callable[..., None] = print_summary
    show(json.loads((finished / "summary.json").read_text()), Console(width=140))
    text = capsys.readouterr().out
    assert "momentum-qp" in text and "η mean" in text and "small.yaml" in text


def test_neighbours_of_a_ranking_are_compared_too() -> None:
    """Not only each with the reference, which all of the best may beat."""
    found = list(compared("qp", ["qp", "a", "b", "c"], ["b", "a", "qp", "c"]))
    assert found == [("qp", "a"), ("qp", "b"), ("qp", "c"), ("a", "b")]
