"""training/benchmarking/trials/agents.py."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.configs import files as file_names
from poise.configs.errors import ConfigError
from poise.configs.files import packaged
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.robots.robot import Robot, load_robot
from poise.training.benchmarking.evaluation import evaluate
from poise.training.benchmarking.evaluation.evaluate import default_controllers
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.learning import policy
from poise.training.learning.policy import load_policy
from tests.support.shared import finished_run, policies_here


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


def test_the_baseline_is_the_residual_environment_with_action_zero(robot: Robot) -> None:
    """momentum-qp never moves its targets, whatever it observes."""
    agent = load_agent("momentum-qp", robot, duration=2.0, pushes=None)
    assert isinstance(agent.env, ResidualBalanceEnv)
    assert agent.env.config.duration == 2.0 and agent.env.config.pushes is None
    assert np.array_equal(agent.act(np.ones(agent.env.observation_space.shape)), np.zeros(4))


def test_zero_gives_no_torque(robot: Robot) -> None:
    """zero acts on the joints themselves, by nothing."""
    agent = load_agent("zero", robot)
    assert isinstance(agent.env, TorqueBalanceEnv)
    agent.env.reset(seed=0)
    agent.env.step(agent.act(np.zeros(agent.env.observation_space.shape)))
    assert not agent.env.simulation.views.ctrl.any()


def test_a_controllers_file_is_played_and_told_apart(robot: Robot, tmp_path: Path) -> None:
    """A .yaml of a controller is an agent of its own; other gains give another fingerprint."""
    same, other = tmp_path / "same.yaml", tmp_path / "other.yaml"
    default = load_agent("momentum-qp", robot)
    same.write_text("kind: momentum-qp\n")
    other.write_text("kind: momentum-qp\ncom: {stiffness: 3.21}\n")
    env = load_agent(str(other), robot).env
    assert isinstance(env, ResidualBalanceEnv) and env.controller.config.com.stiffness == 3.21
    assert load_agent(str(other), robot).fingerprint != default.fingerprint
    assert load_agent(str(same), robot).name == str(same)


@pytest.mark.parametrize("name", ["momentum", "missing.yaml", "nowhere/run"])
def test_an_unknown_controller_is_refused_with_the_choices(robot: Robot, name: str) -> None:
    """The text names what was asked for and what there is."""
    with pytest.raises(
        ConfigError,
        match="momentum-qp, .*residual-walk, residual-walk-fast, residual-walk-field, "
        "residual-whole-g1, residual-whole-g1-field, velocity-g1, velocity-t1, guard-falcon-g1, "
        "guard-g1, zero",
    ) as error:
        load_agent(name, robot)
    assert name in str(error.value)


def test_a_period_that_does_not_fit_names_its_file(robot: Robot, tmp_path: Path) -> None:
    path = tmp_path / "odd.yaml"
    path.write_text("base: momentum-qp\nperiod: 0.0033\n")
    with pytest.raises(ConfigError, match="is not a whole number of steps") as caught:
        load_agent(str(path), robot)
    assert (caught.value.source, caught.value.field) == (str(path), "period")


def test_a_folder_without_a_policy_is_refused(robot: Robot, tmp_path: Path) -> None:
    """An existing folder is taken for a policy; its missing file is named."""
    with pytest.raises(ConfigError, match="a policy folder holds"):
        load_agent(str(tmp_path), robot)


def test_a_packaged_policy_is_known_by_its_folder(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Any folder of configs/policies, as an agent and by load_policy; an error lists them all."""
    shutil.copytree(file_names.packaged_folder("policies"), tmp_path / "policies")
    shutil.copytree(finished_run() / "last", tmp_path / "policies/residual-pd")
    real = file_names.packaged_folder

    def here(kind: str) -> Path:
        return tmp_path / kind if kind == "policies" else real(kind)

    for module in (file_names, policy, evaluate):
        monkeypatch.setattr(module, "packaged_folder", here)
    agent = load_agent("residual-pd", robot)
    assert agent.fingerprint == load_agent(str(finished_run() / "last"), robot).fingerprint
    assert agent.fingerprint != load_agent("residual", robot).fingerprint
    assert load_policy("residual-pd").state == load_policy(finished_run() / "last").state
    names = ["ppo-position", "ppo-torque", "residual", "residual-lqr-lip", "residual-pd"]
    names += ["residual-step", "residual-torque", "residual-torque-field"]
    others = ["residual-walk", "residual-walk-fast", "residual-walk-field"]
    others += [*(f"residual-whole-g1{where}" for where in ("", "-field")), "velocity-g1"]
    of_t1 = ["velocity-t1"]
    assert packaged("policies") == [*names, *others, *of_t1]
    assert default_controllers()[-8:] == tuple(names)
    assert default_controllers("unitree_g1")[-3:] == tuple(others[3:])
    guards = packaged("guards")
    with pytest.raises(ConfigError, match=", ".join([*names, *others, *of_t1, *guards, "zero"])):
        load_agent("residual-abe07", robot)


def test_a_fingerprint_tells_how_a_policy_plays(robot: Robot, tmp_path: Path) -> None:
    """Other statistics or another environment change it, another number of epochs does not."""
    last = finished_run() / "last"
    agent = load_agent(str(last), robot)
    for name, old, new, same in (
        ("statistics", "", "", False),
        ("epochs", "n_epochs: 2", "n_epochs: 3", True),
        ("smoothing", "smoothing: 0.0", "smoothing: 0.1", False),
    ):
        folder = Path(shutil.copytree(last, tmp_path / name))
        written = (folder / "config.yaml").read_text()
        assert old in written
        (folder / "config.yaml").write_text(written.replace(old, new))
        if name == "statistics":
            with np.load(folder / "vecnormalize.npz") as data:
                arrays = {**data, "obs_mean": data["obs_mean"] + 0.1}
            np.savez(folder / "vecnormalize.npz", **arrays)
        assert (load_agent(str(folder), robot).fingerprint == agent.fingerprint) is same


@pytest.mark.parametrize("name", policies_here())
def test_packaged_policies_are_named_by_their_controller(name: str) -> None:
    """residual on the baseline, which may lean, residual-CONTROLLER on another; no larger than need
    be."""
    found = load_policy(name).config
    if found.action != "residual":
        steps = "residual-torque" if found.step_residual.torque > 0.0 else "residual-step"
        others = {"torque": "ppo-torque", "step": steps, "whole": "residual-whole-g1"}
        others |= {"walk": f"residual-{found.controller}", "position": "ppo-position"}
        others |= {"velocity": f"velocity-{found.robot[-2:]}"}
        level = "" if found.env.realism.ideal else f"-{found.env.realism.name}"
        assert name == f"{others[found.action]}{level}"
    else:
        on_baseline = found.controller in ("momentum-qp", "momentum-qp-compensated")
        assert name == ("residual" if on_baseline else f"residual-{found.controller}")
    files = list((file_names.packaged_folder("policies") / name).iterdir())
    seen = len(load_policy(name).mean)  # the first layer is as wide
    assert sum(path.stat().st_size for path in files) < 1_140_000 + 3_000 * seen
