"""The environments in the libraries that people use them with, unchanged."""

import json
import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.env_checker import check_env as check_env_sb3

import poise  # noqa: F401  (registers the environments)
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.stepping import ResidualStepEnv
from poise.baselines.environments.velocity import VelocityEnv
from poise.baselines.environments.walking import ResidualWalkEnv
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.torque import TorqueBalanceEnv

IDS = {
    "poise/ResidualBalance-v0": ResidualBalanceEnv,
    "poise/ResidualStep-v0": ResidualStepEnv,
    "poise/ResidualWalk-v0": ResidualWalkEnv,
    "poise/ResidualWhole-v0": ResidualWholeEnv,
    "poise/TorqueBalance-v0": TorqueBalanceEnv,
    "poise/PositionBalance-v0": PositionBalanceEnv,
    "poise/Velocity-v0": VelocityEnv,
}
EACH = pytest.mark.parametrize("name", IDS)
#: one of them in every run, all in `make weekly`
ONE = pytest.mark.parametrize(
    "name", [name if k == 0 else pytest.param(name, marks=pytest.mark.weekly)
             for k, name in enumerate(IDS)])  # fmt: skip
PUSHES = {"magnitude": [0.1, 0.3], "unit": "specific_impulse", "start": [0.0, 0.1]}
SMALL = {"duration": 0.4, "pushes": PUSHES, "fall": {"quiet_time": 0.1}}


@EACH
def test_gymnasium_finds_nothing_to_say(name):
    """Gymnasium's checker passes without a warning; rendering has its own test."""
    env = gymnasium.make(name, **SMALL)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)


@EACH
def test_stable_baselines3_finds_nothing_to_say(name):
    """Stable-Baselines3's checker passes without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env_sb3(gymnasium.make(name, **SMALL), warn=True, skip_render_check=True)


@EACH
def test_make_gives_the_documented_class(name):
    """`unwrapped` is the class, and no wrapper ends episodes before the configuration does."""
    env = gymnasium.make(name)
    assert (
        type(env.unwrapped) is IDS[name] and env.spec.max_episode_steps == env.unwrapped.max_steps
    )
    assert env.observation_space == env.unwrapped.observation_space
    assert env.action_space.low.min() == -1.0 and env.action_space.high.max() == 1.0


def test_processes_without_poise_can_make_it():
    """With the module's name before the id, Gymnasium imports poise itself (spawned workers)."""
    code = "import gymnasium; print(gymnasium.make('poise:poise/TorqueBalance-v0').spec.id)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "poise/TorqueBalance-v0"


