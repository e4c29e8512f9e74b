"""The curriculum of a training run: pushes, and errors of the robot, that grow."""

from dataclasses import replace

from stable_baselines3.common.callbacks import BaseCallback

from .config import TrainConfig


class CurriculumCallback(BaseCallback):
    """Scales the training environments' largest push and level of realism as the run goes on."""

    def __init__(self, config: TrainConfig):
        super().__init__()
        self.config = config

    def _on_rollout_start(self) -> None:
        curriculum, env = self.config.curriculum, self.config.env
        growing = curriculum.share * self.config.steps
        done = min(self.num_timesteps / growing, 1.0) if growing else 1.0
        if env.pushes is not None and growing:
            factor = curriculum.start + (1.0 - curriculum.start) * done
            low, high = env.pushes.magnitude
            scaled = replace(env.pushes, magnitude=(min(low, factor * high), factor * high))
            self.training_env.set_attr("push_sampler", scaled)
            self.logger.record("curriculum/largest", scaled.magnitude[1])
        if curriculum.realism < 1.0 or curriculum.mixed:
            factor = curriculum.realism + (1.0 - curriculum.realism) * done
            n = self.training_env.num_envs if curriculum.mixed else 1
            for i in range(n):
                level = env.realism.scaled(factor * (i + 0.5) / n if curriculum.mixed else factor)
                envs = i if curriculum.mixed else None  # None: all
                self.training_env.set_attr("realism", level, indices=envs)
            self.logger.record("curriculum/realism", factor)

    def _on_step(self) -> bool:
        return True
