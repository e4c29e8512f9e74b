"""Exploration: noise that narrows on a schedule, lasts from step to step, and ends."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from poise.training.learning import exploration
from poise.training.learning.exploration import EpisodeGaussian
from poise.training.learning.policy import load_policy
from poise.training.learning.train import train
from tests.support.shared import tiny_config


def test_exploration_narrows_on_a_schedule(tmp_path, monkeypatch):
    """With log_std_final, the noise of each rollout lies on a line in time."""
    seen = []
    start = exploration.ExplorationCallback._on_rollout_start

    def spy(self):
        start(self)
        seen.append(self.model.policy.log_std.detach().numpy().copy())

    monkeypatch.setattr(exploration.ExplorationCallback, "_on_rollout_start", spy)
    ppo = replace(tiny_config().ppo, log_std_init=-1.0, log_std_final=-3.0)
    config = tiny_config(steps=128, ppo=ppo)
    train(replace(config, evaluation=replace(config.evaluation, trials=1)), tmp_path, False, False)
    np.testing.assert_allclose([values.mean() for values in seen], [-1.0, -2.0], atol=1e-6)
    assert all(np.ptp(values) == 0.0 for values in seen)


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
def test_noise_lasts_and_keeps_its_size(correlation):
    """ε has variance 1 at every step, ρ is between neighbours, ρ² between the next ones."""
    torch.manual_seed(0)
    envs, steps, std = 400, 60, 0.3
    gaussian = EpisodeGaussian(2, correlation)
    mean = torch.tensor([[1.0, -2.0]]).expand(envs, 2)
    gaussian.proba_distribution(mean, torch.full((2,), float(np.log(std))))
    actions = torch.stack([gaussian.sample() for _ in range(steps)])
    noise = ((actions - mean) / std).numpy()
    np.testing.assert_allclose(noise.mean(axis=(0, 1)), 0.0, atol=0.06)
    np.testing.assert_allclose(noise.var(axis=1).mean(axis=0), 1.0, atol=0.03)
    for lag in (1, 2):
        found = (noise[:-lag] * noise[lag:]).mean(axis=(0, 1))
        np.testing.assert_allclose(found, correlation**lag, atol=0.03)
    found = (noise[..., 0] * noise[..., 1]).mean()  # actions are not alike
    np.testing.assert_allclose(found, 0.0, atol=0.03)


def test_densities_stay_those_of_the_gaussian():
    """What PPO's ratio is made of does not know of the noise before."""
    gaussian, plain = EpisodeGaussian(2, 0.8), torch.distributions.Normal(0.5, 0.2)
    gaussian.proba_distribution(torch.full((3, 2), 0.5), torch.full((2,), float(np.log(0.2))))
    gaussian.sample()
    actions = gaussian.sample()
    np.testing.assert_allclose(
        gaussian.log_prob(actions).numpy(), plain.log_prob(actions).sum(dim=1).numpy(), rtol=1e-5
    )


@pytest.mark.parametrize("symmetric", [False, True])
def test_a_run_explores_with_lasting_noise(tmp_path, monkeypatch, symmetric):
    """The run's policy draws from it, with the same bits for the same seed."""
    drawn = []
    sample = EpisodeGaussian.sample

    def spy(self):
        drawn.append(self.correlation)
        return sample(self)

    monkeypatch.setattr(EpisodeGaussian, "sample", spy)
    ppo = replace(tiny_config().ppo, noise_correlation=0.7, symmetric=symmetric)
    config = tiny_config(steps=64, ppo=ppo)
    config = replace(config, evaluation=replace(config.evaluation, trials=1))
    for name in ("one", "two"):
        train(config, tmp_path / name, progress=False)
    assert drawn and set(drawn) == {0.7}
    one, two = (load_policy(tmp_path / name / "last").layers for name in ("one", "two"))
    for (w, b), (v, c) in zip(one, two, strict=True):
        np.testing.assert_array_equal(w, v)
        np.testing.assert_array_equal(b, c)


@pytest.mark.parametrize("symmetric", [False, True])
def test_noise_ends_in_each_episode(tmp_path, monkeypatch, symmetric):
    """Later actions are the mean, and do not move the actor; earlier ones have the noise."""
    taken = []
    end = exploration.ExplorationCallback._on_rollout_end

    def spy(self):
        end(self)
        buffer, policy = self.model.rollout_buffer, self.model.policy
        observations = torch.as_tensor(buffer.observations).flatten(0, 1)
        with torch.no_grad():
            mean = policy.get_distribution(observations).mode().numpy()
        noise = buffer.actions - mean.reshape(buffer.actions.shape)
        # an episode's steps are counted from where the buffer says that it begins
        steps = np.zeros(buffer.episode_starts.shape, dtype=int)
        for k in range(1, len(steps)):
            steps[k] = np.where(buffer.episode_starts[k] > 0, 0, steps[k - 1] + 1)
        taken.append((noise, steps, buffer.advantages.copy()))

    monkeypatch.setattr(exploration.ExplorationCallback, "_on_rollout_end", spy)
    config = tiny_config(steps=64)
    until = 5 * config.env.policy_period
    ppo = replace(config.ppo, noise_until=until, symmetric=symmetric)
    config = replace(config, ppo=ppo, evaluation=replace(config.evaluation, trials=1))
    train(config, tmp_path / "run", progress=False)
    noise, steps, advantages = taken[0]  # the first rollout begins with the episodes
    late = steps >= 5
    assert late.any() and not late.all()
    np.testing.assert_allclose(noise[late], 0.0, atol=1e-6)
    assert (np.abs(noise[~late]) > 1e-4).all()
    assert (advantages[late] == 0.0).all() and (advantages[~late] != 0.0).all()
