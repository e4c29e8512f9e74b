"""A policy on joint positions: trained in longer physics steps, played in the robot's own."""

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.configs.schema import build
from poise.envs.balance.position import PositionBalanceEnv
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.learning import train as training
from poise.training.learning.config import TrainConfig, train_config
from poise.training.learning.policy import load_policy
from poise.training.learning.policy_files import STATE
from poise.training.learning.train import _training_envs, train
from tests.support.shared import robot, tiny_config

SERVOS = {"deflection": 0.4, "reach": {"*": 0.5}}


def config(**changes: object) -> TrainConfig:
    """A run that takes seconds, with servos of its own."""
    packaged = train_config("position")
    tiny = tiny_config(action="position", physics_step=0.005, servos=packaged.servos, **changes)
    tiny = replace(tiny, ppo=replace(tiny.ppo, symmetric=True, target_kl=0.05))
    return replace(tiny, servos=build(type(packaged.servos), SERVOS, "test"))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run and its continuation."""
    out = tmp_path_factory.mktemp("position") / "run"
    train(config(), out, progress=False)
    train(config(steps=320), out, resume=True, progress=False)
    return out


def test_training_takes_longer_physics_steps() -> None:
    """The environments of training alone: held-out pushes are met in the robot's own."""
    env = _training_envs(config()).get_attr("simulation")[0]
    assert env.arrays.timestep == 0.005
    assert config().make_env().arrays.timestep == robot().model.opt.timestep == 0.002
    plain = _training_envs(replace(config(), physics_step=None)).get_attr("simulation")[0]
    assert plain.arrays.timestep == 0.002


def test_a_run_is_for_the_robot_as_it_is_described(run: Path) -> None:
    """Its fingerprint is the robot's, whatever the training's physics step; it goes on."""
    state = json.loads((run / "last" / STATE).read_text())
    assert state["fingerprint"] == robot().fingerprint
    assert state["timesteps"] == 320 and state["controller_fingerprint"] == ""
    with open(run / "evaluations.csv") as file:
        assert [int(row["timesteps"]) for row in csv.DictReader(file)] == [0, 128, 192, 320]


def test_it_plays_with_its_servos(run: Path) -> None:
    """In the evaluation: the servos of its configuration, the robot's own physics step."""
    agent = load_agent(str(run), robot())
    env = agent.env
    assert isinstance(env, PositionBalanceEnv) and env.substeps == 10
    assert np.all(env.servos.reach == 0.5)
    observation, _ = env.reset(seed=0)
    action = agent.act(observation)
    assert action.shape == env.action_space.shape and np.abs(action).max() > 0.0
    policy = load_policy(run)
    seen, done = env.mirrors()
    np.testing.assert_allclose(policy.act(seen(observation)), done(action), atol=1e-12)


def test_other_servos_are_another_agent(run: Path, tmp_path: Path) -> None:
    """Their numbers decide how it plays; the physics step of training does not."""
    known = load_agent(str(run / "last"), robot()).fingerprint
    for old, new, same in (
        ("deflection: 0.4", "deflection: 0.5", False),
        ("physics_step: 0.005", "physics_step: 0.004", True),
    ):
        folder = Path(shutil.copytree(run / "last", tmp_path / str(same)))
        text = (folder / "config.yaml").read_text()
        assert old in text
        (folder / "config.yaml").write_text(text.replace(old, new))
        assert (load_agent(str(folder), robot()).fingerprint == known) is same


def test_a_physics_step_that_does_not_fit_is_one_line(tmp_path: Path) -> None:
    """A policy step of 20 ms holds a whole number of them."""
    with pytest.raises(ConfigError, match=r"policy_period: 0.02 s is not a whole number of steps"):
        train(replace(config(), physics_step=0.003), tmp_path / "run", progress=False)


def test_nothing_of_controllers_is_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their kernels are made ready only where a controller acts."""
    asked = []
    monkeypatch.setattr(training, "prepare", lambda: asked.append(True))
    train(config(steps=64), tmp_path / "run", progress=False)
    assert not asked
