"""Every example runs as a user would start it."""

import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
ARGUMENTS = {
    "measured_mujoco.py": ["momentum-qp"],
    "optuna_search.py": ["1", "64"],
    "own_controller.py": [],
    "own_torques.py": [],
    "plain_mujoco.py": ["feedback-step"],
    "ppo_single_file.py": ["--steps", "128", "--envs", "2", "--rollout", "32", "--trials", "0"],
    "push_strip.py": ["strip.png"],
    "record_video.py": ["videos"],
    "rllib_ppo.py": ["1"],
    "sb3_train.py": ["100"],
    "torchrl_ppo.py": ["600"],
    "unitree_lowcmd.py": ["--seconds", "4"],
}


def run(name, folder):
    """Its output; fails with what it wrote to stderr."""
    command = [sys.executable, "-W", "error::DeprecationWarning:poise", str(EXAMPLES / name)]
    result = subprocess.run(
        [*command, *ARGUMENTS[name]], cwd=folder, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_every_example_is_tried():
    """A new example needs its arguments here."""
    assert sorted(path.name for path in EXAMPLES.glob("*.py")) == sorted(ARGUMENTS)


def test_a_controller_from_outside_stands(tmp_path):
    """It stands in all three places where it can act."""
    assert run("own_controller.py", tmp_path).count("stands") == 3


def test_a_controller_outside_of_environments_stands(tmp_path):
    """It steps in a loop of MuJoCo alone, and stands; the loop is short enough to copy."""
    assert run("plain_mujoco.py", tmp_path) == "feedback-step stands\n"
    assert len((EXAMPLES / "plain_mujoco.py").read_text().splitlines()) <= 40


def test_a_controller_stands_by_sensors_alone(tmp_path):
    """Nobody tells it where it is; it is pushed, and stands."""
    assert run("measured_mujoco.py", tmp_path).startswith("momentum-qp stands\n")


@pytest.mark.weekly  # tests/training/deploy/lowcmd stands a G1 so
def test_a_controller_stands_on_messages(tmp_path):
    """A pushed G1, which has no sensors of force, stands in `field`."""
    said = "momentum-qp-g1 by torques stands after 4 s in field\n"
    assert run("unitree_lowcmd.py", tmp_path) == said


def test_torques_from_the_dynamics_stand(tmp_path):
    """Also when it is pushed."""
    assert run("own_torques.py", tmp_path).count("stands") == 2


@pytest.mark.parametrize("name", ["humanoid", "compact"])
def test_the_torques_of_the_example_obey_the_dynamics(name, monkeypatch):
    """M v̇ + h = Sᵀτ + Jᵀw holds in every row with the wrench that it leaves, and soles rest."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import numpy as np
    import own_torques as example

    from poise.baselines import Targets
    from tests.support.shared import generic_state, robot

    simulation, real = generic_state(name), robot(name)
    state = simulation.state
    names = ("standing_qpos", "motor_dofs", "model")
    strong = np.full_like(real.torque_limit, 1e9)  # nothing is clipped
    body = SimpleNamespace(torque_limit=strong, **{each: getattr(real, each) for each in names})
    controller, targets = example.InverseDynamics(body), Targets.standing(real, state)
    vdot, tau = controller.acceleration(state, targets), controller.torques(state, targets)
    left = state.M @ vdot + state.h
    left[np.array(real.motor_dofs)] -= tau
    assert len(tau) == len(left) - 6  # every joint has a motor: all rows must hold
    w = np.linalg.lstsq(state.J.T, left, rcond=None)[0]
    assert np.abs(state.J.T @ w - left).max() < 1e-8 * np.abs(left).max()
    sole = -state.Jdot_v - example.SOLE_DAMPING * state.J_v
    np.testing.assert_allclose(state.J @ vdot, sole, atol=1e-8 * np.abs(sole).max() + 1e-8)


@pytest.mark.weekly
def test_ppo_in_a_single_file(tmp_path):
    """The loop collects and updates, and reports as it goes."""
    lines = run("ppo_single_file.py", tmp_path).splitlines()
    assert [int(re.sub(r"\D", "", line.split("steps")[0])) for line in lines] == [64, 128]


@pytest.mark.weekly
def test_stable_baselines3(tmp_path):
    """It learns where there is something to gain and saves, the normalisation as well."""
    assert "fps" in run("sb3_train.py", tmp_path)
    assert (tmp_path / "sb3_step.zip").is_file()
    assert (tmp_path / "sb3_step_normalize.pkl").is_file()


def test_torchrl(tmp_path):
    """It collects and updates, in whole batches."""
    pytest.importorskip("torchrl", reason="make weekly has it")
    lines = run("torchrl_ppo.py", tmp_path).splitlines()
    assert [line.split(",")[0] for line in lines] == ["512 steps", "1024 steps"]


def test_rllib(tmp_path):
    """An iteration of its own loop."""
    pytest.importorskip("ray.rllib", reason="make weekly has it")
    assert "iteration 1, mean return" in run("rllib_ppo.py", tmp_path)


def test_zoo(tmp_path):
    """RL Baselines3 Zoo reads the hyperparameters, learns and saves."""
    pytest.importorskip("rl_zoo3", reason="make weekly has it")
    settings = ["--conf-file", str(EXAMPLES / "rl_zoo3_ppo.yml"), "--gym-packages", "poise"]
    command = [sys.executable, "-m", "rl_zoo3.train", "--algo", "ppo", "-n", "1024"]
    where = ["--env", "poise/ResidualBalance-v0", "--log-folder", "logs", "--eval-freq", "-1"]
    result = subprocess.run(
        [*command, *where, *settings], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    assert list(tmp_path.glob("logs/ppo/**/*.zip"))


def test_optuna(tmp_path):
    """A trial of a few steps."""
    pytest.importorskip("optuna", reason="make weekly has it")
    assert "learning_rate" in run("optuna_search.py", tmp_path)


def test_dataset(tmp_path, monkeypatch):
    """Two trials that Minari reads back, with their pushes."""
    minari = pytest.importorskip("minari", reason="make weekly has it")
    from poise.training.cli import main

    monkeypatch.chdir(tmp_path)
    assert main(["dataset", "zero", "--trials", "2", "--out", "data"]) == 0
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "data"))
    data = minari.load_dataset("poise/pushes-v0")
    assert data.total_episodes == 2
    first = data[0]
    assert len(first.observations) == len(first.actions) + 1 == len(first.rewards) + 1
    assert first.infos["push"]["impulse"].shape == (len(first.observations), 1)


def test_video(tmp_path, can_render):
    """Gymnasium's own wrapper films two episodes."""
    pytest.importorskip("moviepy", reason="make weekly has it")
    assert run("record_video.py", tmp_path).count("frames") == 2


@pytest.mark.weekly
def test_the_picture_of_the_readme(tmp_path, can_render):
    """Frames of a push are drawn into one picture."""
    run("push_strip.py", tmp_path)
    assert (tmp_path / "strip.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("mode", ["vector_entry_point", "sync", "async"])
def test_the_single_file_masks_the_steps_that_only_reset(mode, monkeypatch):
    """Advantages stop at an episode's end; the step after it is no experience."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import gymnasium
    import numpy as np
    import ppo_single_file as example
    import torch

    import poise  # noqa: F401

    env = gymnasium.make_vec(
        "poise/ResidualBalance-v0", num_envs=2, vectorization_mode=mode,
        duration=0.06, pushes=None,
    )  # fmt: skip
    observation, _ = env.reset(seed=0)
    rollout = example.Rollout(9, env)
    agent = example.Agent(observation.shape[1], rollout.actions.shape[-1], -2.0)
    fresh = np.zeros(2, dtype=bool)
    example.collect(env, agent, rollout, observation, fresh)
    env.close()
    assert rollout.valid[:, 0].tolist() == 2 * [True, True, True, False] + [True]
    assert rollout.done[:, 0].tolist() == 2 * [0.0, 0.0, 1.0, 0.0] + [0.0]
    assert not rollout.terminated.any() and not rollout.rewards[3].any()
    values = torch.rand(10, 2)
    gains = rollout.advantages(values, gamma=0.9, lam=0.8)
    last = rollout.rewards[2] + 0.9 * values[3] - values[2]  # bootstrapped: time ran out
    torch.testing.assert_close(gains[2], last)
    before = rollout.rewards[1] + 0.9 * values[2] - values[1]
    torch.testing.assert_close(gains[1], before + 0.72 * last)
