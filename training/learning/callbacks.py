"""Callbacks beside the learning: evaluation, checkpoints, progress."""

import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecNormalize

from poise.configs.files import write_atomic
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.mdp.reward import REWARD_TERMS
from poise.envs.balance.vector.batch import EnvBatch
from poise.envs.robots.robot import Robot
from poise.training.running.files import csv_text
from poise.training.running.terminal import ProgressLines, steps_bar

from .checkpoints import save_checkpoint
from .config import TrainConfig
from .policy_files import BEST, KEPT, LAST, controller_fingerprint
from .vec_env import ThreadedVecEnv


class RolloutLog(BaseCallback):
    """Logs of each rollout: steps per second, the update's fraction of the time, and the means of
    the reward's weighted terms over its policy steps."""

    model: PPO

    def __init__(self) -> None:
        super().__init__()
        self._rollout_start = self._rollout_end = time.perf_counter()
        self._sum, self._steps = np.zeros(len(REWARD_TERMS)), 0

    def _on_rollout_start(self) -> None:
        now = time.perf_counter()
        rollout, update = self._rollout_end - self._rollout_start, now - self._rollout_end
        if rollout > 0.0:
            steps = self.model.n_steps * self.training_env.num_envs
            self.logger.record("time/steps_per_second", steps / (rollout + update))
            self.logger.record("time/update_share", update / (rollout + update))
        self._rollout_start = now

    def _on_step(self) -> bool:
        envs = self.training_env.unwrapped
        assert isinstance(envs, ThreadedVecEnv)
        self._sum += envs.reward_terms.mean(axis=0)
        self._steps += 1
        return True

    def _on_rollout_end(self) -> None:
        self._rollout_end = time.perf_counter()
        means = self._sum / max(self._steps, 1)
        for name, mean in zip(REWARD_TERMS, means, strict=True):
            if mean != 0.0:
                self.logger.record(f"reward/{name}", float(mean))
        self._sum, self._steps = np.zeros_like(means), 0


