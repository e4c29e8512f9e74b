"""What changes on a schedule in a training run: pushes, errors of the robot, and exploration."""

from dataclasses import replace

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from poise.configs.errors import ConfigError
from poise.envs.sensing.realism import Realism, load_realism

from .config import TrainConfig


def curriculum_levels(config: TrainConfig) -> list[Realism]:
    """Return the levels of `curriculum.levels`; raises ConfigError for one that there is not."""
    try:
        return [load_realism(name) for name in config.curriculum.levels]
    except ConfigError as error:
        if error.field != "realism" or error.source:  # a file's own mistake says where it is
            raise
        raise ConfigError(error.message, field="curriculum.levels",
                          choices=error.choices) from None  # fmt: skip


class ScheduleCallback(BaseCallback):
    """Scales what grows or narrows as the run goes on: pushes, errors of the robot, exploration.

    The deterministic policy is what counts in the end: with little noise left (`log_std_final` of
    PPO), what is learned is what is judged.
    """

    model: PPO

    def __init__(self, config: TrainConfig):
        super().__init__()
        self.config = config
        self.levels = curriculum_levels(config)

    def _on_rollout_start(self) -> None:
        curriculum, env, ppo = self.config.curriculum, self.config.env, self.config.ppo
        growing = curriculum.share * self.config.steps
        done = min(self.num_timesteps / growing, 1.0) if growing else 1.0
        if env.pushes is not None and growing:
            factor = curriculum.start + (1.0 - curriculum.start) * done
            low, high = env.pushes.magnitude
            scaled = replace(env.pushes, magnitude=(min(low, factor * high), factor * high))
            self.training_env.set_attr("push_sampler", scaled)
            self.logger.record("curriculum/largest", scaled.magnitude[1])
        if curriculum.realism < 1.0 or curriculum.mixed or curriculum.levels:
            factor = curriculum.realism + (1.0 - curriculum.realism) * done
            for i, level in enumerate(self._levels(factor)):
                self.training_env.set_attr("realism", level, indices=i)
            self.logger.record("curriculum/realism", factor)
        if ppo.log_std_final is not None:
            done = min(self.num_timesteps / self.config.steps, 1.0)
            log_std = ppo.log_std_init + done * (ppo.log_std_final - ppo.log_std_init)
            with torch.no_grad():
                self.model.policy.log_std.fill_(log_std)

    def _levels(self, factor: float) -> list[Realism]:
        """Return the level of each environment, `factor` of the way from `ideal`."""
        curriculum, n = self.config.curriculum, self.training_env.num_envs
        spread = [(i + 0.5) / n if curriculum.mixed else 1.0 for i in range(n)]
        levels = self.levels or [self.config.env.realism]
        return [levels[i % len(levels)].scaled(factor * spread[i]) for i in range(n)]

    def _on_step(self) -> bool:
        return True
