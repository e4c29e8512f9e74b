"""What SB3 alone makes of an exported policy."""

from __future__ import annotations

import json
import zipfile
from base64 import b64decode
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from poise.configs.errors import PoiseError
from poise.configs.files import packaged_folder
from poise.envs.balance.vector.batch import replicate
from poise.envs.robots.mirror import Mirror
from poise.training.deploy.export import stock
from poise.training.deploy.export.check import observations
from poise.training.learning.vec_env import ThreadedVecEnv
from tests.support.exported import SYMMETRIC, exported, policy

ARCHIVE = "ppo-poise-ResidualStep-v0.zip"


def test_sb3_loads_what_acts_as_the_policy() -> None:
    """By `PPO.load` and `VecNormalize.load`, with 32 bits; both sides of a symmetric policy."""
    folder = exported()
    venv = ThreadedVecEnv(replicate(policy(SYMMETRIC).make_env(), 2))
    normalize = VecNormalize.load(str(folder / "vec_normalize.pkl"), venv)
    model = PPO.load(folder / ARCHIVE, device="cpu")
    assert not normalize.training and not normalize.norm_reward
    seen = observations(policy(SYMMETRIC), 500)
    actions, _ = model.predict(normalize.normalize_obs(seen), deterministic=True)
    np.testing.assert_allclose(actions, policy(SYMMETRIC).act(seen), atol=1e-4)
    mirrors = policy(SYMMETRIC).mirrors
    assert mirrors is not None
    see, do = mirrors
    other, _ = model.predict(normalize.normalize_obs(see(seen)), deterministic=True)
    np.testing.assert_allclose(do(other), actions, atol=1e-4)
    tensor, _ = model.policy.obs_to_tensor(normalize.normalize_obs(seen))
    image, _ = model.policy.obs_to_tensor(normalize.normalize_obs(see(seen)))
    values = [model.policy.predict_values(each).detach().numpy() for each in (tensor, image)]
    np.testing.assert_allclose(*values, rtol=1e-4, atol=1e-4)
    stored = PPO.load(packaged_folder("policies") / SYMMETRIC / "policy.zip", device="cpu")
    sides = [stored.policy.predict_values(each).detach().numpy() for each in (tensor, image)]
    np.testing.assert_allclose(values[0], 0.5 * (sides[0] + sides[1]), rtol=1e-4, atol=1e-4)
    assert model.num_timesteps == policy(SYMMETRIC).state["timesteps"]
    again = PPO.load(folder / ARCHIVE, env=normalize, device="cpu")
    again.learn(2 * again.n_steps)  # it can go on learning
    assert again.num_timesteps == 2 * again.n_steps
    venv.close()


def test_what_sb3_unpickles_names_nothing_of_poise() -> None:
    folder = exported()
    archive = zipfile.ZipFile(folder / ARCHIVE)
    settings = json.loads(archive.read("data"))
    pickles = [b64decode(e[":serialized:"]) for e in settings.values() if ":serialized:" in str(e)]
    assert len(pickles) > 3
    content = [(folder / "vec_normalize.pkl").read_bytes(), *pickles]
    content += [archive.read(name) for name in archive.namelist()]
    assert not [each for each in content if b"poise" in each.lower()]
    config = json.loads((folder / "config.json").read_text())
    assert config.keys() == settings.keys() | {"system_info"}


def test_another_number_in_sb3_s_file_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = stock.both_sides

    def wrong(weights, see, do):
        return right(weights, replace(see, sign=-see.sign), do)

    monkeypatch.setattr(stock, "both_sides", wrong)
    with pytest.raises(PoiseError, match=r"ppo-poise-ResidualStep-v0.zip: its actions differ by"):
        stock.write_stock(
            tmp_path, ARCHIVE, policy(SYMMETRIC),
            policy(SYMMETRIC).make_env(), packaged_folder("policies") / SYMMETRIC,
        )  # fmt: skip


def test_both_sides_of_a_network_are_its_mean_and_that_of_its_mirror_image() -> None:
    """Of two hidden layers, a critic of another width, and spreads that differ."""
    rng = np.random.default_rng(0)
    see = Mirror(np.array([1, 0, 2, 3]), np.array([1.0, 1.0, -1.0, 1.0]))
    do = Mirror(np.array([1, 0, 2]), np.array([-1.0, -1.0, 1.0]))
    sizes = {"policy": (4, 5, 6), "value": (4, 7, 3)}
    shapes = {
        f"mlp_extractor.{side}_net.{2 * i}.{kind}": shape
        for side, widths in sizes.items()
        for i, (n, m) in enumerate(pairwise(widths))
        for kind, shape in (("weight", (m, n)), ("bias", (m,)))
    }
    shapes |= {"action_net.weight": (3, 6), "action_net.bias": (3,), "log_std": (3,)}
    shapes |= {"value_net.weight": (1, 3), "value_net.bias": (1,)}
    weights = {name: rng.normal(size=shape) for name, shape in shapes.items()}

    def network(of: dict[str, np.ndarray], side: str, o: np.ndarray) -> np.ndarray:
        for i in (0, 2):
            name = f"mlp_extractor.{side}_net.{i}"
            o = np.tanh(o @ of[f"{name}.weight"].T + of[f"{name}.bias"])
        name = "action_net" if side == "policy" else "value_net"
        return o @ of[f"{name}.weight"].T + of[f"{name}.bias"]

    wide, seen = stock.both_sides(weights, see, do), rng.normal(size=(20, 4))
    mean = 0.5 * (network(weights, "policy", seen) + do(network(weights, "policy", see(seen))))
    np.testing.assert_allclose(network(wide, "policy", seen), mean, atol=1e-12)
    value = 0.5 * (network(weights, "value", seen) + network(weights, "value", see(seen)))
    np.testing.assert_allclose(network(wide, "value", seen), value, atol=1e-12)
    spread = weights["log_std"]
    expected = [0.5 * (spread[0] + spread[1])] * 2 + [spread[2]]
    np.testing.assert_allclose(wide["log_std"], expected)