@pytest.mark.weekly
def test_processes_of_stable_baselines3():
    """Its spawned workers make the environment by the id with the module's name."""
    code = (
        "from stable_baselines3.common.env_util import make_vec_env\n"
        "from stable_baselines3.common.vec_env import SubprocVecEnv\n"
        "if __name__ == '__main__':\n"
        "    settings = {'start_method': 'spawn'}\n"
        "    env = make_vec_env('poise:poise/TorqueBalance-v0', 2, vec_env_cls=SubprocVecEnv,"
        " vec_env_kwargs=settings)\n"
        "    print(env.reset().shape)\n"
        "    env.close()\n"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert out.stdout.strip() == "(2, 85)", out.stderr


@EACH
def test_the_spec_can_be_written_and_read(name):
    """Arguments as plain mappings survive JSON; the environment made of it is the same."""
    env = gymnasium.make(name, **SMALL)
    text = env.spec.to_json()
    assert json.loads(text)["kwargs"]["duration"] == 0.4
    again = gymnasium.make(gymnasium.envs.registration.EnvSpec.from_json(text))
    assert again.unwrapped.config == env.unwrapped.config
    assert np.array_equal(again.reset(seed=3)[0], env.reset(seed=3)[0])


@ONE
@pytest.mark.parametrize("mode", ["sync", "async"])
def test_gymnasium_s_vectors_are_single_environments(name, mode):
    """Observations, rewards, ends and infos of Gymnasium's own vector environments."""
    compare_with_single_ones(name, mode)


@EACH
def test_vector_environments_are_single_ones(name):
    """The same of ours."""
    compare_with_single_ones(name, "vector_entry_point")


def compare_with_single_ones(name, mode):
    """Rows of make_vec equal single environments with the seeds of the rows."""
    vector = gymnasium.make_vec(name, num_envs=2, vectorization_mode=mode, **SMALL)
    try:
        singles = [gymnasium.make(name, **SMALL) for _ in range(2)]
        observations, _ = vector.reset(seed=[5, 6])
        for row, env, seed in zip(observations, singles, (5, 6), strict=True):
            assert np.array_equal(row, env.reset(seed=seed)[0])
        rng = np.random.default_rng(0)
        for _ in range(5):
            action = rng.uniform(-0.2, 0.2, vector.action_space.shape).astype(np.float32)
            observations, rewards, terminated, truncated, infos = vector.step(action)
            for i, env in enumerate(singles):
                observation, reward, *ends, info = env.step(action[i])
                assert np.array_equal(observations[i], observation) and rewards[i] == reward
                assert ends == [terminated[i], truncated[i]]
                assert infos["push"][i] == info["push"]
                assert infos["reward_terms"]["alive"][i] == info["reward_terms"]["alive"]
        for _ in range(20):  # through an end of time
            vector.step(np.zeros_like(action))
    finally:
        vector.close()


@EACH
def test_ppo_learns(name):
    """Stable-Baselines3's, on every environment."""
    learn(name, PPO)


@ONE
def test_sac_learns(name):
    """The same, off policy."""
    learn(name, SAC)


def learn(name, algorithm):
    """PPO and SAC run on the plain environment, and their weights change."""
    settings = (
        {"n_steps": 64, "batch_size": 32, "n_epochs": 1}
        if algorithm is PPO
        else {"learning_starts": 180, "batch_size": 16, "buffer_size": 500}
    )
    network = {"net_arch": [16]}
    env = gymnasium.make(name, **SMALL)
    model = algorithm("MlpPolicy", env, seed=0, device="cpu", policy_kwargs=network, **settings)
    before = [p.detach().clone() for p in model.policy.parameters()]
    model.learn(200)
    after = list(model.policy.parameters())
    assert any(not np.array_equal(a.detach(), b) for a, b in zip(after, before, strict=True))
    assert all(np.isfinite(a.detach().numpy()).all() for a in after)
    action, _ = model.predict(env.reset(seed=0)[0], deterministic=True)
    assert env.action_space.contains(action)


@EACH
def test_torchrl_collects(name):
    """TorchRL's GymEnv rolls the environment out."""
    pytest.importorskip("torchrl")
    from torchrl.envs import GymEnv
    from torchrl.envs.utils import check_env_specs

    env = GymEnv(name, **SMALL)
    check_env_specs(env)
    rollout = env.rollout(5)
    assert rollout["observation"].shape == (5, *env.observation_spec["observation"].shape)


@EACH
def test_observations_change(name):
    """No entry is constant over a few random episodes, but for feet that stay on the ground."""
    varied = {**SMALL, "pushes": {**PUSHES, "magnitude": [0.5, 1.0]}}
    if name in ("poise/ResidualWalk-v0", "poise/Velocity-v0"):
        ranges = {"ahead": [0.2, 0.6], "left": [-0.1, 0.1], "turn": [-0.2, 0.2]}
        varied |= {"command": ranges, "duration": 1.2}
    env = gymnasium.make(name, **varied)
    seen = []
    for seed in range(6):
        seen.append(env.reset(seed=seed)[0])
        env.action_space.seed(seed)
        done = False
        while not done:
            observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
            done = terminated or truncated
            seen.append(observation)
            assert env.observation_space.contains(observation)
    spread = np.ptp(np.array(seen), axis=0)
    terms = np.repeat([t.name for t in env.unwrapped.terms], [t.size for t in env.unwrapped.terms])
    constant = set(terms[spread == 0.0]) - {"contacts"}
    assert not constant


def test_importing_poise_is_light():
    """It registers the environments and loads neither MuJoCo nor Numba nor torch."""
    code = (
        "import sys, gymnasium, poise; "
        "assert {'poise/ResidualBalance-v0', 'poise/TorqueBalance-v0'} <= set(gymnasium.registry);"
        "print([m for m in ('mujoco', 'numba', 'torch') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"
