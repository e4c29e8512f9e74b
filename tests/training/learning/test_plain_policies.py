"""policy.zip by SB3 alone: nothing of Poise is in it, and what comes out is the same policy."""

import base64
import json
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from stable_baselines3 import PPO

from poise.configs.files import packaged_folder
from poise.training.learning.policy import load_policy
from poise.training.learning.policy_files import POLICY, STATISTICS
from poise.training.learning.train import train
from tests.support.shared import finished_run, policies_here, robot, robot_of, tiny_config
from tests.support.weekly import daily

SHIPPED = policies_here()


@pytest.fixture(scope="module")
def symmetric(tmp_path_factory):
    """The last checkpoint of a symmetric run."""
    out = tmp_path_factory.mktemp("symmetric") / "run"
    train(tiny_config(ppo=replace(tiny_config().ppo, symmetric=True)), out, progress=False)
    return out / "last"


def folder_of(name: str, request: pytest.FixtureRequest) -> Path:
    if name == "symmetric":
        return request.getfixturevalue("symmetric")
    return finished_run() / "last" if name == "run" else packaged_folder("policies") / name


def contents(path: Path) -> list[bytes]:
    """Every member of the archive, and every pickle that its settings hold."""
    archive = zipfile.ZipFile(path)
    members = [archive.read(name) for name in archive.namelist()]
    settings = json.loads(archive.read("data")).values()
    pickles = [entry[":serialized:"] for entry in settings if ":serialized:" in str(entry)]
    assert len(pickles) > 3
    return [*members, *(base64.b64decode(text) for text in pickles)]


@pytest.mark.parametrize("name", [*SHIPPED, "run", "symmetric"])
def test_nothing_of_poise_is_pickled(name: str, request: pytest.FixtureRequest) -> None:
    path = folder_of(name, request) / POLICY
    assert not [content for content in contents(path) if b"poise" in content.lower()]


@pytest.mark.parametrize("name", daily(["run", "symmetric", *SHIPPED], 7))
def test_sb3_loads_the_same_policy(name: str, request: pytest.FixtureRequest) -> None:
    """`PPO.load`, with the statistics beside it, acts as `load_policy` does; a symmetric policy is
    the mean of what the loaded one says of an observation and of its mirror image. Whatever stands
    in privileged entries, which come last, changes nothing."""
    folder = folder_of(name, request)
    body = robot(robot_of(name))
    policy, model = load_policy(folder, body), PPO.load(folder / POLICY, device="cpu")
    assert model.learning_rate == policy.config.ppo.learning_rate
    data = np.load(folder / STATISTICS)

    def mean(raw: np.ndarray) -> np.ndarray:
        scaled = (raw - data["obs_mean"]) / np.sqrt(data["obs_var"] + data["epsilon"])
        seen = np.clip(scaled, -data["clip_obs"], data["clip_obs"]).astype(np.float32)
        tensor, _ = model.policy.obs_to_tensor(seen)
        return model.policy.get_distribution(tensor).mode().detach().numpy()

    rng = np.random.default_rng(0)
    raw = rng.normal(data["obs_mean"], np.sqrt(data["obs_var"]), (50, len(data["obs_mean"])))
    expected = mean(raw)
    env = policy.make_env(robot=body)
    shown = env.observation_space.shape[0]
    assert shown < raw.shape[1] or not policy.config.env.observation.privileged
    if policy.config.ppo.symmetric:
        see, do = env.mirrors()
        mirrored = np.hstack([see(raw[:, :shown]), rng.normal(size=raw[:, shown:].shape)])
        expected = 0.5 * (expected + do(mean(mirrored)))
    np.testing.assert_allclose(policy.act(raw[:, :shown]), np.clip(expected, -1.0, 1.0), atol=1e-4)


@pytest.mark.weekly
def test_sb3_loads_them_where_there_is_no_poise() -> None:
    """In a process that cannot import Poise."""
    path = packaged_folder("policies") / "residual-step" / POLICY
    code = (
        "import sys; sys.modules['poise'] = None\n"
        "from stable_baselines3 import PPO\n"
        f"model = PPO.load({str(path)!r}, device='cpu')\n"
        "print(model.lr_schedule(1.0), *model.action_space.shape)"
    )
    command = [sys.executable, "-c", code]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert result.stdout.split() == ["0.0003", "13"]
