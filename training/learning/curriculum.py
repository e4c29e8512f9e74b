"""The curriculum of a training run: pushes that grow."""

from dataclasses import replace

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
