"""The residual on other controllers than the baseline, from training to the benchmark."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.configs.files import packaged
from poise.training.benchmarking.evaluation import run
from poise.training.benchmarking.evaluation import run as evaluation
from poise.training.benchmarking.evaluation.evaluate import benchmark, evaluate
from poise.training.benchmarking.results.replay import replay
from poise.training.learning.config import train_config
from poise.training.learning.policy import load_policy
from poise.training.learning.train import train
from tests.support.benchmarks_small import InProcessExecutor, write_small
from tests.support.evaluations import InProcess, random_suite, write_suite
from tests.support.shared import tiny_config
from tests.support.weekly import daily


@pytest.mark.parametrize("controller", daily(["capture-point", "lip-mpc"]))
def test_a_residual_on_a_rival_end_to_end(
    controller: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Trained, it learns; evaluated, replayed and a row of the benchmark like any other."""
    monkeypatch.setattr(evaluation, "Executor", InProcess)
    monkeypatch.setattr(run, "Executor", InProcessExecutor)
    InProcess.stop_after = InProcessExecutor.stop_after = None
    train(tiny_config(controller=controller, steps=64), tmp_path / "run", progress=False)
    last = str(tmp_path / "run/last")
    policy = load_policy(last)
    assert policy.config.controller == controller and np.abs(policy.layers[-1][0]).max() > 0.0
    suite = write_suite(tmp_path, random_suite(1))
    summary = evaluate([controller, last], suite, out=tmp_path / "out", seed=1)
    assert not summary["pairs"][0]["identical"]  # the action moves what the controller follows
    assert replay(tmp_path / "out", 0, last).differences == {}
    small = write_small(tmp_path, mix=None, factors=None, margin=None)
    entry = benchmark([last], small, out=tmp_path / "benchmark", trials=1)["controllers"][last]
    assert entry["errors"] == 0 and entry["tick_us"] > 0.0


ON_RIVALS = [n for n in packaged("training") if train_config(n).action == "residual"]
OURS = ("momentum-qp", "momentum-qp-compensated")
ON_RIVALS = [name for name in ON_RIVALS if train_config(name).controller not in OURS]


@pytest.mark.parametrize("name", ON_RIVALS)
def test_packaged_configurations_are_named_by_their_controller(name: str) -> None:
    """residual-CONTROLLER trains on it, and moves what it follows: every action changes torques."""
    config = train_config(name)
    assert name == f"residual-{config.controller}"
    env = config.make_env()
    pushed = {"push": {"impulse": 8.0, "start": 0.0, "duration": 0.1}}
    ends = []
    for action in (np.zeros(len(env.action_names)), *np.eye(len(env.action_names))):
        env.reset(seed=0, options=pushed)
        for _ in range(15):
            env.step(action)
        ends.append(env.simulation.state.qvel.copy())
    assert not isinstance(env.controller, MomentumQP)
    for name, end in zip(env.action_names, ends[1:], strict=True):
        assert np.abs(end - ends[0]).max() > 1e-6, name
