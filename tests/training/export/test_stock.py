"""What SB3 alone makes of an exported policy."""

from __future__ import annotations

import json
import zipfile
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from poise.configs.errors import PoiseError
from poise.configs.files import packaged_folder
from poise.envs.vector.batch import replicate
from poise.training.export import stock
from poise.training.export.check import observations
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
    assert policy(SYMMETRIC).mirrors is not None
    see, do = policy(SYMMETRIC).mirrors
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
