"""A critic that sees the truth: what the actor sees, learns from, and is deployed with."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from poise.envs.balance.config import ObservationConfig
from poise.training.learning.checkpoints import restore
from poise.training.learning.policy import load_policy
from poise.training.learning.train import _training_envs, make_model, train
from tests.support.shared import robot, tiny_config

PRIVILEGED = ("com_vel", "friction", "push")  # seven numbers


def with_truth(**changed):
    observation = ObservationConfig(privileged=PRIVILEGED, **changed)
    config = tiny_config()
    return replace(config, env=replace(config.env, observation=observation))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The folder of a run whose critic sees more than its actor."""
    out = tmp_path_factory.mktemp("privileged") / "run"
    train(with_truth(), out, progress=False)
    return out


def stretched(model):
    """Weights with which actions and values depend on what is seen."""
    generator = torch.Generator().manual_seed(3)
    with torch.no_grad():
        for weight in (model.policy.action_net.weight, model.policy.value_net.weight):
            weight.copy_(torch.randn(weight.shape, generator=generator))


def test_the_actor_is_blind_to_the_truth_and_the_critic_is_not(run):
    """Also after the training, whose steps leave the actor's weights of it at zero."""
    normalize = _training_envs(with_truth())
    model = make_model(with_truth(), normalize)
    restore(run / "last", model, normalize, robot().fingerprint)
    stretched(model)
    seen = normalize.get_attr("seen")[0]
    given = torch.randn(20, seen + 7)
    other = given.clone()
    other[:, seen:] = torch.randn(20, 7)
    with torch.no_grad():
        actions, values, _ = model.policy(given, deterministic=True)
        same, others, _ = model.policy(other, deterministic=True)
    assert torch.equal(actions, same) and actions.std(dim=0).min() > 1e-3
    assert (values - others).abs().min() > 1e-6
    weights = model.policy.state_dict()["mlp_extractor.policy_net.0.weight"]
    assert not weights[:, seen:].any() and weights[:, :seen].any()


def test_a_policy_is_played_without_the_truth(run):
    """Its environment has none of it; its action is SB3's in the training's environment."""
    policy = load_policy(run)
    env = policy.make_env()
    normalize = _training_envs(with_truth())
    model = make_model(with_truth(), normalize)
    restore(run / "best", model, normalize, robot().fingerprint)
    seen = normalize.get_attr("seen")[0]
    assert env.observation_space.shape == (seen,) == policy.mean.shape
    raw = np.random.default_rng(1).uniform(-3.0, 3.0, (50, seen + 7)).astype(np.float32)
    actions = model.predict(normalize.normalize_obs(raw), deterministic=True)[0]
    np.testing.assert_allclose(policy.act(raw[:, :seen]), actions, atol=1e-5)
    assert np.abs(actions).max() > 0.0


def test_a_run_begins_with_a_policy_of_one_step_and_no_truth(run, tmp_path):
    """Of a history it sees the newest step as before: the first evaluation is that policy's."""
    start = tmp_path / "start"
    train(tiny_config(), start, progress=False)
    config = replace(with_truth(history=3), start_from=str(start))
    normalize = _training_envs(config)
    model = make_model(config, normalize)
    seen = normalize.get_attr("seen")[0]
    restore(start / "best", model, normalize, robot().fingerprint, seen)
    old = load_policy(start)
    frame = len(old.mean)
    assert seen == 3 * frame
    raw = np.random.default_rng(2).uniform(-3.0, 3.0, (50, seen + 7)).astype(np.float32)
    actions = model.predict(normalize.normalize_obs(raw), deterministic=True)[0]
    np.testing.assert_allclose(old.act(raw[:, 2 * frame : seen]), actions, atol=1e-5)
    moments = normalize.obs_rms
    for k in range(3):
        np.testing.assert_array_equal(moments.mean[k * frame : (k + 1) * frame], old.mean)
    assert not moments.mean[seen:].any() and (moments.var[seen:] == 1.0).all()
