"""Symmetric policies: the mirror image of an observation gives the mirror image of the action."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from poise.training.learning.checkpoints import restore
from poise.training.learning.config import PPOConfig
from poise.training.learning.policy import load_policy
from poise.training.learning.train import _training_envs, make_model, train
from tests.support.shared import robot, tiny_config


@pytest.fixture(scope="module")
def config():
    return tiny_config(ppo=replace(tiny_config().ppo, symmetric=True))


@pytest.fixture(scope="module")
def run(config, tmp_path_factory):
    """The folder of a symmetric training run."""
    out = tmp_path_factory.mktemp("symmetric") / "run"
    train(config, out, progress=False)
    return out


def test_the_mirror_image_of_an_action(run):
    """π(M_o o) = M_a π(o), bit for bit, and not because it does nothing."""
    policy = load_policy(run)
    policy.layers[-1] = tuple(50.0 * array for array in policy.layers[-1])
    seen, done = policy.make_env().mirrors()
    observations = np.random.default_rng(0).uniform(-3.0, 3.0, (50, len(seen.order)))
    actions = policy.act(observations)
    np.testing.assert_array_equal(policy.act(seen(observations)), done(actions))
    assert abs(actions - done(actions)).max() > 0.1


def test_numpy_and_sb3_agree(config, run):
    """The mean action in NumPy is that of SB3's model, whose values are symmetric too."""
    normalize = _training_envs(config)
    model = make_model(config, normalize)
    restore(run / "last", model, normalize, robot().fingerprint)
    seen, _ = normalize.get_attr("mirrors")[0]()
    raw = np.random.default_rng(1).uniform(-3.0, 3.0, (50, len(seen.order))).astype(np.float32)
    actions = model.predict(normalize.normalize_obs(raw), deterministic=True)[0]
    np.testing.assert_allclose(load_policy(run / "last").act(raw), actions, atol=1e-5)
    with torch.no_grad():
        values, images = (
            model.policy.predict_values(torch.as_tensor(normalize.normalize_obs(given)).float())
            for given in (raw, seen(raw))
        )
    assert values.shape == (50, 1) and values.std() > 1e-3
    np.testing.assert_allclose(values, images, atol=1e-5)
    normalize.close()


def test_statistics_are_symmetric(config):
    """Observations and their mirror images have the same mean and variance, but for the sign."""
    normalize = _training_envs(config)
    seen, _ = normalize.get_attr("mirrors")[0]()
    shape = (40, len(seen.order))
    normalize.obs_rms.update(np.random.default_rng(2).normal(1.0, 2.0, shape))
    mean, var = normalize.obs_rms.mean, normalize.obs_rms.var
    np.testing.assert_allclose(seen(mean), mean, atol=1e-12)
    np.testing.assert_allclose(var[seen.order], var, rtol=1e-12)
    assert abs(mean).max() > 0.5
    normalize.close()


def test_a_symmetric_run_resumes(config, run):
    """It goes on from its weights and statistics, which stay symmetric."""
    longer = replace(config, steps=config.steps + 64)
    before = load_policy(run / "last")
    with np.load(run / "last" / "vecnormalize.npz") as data:
        count = float(data["obs_count"])
    train(longer, run, resume=True, progress=False)
    after = load_policy(run / "last")
    assert after.state["timesteps"] == longer.steps
    assert 0.0 < abs(after.layers[0][0] - before.layers[0][0]).max() < 0.01
    seen, _ = after.make_env().mirrors()
    with np.load(run / "last" / "vecnormalize.npz") as data:
        assert data["obs_count"] > count + 2 * 64  # each with its mirror image
        np.testing.assert_allclose(seen(data["obs_mean"]), data["obs_mean"], atol=1e-9)


def test_not_with_state_dependent_noise():
    """gSDE explores along features, which here are of both sides."""
    with pytest.raises(ValueError, match="symmetric: not with use_sde"):
        PPOConfig(symmetric=True, use_sde=True)
