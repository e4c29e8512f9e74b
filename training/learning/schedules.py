"""Schedules of a training run: the size of the pushes, and the exploration."""

from dataclasses import replace

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from .config import TrainConfig


class CurriculumCallback(BaseCallback):
    """Scales the largest push of the training environments as the run goes on."""

    def __init__(self, config: TrainConfig):
        super().__init__()
        self.config = config

    def _on_rollout_start(self) -> None:
        curriculum, pushes = self.config.curriculum, self.config.env.pushes
        if pushes is None or curriculum.share == 0.0:
            return
        done = min(self.num_timesteps / (curriculum.share * self.config.steps), 1.0)
        factor = curriculum.start + (1.0 - curriculum.start) * done
        low, high = pushes.magnitude
        scaled = replace(pushes, magnitude=(min(low, factor * high), factor * high))
        self.training_env.set_attr("push_sampler", scaled)
        self.logger.record("curriculum/largest", scaled.magnitude[1])

    def _on_step(self) -> bool:
        return True


class ExplorationCallback(BaseCallback):
    """Narrows the exploration on a schedule, where the configuration says so.

    The deterministic policy is what counts in the end: with little noise left, what is learned
    is what is judged.
    """

    model: PPO

    def __init__(self, config: TrainConfig):
        super().__init__()
        self.config = config

    def _on_rollout_start(self) -> None:
        ppo = self.config.ppo
        if ppo.log_std_final is None:
            return
        done = min(self.num_timesteps / self.config.steps, 1.0)
        log_std = ppo.log_std_init + done * (ppo.log_std_final - ppo.log_std_init)
        with torch.no_grad():
            self.model.policy.log_std.fill_(log_std)

    def _on_step(self) -> bool:
        return True
