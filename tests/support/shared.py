"""What several test files use: loaded robots, and one small training run."""

import functools
import importlib.util
import tempfile
from pathlib import Path

import numpy as np

from poise.configs.files import packaged
from poise.envs.balance.base import EnvConfig
from poise.envs.balance.mdp.termination import FallLimits
from poise.envs.physics.pushes.sampler import PushSampler
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.menagerie import WHEEL
from poise.envs.robots.robot import Robot, load_robot


@functools.cache
def robot(name: str = "humanoid") -> Robot:
    """A packaged robot, loaded once."""
    return load_robot(name)


def policies_here() -> list[str]:
    """The packaged policies, but those whose robot's model is not installed."""
    here = importlib.util.find_spec(WHEEL) is not None
    return [name for name in packaged("policies") if here or robot_of(name) == "humanoid"]


def robot_of(policy: str) -> str:
    """The robot of a packaged policy, by its name; humanoid for what is none."""
    public = {"g1": "unitree_g1", "t1": "booster_t1"}
    return next((public[part] for part in policy.split("-") if part in public), "humanoid")


def generic_state(name: str = "humanoid", seed: int = 0) -> Simulation:
    """A robot that stands in another place, faces another way, and has just been pushed hard."""
    simulation, rng = Simulation(robot(name)), np.random.default_rng(seed)
    qpos = robot(name).standing_qpos.copy()
    qvel = rng.normal(0.0, 0.1, robot(name).model.nv)
    turn, q = np.array([np.cos(0.35), 0.0, 0.0, np.sin(0.35)]), qpos[3:7].copy()
    qpos[3:7] = turn[0] * q + turn[3] * np.array([-q[3], -q[2], q[1], q[0]])  # 0.7 rad of yaw
    qpos[:2] = [0.4, -0.3]
    simulation.reset(qpos, qvel)
    limit = robot(name).torque_limit
    for _ in range(10):
        simulation.step(0.3 * limit * rng.uniform(-1.0, 1.0, len(limit)))
    return simulation


def tiny_config(**changes):
    """A training configuration that takes seconds."""
    from poise.training.learning.config import EvaluationConfig, PPOConfig, TrainConfig

    pushes = PushSampler(
        magnitude=(0.1, 0.6), unit="specific_impulse", start=(0.05, 0.1), bodies=("torso",)
    )
    settings = {
        "steps": 192,
        "threads": 1,
        "env": EnvConfig(duration=0.5, pushes=pushes, fall=FallLimits(quiet_time=0.1)),
        "ppo": PPOConfig(n_envs=4, n_steps=16, batch_size=32, n_epochs=2, net_arch=(16, 16)),
        "evaluation": EvaluationConfig(every=128, trials=5),
    }
    return TrainConfig(**{**settings, **changes})


@functools.cache
def finished_run() -> Path:
    """The folder of a small training run; do not write into it."""
    from poise.training.learning.train import train

    _folders.append(tempfile.TemporaryDirectory(prefix="poise-run-"))
    out = Path(_folders[-1].name) / "run"
    train(tiny_config(), out, progress=False)
    return out


_folders: list[tempfile.TemporaryDirectory] = []  # removed at the end of the process
