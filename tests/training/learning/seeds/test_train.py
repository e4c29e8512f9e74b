"""training/learning/seeds/train.py, training/learning/seeds/progress.py and the flags of `poise
train`.
"""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from poise.configs.errors import ConfigError, PoiseError
from poise.configs.schema import read_yaml, to_yaml
from poise.training.benchmarking.evaluation.evaluate import evaluate
from poise.training.cli.train import run_train as train_command
from poise.training.learning.config import PPOConfig
from poise.training.learning.policy_files import find_checkpoint
from poise.training.learning.seeds import train as module
from poise.training.learning.seeds.train import SeedRun, train_seeds
from poise.training.learning.train import train
from tests.support.benchmarks_small import InProcessExecutor
from tests.support.evaluations import random_suite, write_suite
from tests.support.shared import finished_run, tiny_config
from tests.training.learning.test_train import ROOT, weights

SHORT = 64  # steps: one rollout


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> type[InProcessExecutor]:
    """Runs are trained in this process."""
    monkeypatch.setattr(module, "Executor", InProcessExecutor)
    InProcessExecutor.played, InProcessExecutor.stop_after = 0, None
    return InProcessExecutor


def same(a: Path, b: Path) -> bool:
    """Whether two runs ended with the same weights, to the last bit."""
    pairs = zip(weights(a), weights(b), strict=True)
    return all(np.array_equal(x, y) for x, y in pairs)


def test_runs_are_those_of_single_seeds(tmp_path: Path) -> None:
    """From another process: the bits of `train` with each seed alone, and what seeds.json says."""
    text = io.StringIO()
    config = tiny_config(threads=2)
    train_seeds(config, [0, 3], tmp_path / "out", workers=1, console=Console(file=text, width=140))
    train(tiny_config(seed=3), tmp_path / "three", progress=False)
    assert same(tmp_path / "out/seed-0", finished_run())
    assert same(tmp_path / "out/seed-3", tmp_path / "three")
    assert not same(finished_run(), tmp_path / "three")
    found = json.loads((tmp_path / "out/seeds.json").read_text())
    assert [run["folder"] for run in found["runs"]] == ["seed-0", "seed-3"]
    for run in found["runs"]:
        state = json.loads((tmp_path / "out" / run["folder"] / "last/state.json").read_text())
        assert run["finished"] and run["timesteps"] == 192
        assert run["start"] == state["evaluations"][0]
        assert run["best"]["recovered"] == max(row["recovered"] for row in state["evaluations"][1:])
    values = [run["best"]["recovered"] for run in found["runs"]]
    assert found["recovered"]["values"] == values
    assert found["recovered"]["iqm"] == pytest.approx(np.mean(values))
    assert found["recovered"]["worst"] == min(values)
    shown = text.getvalue()
    assert "IQM over 2 seeds" in shown and "seed 3: recovered" in shown
    assert "192/192" in shown


def test_stopped_runs_go_on_and_finished_ones_are_left(
    tmp_path: Path, in_process: type[InProcessExecutor]
) -> None:
    """After Ctrl-C between two seeds; a further seed joins; nothing that is done is done again."""
    config, out = tiny_config(steps=SHORT), tmp_path / "out"
    in_process.stop_after = 1
    with pytest.raises(KeyboardInterrupt):
        train_seeds(config, [0, 1], out)
    entries = json.loads((out / "seeds.json").read_text())["runs"]
    assert [entry["finished"] for entry in entries] == [False, False]  # as they were at the start
    in_process.played, in_process.stop_after = 0, None
    summary = train_seeds(config, [2], out, resume=True)
    assert in_process.played == 2
    assert [run["seed"] for run in summary["runs"]] == [0, 1, 2]
    before = {path: path.stat().st_mtime_ns for path in out.glob("seed-*/last/*")}
    assert len(before) == 12
    train_seeds(config, [], out, resume=True)
    assert in_process.played == 2
    assert {path: path.stat().st_mtime_ns for path in out.glob("seed-*/last/*")} == before


def test_a_failed_seed_costs_no_other(
    tmp_path: Path, in_process: type[InProcessExecutor], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is named at the end with what it raised; --resume trains it alone."""
    real = module.train

    def failing(config: Any, *rest: Any, **named: Any) -> Path:
        if config.seed == 1:
            raise ValueError("not\nfinite")
        return real(config, *rest, **named)

    config, out = tiny_config(steps=SHORT), tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr(module, "train", failing)
        with pytest.raises(PoiseError, match="seed 1: ValueError: not finite; .*--resume"):
            train_seeds(config, [0, 1], out)
    assert in_process.played == 2 and (out / "seed-0/last").is_dir()
    train_seeds(config, [], out, resume=True)
    assert in_process.played == 3


def test_a_run_that_is_not_seen_is_no_success(
    tmp_path: Path, in_process: type[InProcessExecutor], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A machine of a cluster may have written to its own disk."""
    monkeypatch.setattr(module, "train", lambda *rest, **named: None)
    with pytest.raises(PoiseError, match="seed-0 is not finished here: do all machines see it"):
        train_seeds(tiny_config(), [0], tmp_path)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"seeds": [1, 1]}, "seeds: 1 is given twice"),
        ({"seeds": [-1]}, "seeds: must be at least 0, not -1"),
        ({"workers": 0}, "workers: must be at least 1, not 0"),
        ({"backend": "dask"}, "no such backend: 'dask'"),
        ({"resume": True}, "resume: holds no runs to resume"),
    ],
)
def test_bad_input_is_refused_and_nothing_is_written(
    tmp_path: Path, arguments: dict[str, Any], message: str
) -> None:
    """One clear error, before the folder is made."""
    given = {"seeds": [0, 1], **arguments}
    with pytest.raises(ConfigError, match=message):
        train_seeds(tiny_config(), out=tmp_path / "out", **given)
    assert not (tmp_path / "out").exists()


