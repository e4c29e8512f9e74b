"""Measure the time of a control tick, of all controllers in turn in one process."""

import contextlib
import time
from collections.abc import Iterator

import numpy as np

from poise.baselines.controller import Controller, Targets, WrappedController
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.balance.base import BalanceEnv
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot
from poise.training.benchmarking.trials.agents import Agent

ROUNDS = 3  # in which every controller has its turn
SECONDS = 0.6  # of simulated time in a round, with a push at its start


class ClockedController(WrappedController):
    """A controller whose calls of `torques` are timed."""

    def __init__(self, controller: Controller, robot: Robot):
        super().__init__(controller, robot)
        self.seconds: list[float] = []

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        begun = time.perf_counter()
        try:
            return self.inner.torques(state, targets)
        finally:
            self.seconds.append(time.perf_counter() - begun)


@contextlib.contextmanager
def clocked(env: BalanceEnv) -> Iterator[list[float]]:
    """The seconds that each call of the environment's controller takes, inside the context;
    none without a controller."""
    if not isinstance(env, ResidualBalanceEnv):
        yield []
        return
    inner = env.controller
    clock = env.controller = ClockedController(inner, env.robot)
    try:
        yield clock.seconds
    finally:
        env.controller = inner


def tick_times(agents: dict[str, Agent]) -> dict[str, float | None]:
    """Return the median time of a control tick [µs] from Python; None for a controller that raises.

    For a policy, the time of an action is divided among the ticks for which it is held.
    """
    clocks = {name: _Clock(agent) for name, agent in agents.items()}
    for turn in range(ROUNDS):
        for clock in clocks.values():
            with contextlib.suppress(Exception):  # its trials record the error
                clock.play(seed=turn)
    return {name: clock.median() for name, clock in clocks.items()}


class _Clock:
    def __init__(self, agent: Agent):
        self.agent, self.rounds = agent, 0
        self.acts: list[float] = []
        self.ticks: list[float] = []

    def play(self, seed: int) -> None:
        env = self.agent.env
        with clocked(env) as seconds:
            push = {"specific_impulse": 0.2, "start": 0.05}
            observation, _ = env.reset(seed=seed, options={"push": push})
            for _ in range(round(SECONDS / env.config.policy_period)):
                begun = time.perf_counter()
                action = self.agent.act(observation)
                self.acts.append(time.perf_counter() - begun)
                env.step_without_info(action)
                observation = env.episode.observation.astype(np.float32)
                if env.fallen:
                    break
        self.ticks += seconds
        self.rounds += 1

    def median(self) -> float | None:
        if self.rounds < ROUNDS or not self.acts:
            return None
        env = self.agent.env
        ticks = env.ticks if isinstance(env, ResidualBalanceEnv) else 1
        tick = float(np.median(self.ticks)) if self.ticks else 0.0
        return 1e6 * (tick + float(np.median(self.acts)) / ticks)