class Checkpoints(BaseCallback):
    """Write last/ after every rollout, and best/ after the best evaluation of a trained policy.

    With `keep_every` of the configuration a policy is also kept in kept/STEPS, at the start and
    every `keep_every` steps. All are in the folder `out` of the run. `say` is called
    with what an evaluation is doing, a few words.
    """

    model: PPO

    def __init__(
        self,
        config: TrainConfig,
        robot: Robot,
        out: Path,
        state: dict[str, Any],
        say: Callable[[str], object] = lambda _: None,
    ):
        super().__init__()
        self._say = say
        self.config, self.robot = config, robot  # as it is described, whatever it is trained on
        self.out = out
        self.rows: list[dict[str, float]] = list(state.get("evaluations", []))
        self._next = state.get("next_evaluation", 0)
        scores = [row["score"] for row in self.rows if row["timesteps"] > 0]
        self._record = max(scores, default=-np.inf)
        self._batch: EnvBatch | None = None

    def _on_training_start(self) -> None:
        evaluation = self.config.evaluation
        pushes = evaluation.pushes or self.config.env.pushes
        count = min(evaluation.trials, 32)
        first = self.config.make_training_env(self.robot, pushes=pushes)
        self._batch = EnvBatch(self.config.replicate(first, count), self.config.threads)
        if self.num_timesteps == 0:
            self._evaluate()  # the controller alone: what the policy must beat

    def _on_rollout_start(self) -> None:
        # the update of the rollout before is done: its weights are new
        self._save(LAST)  # first, so that a kill in the evaluation loses nothing
        self._keep()
        if self.num_timesteps >= self._next:
            self._evaluate()
            self._save(LAST)

    def _on_training_end(self) -> None:
        self._evaluate()
        self._save(LAST)
        self._keep()
        self.close()

    def _on_step(self) -> bool:
        return True

    def _keep(self) -> None:
        every, rollout = self.config.keep_every, self.model.n_steps * self.model.n_envs
        now = self.num_timesteps
        if every and now // every > (now - rollout) // every:
            self._save(f"{KEPT}/{now:010d}")

    def _evaluate(self) -> None:
        if self.rows and self.rows[-1]["timesteps"] == self.num_timesteps:
            return
        row = {"timesteps": self.num_timesteps, **self._play()}
        self.rows.append(row)
        self._next = self.num_timesteps + self.config.evaluation.every
        for name, value in row.items():
            self.logger.record(f"evaluation/{name}", value)
        self.logger.dump(self.num_timesteps)
        write_atomic(self.out / "evaluations.csv", csv_text(self.rows, list(row)))
        if row["score"] > self._record:
            if self.num_timesteps > 0:  # anything trained replaces the controller alone
                self._record = row["score"]
            self._save(BEST)

    def _play(self) -> dict[str, float]:
        """Return the deterministic policy on the held-out pushes, the same at every evaluation."""
        evaluation, batch = self.config.evaluation, self._batch
        assert batch is not None  # made at the start of the training
        normalize = self._normalize()
        ends: list[tuple[bool, bool]] = []  # whether recovered, whether fallen
        actions: list[float] = []
        seeds = np.random.SeedSequence(evaluation.seed).generate_state(evaluation.trials)
        size = len(batch.envs)
        for start in range(0, evaluation.trials, size):
            chunk = [int(s) for s in seeds[start : start + size]]
            chunk += [int(seeds[0])] * (size - len(chunk))  # filled up, not counted
            counted = min(size, evaluation.trials - start)
            self._say(f"evaluating: {start}/{evaluation.trials} pushes")
            batch.reset(chunk)
            result: dict[int, tuple[bool, bool]] = {}

            def at_end(
                i: int, env: BalanceEnv, result: dict[int, tuple[bool, bool]] = result
            ) -> None:
                result.setdefault(i, (env.recovered and not env.fallen, env.fallen))

            while len(result) < size:
                action, _ = self.model.predict(
                    normalize.normalize_obs(batch.observations), deterministic=True
                )
                running = [i for i in range(counted) if i not in result]
                actions.extend(np.abs(action[running]).mean(axis=1))
                batch.step(action, at_end)
            ends.extend(result[i] for i in range(counted))
        self._say("")
        rate, fallen = (float(share) for share in np.mean(ends, axis=0))
        return {
            "recovered": rate,
            "fallen": fallen,
            "mean_abs_action": float(np.mean(actions)),
            "score": rate,
        }

    def _normalize(self) -> VecNormalize:
        env = self.model.get_env()
        assert isinstance(env, VecNormalize)
        return env

    def _save(self, folder: str) -> None:
        robot = self.robot
        inputs, outputs = self.model.observation_space.shape, self.model.action_space.shape
        assert inputs and outputs  # both spaces are boxes
        state = {
            "timesteps": self.num_timesteps,
            "fingerprint": robot.fingerprint,
            "robot": robot.name,
            "controller_fingerprint": controller_fingerprint(self.config),
            "observations": int(inputs[0]),
            "actions": int(outputs[0]),
            "next_evaluation": self._next,
            "evaluations": self.rows,
        }
        save_checkpoint(self.out / folder, self.model, self._normalize(), self.config, state)

    def close(self) -> None:
        """Close the environments of the evaluation."""
        if self._batch is not None:
            self._batch.close()
            self._batch = None


class Progress(BaseCallback):
    """A progress bar with the recovery rate of the latest episodes and steps per second.

    Its total is the end of the last rollout. List it before `Checkpoints`, which evaluates at the
    start and reports that through `say`.
    """

    def __init__(self, config: TrainConfig):
        super().__init__()
        rollout = config.ppo.n_envs * config.ppo.n_steps
        self.steps, self.rollout = config.steps, rollout
        self._episodes: deque[bool] = deque(maxlen=500)
        self._bar: ProgressLines | None = None

    def _on_training_start(self) -> None:
        self._bar = steps_bar("training")
        self._bar.start()
        done = self.num_timesteps
        total = done + self.rollout * -(-max(self.steps - done, 0) // self.rollout)
        self._task = self._bar.add_task("", total=total, completed=done, rate="")
        self._start, self._start_steps, self._rate = time.perf_counter(), done, ""

    def say(self, text: str) -> None:
        """Show this in place of the rates; nothing: the rates again."""
        if self._bar is not None:
            self._bar.update(self._task, rate=text or self._rate)

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "is_success" in info:
                self._episodes.append(info["is_success"])
        return True

    def _on_rollout_end(self) -> None:
        seconds = time.perf_counter() - self._start
        speed = (self.num_timesteps - self._start_steps) / max(seconds, 1e-9)
        # of the policy that explores, under the curriculum's pushes: no held-out rate
        rate = f"recovered in training {np.mean(self._episodes):.0%}, " if self._episodes else ""
        self._rate = f"{rate}{speed:,.0f}/s"
        assert self._bar is not None  # made at the start of the training
        self._bar.update(self._task, completed=self.num_timesteps, rate=self._rate)

    def close(self) -> None:
        """Give the terminal back, after the last evaluation and after an error too."""
        if self._bar is not None:
            self._bar.stop()