def test_runs_are_not_written_over(tmp_path: Path, in_process: type[InProcessExecutor]) -> None:
    """Neither runs of seeds, nor a single run, nor those of another configuration."""
    config, out = tiny_config(steps=SHORT), tmp_path / "out"
    train_seeds(config, [0], out)
    with pytest.raises(ConfigError, match="already holds training runs"):
        train_seeds(config, [1], out)
    other = tiny_config(steps=SHORT, ppo=PPOConfig(n_envs=2))
    with pytest.raises(ConfigError, match="started with another configuration .ppo"):
        train_seeds(other, [], out, resume=True)
    with pytest.raises(ConfigError, match="holds the run of a single seed"):
        train_seeds(config, [1], out / "seed-0")
    with pytest.raises(ConfigError, match="already holds training runs"):
        train_command(["--out", str(out)])
    assert {path.name for path in out.iterdir()} == {"seed-0", "config.yaml", "seeds.json"}


def test_the_command_takes_seeds(
    tmp_path: Path,
    in_process: type[InProcessExecutor],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Flags change the configuration of all; --resume alone knows configuration and seeds."""
    (tmp_path / "tiny.yaml").write_text(to_yaml(tiny_config(steps=SHORT)))
    out = tmp_path / "out"
    given: list[SeedRun] = []
    real = module.train_run
    monkeypatch.setattr(module, "train_run", lambda run: given.append(run) or real(run))
    flags = ["--ppo.gamma", "0.9", "--seeds", "4", "5", "--workers", "2", "--backend", "joblib"]
    train_command(["--config", str(tmp_path / "tiny.yaml"), "--out", str(out), *flags])
    assert sorted(run.config.seed for run in given) == [4, 5]
    assert {run.config.ppo.gamma for run in given} == {0.9}
    assert {run.config.threads for run in given} == {1}
    assert read_yaml(out / "seed-4/config.yaml")["seed"] == 4
    shown = capsys.readouterr().out.splitlines()
    assert shown[-3:-1] == [
        str(out / "seeds.json"),
        f"next: poise evaluate momentum-qp {out} --out out/out",
    ]
    assert re.fullmatch(rf"      poise view {out}/seed-[45]", shown[-1])
    train_command(["--out", str(out), "--resume"])
    assert len(given) == 2
    train_command(["--out", str(out), "--resume", "--steps", str(2 * SHORT)])
    assert len(given) == 4


def heed_interrupts() -> None:
    """A shell that starts its tests in the background has them, and their children, ignore it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.weekly
def test_ctrl_c_ends_all_processes_at_once_and_loses_nothing(tmp_path: Path) -> None:
    """The command ends with 130 in seconds, though its runs have hours to go; --resume goes on."""
    config = tmp_path / "tiny.yaml"
    config.write_text(to_yaml(tiny_config(steps=10**7)))
    out = tmp_path / "out"
    command = [sys.executable, "-m", "poise.training.cli", "train", "--config", str(config),
               "--out", str(out), "--seeds", "0", "1", "--workers", "2"]  # fmt: skip
    process = subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        start_new_session=True, preexec_fn=heed_interrupts,
    )  # fmt: skip
    deadline = time.monotonic() + 300.0
    folders = [out / f"seed-{seed}" / "last" for seed in (0, 1)]
    while not all(find_checkpoint(folder) for folder in folders):
        assert process.poll() is None, process.stdout.read()
        assert time.monotonic() < deadline
        time.sleep(0.1)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    shown, _ = process.communicate(timeout=60)
    assert process.returncode == 130 and "go on with --resume" in shown
    assert "Traceback" not in shown
    with pytest.raises(ProcessLookupError):  # nobody of the session is left
        for _ in range(100):
            os.killpg(process.pid, 0)
            time.sleep(0.1)
    assert all(find_checkpoint(folder) for folder in folders)


def test_an_evaluation_of_a_folder_of_seeds(
    tmp_path: Path, in_process: type[InProcessExecutor], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its runs play, and their IQM and the worst seed are in the summary and on the terminal."""
    from poise.training.benchmarking.evaluation import run as evaluation
    from tests.support.evaluations import InProcess

    monkeypatch.setattr(evaluation, "Executor", InProcess)
    InProcess.played, InProcess.stop_after = 0, None
    runs, text = tmp_path / "runs", io.StringIO()
    train_seeds(tiny_config(steps=SHORT), [0, 1], runs)
    summary = evaluate(
        ["momentum-qp", str(runs)], write_suite(tmp_path, random_suite(2)),
        out=tmp_path / "out", console=Console(file=text, width=140),
    )  # fmt: skip
    members = [str(runs / "seed-0"), str(runs / "seed-1")]
    assert list(summary["controllers"]) == ["momentum-qp", *members]
    (group,) = summary["seeds"]
    assert group["members"] == members and group["name"] == str(runs)
    rates = [summary["controllers"][name]["recovered_rate"] for name in members]
    assert group["recovered"]["values"] == rates and group["recovered"]["worst"] == min(rates)
    assert "IQM over 2 training seeds" in text.getvalue()
    written = json.loads((tmp_path / "out/summary.json").read_text())
    assert written["seeds"][0]["recovered"]["iqm"] == pytest.approx(np.mean(rates))
