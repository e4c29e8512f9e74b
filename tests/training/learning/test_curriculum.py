"""What changes on a schedule: exploration. The rest is in test_train.py."""

from dataclasses import replace

import numpy as np

from poise.training.learning.curriculum import ScheduleCallback
from poise.training.learning.train import train
from tests.support.shared import tiny_config


def test_exploration_narrows_on_a_schedule(tmp_path, monkeypatch):
    """With log_std_final, the noise of each rollout lies on a line in time."""
    seen = []
    start = ScheduleCallback._on_rollout_start

    def spy(self):
        start(self)
        seen.append(self.model.policy.log_std.detach().numpy().copy())

    monkeypatch.setattr(ScheduleCallback, "_on_rollout_start", spy)
    ppo = replace(tiny_config().ppo, log_std_init=-1.0, log_std_final=-3.0)
    config = tiny_config(steps=128, ppo=ppo)
    train(replace(config, evaluation=replace(config.evaluation, trials=1)), tmp_path, False, False)
    np.testing.assert_allclose([values.mean() for values in seen], [-1.0, -2.0], atol=1e-6)
    assert all(np.ptp(values) == 0.0 for values in seen)
