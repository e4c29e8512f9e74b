"""How a policy stands, nearly undisturbed."""

from dataclasses import dataclass

import numpy as np

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.policy_files.config import PolicyFileConfig
from poise.envs.robots.robot import Robot

SECONDS = 10.0  # for which it is to stand


@dataclass(frozen=True)
class Stood:
    """How it stood: when it fell [s] or None, how far it went [m], whether it was at rest."""

    fell: float | None
    moved: float
    rests: bool

    @property
    def rank(self) -> tuple[float, bool, float]:
        """The larger, the better: how long it stood, whether it rests, how little it moved."""
        return (np.inf if self.fell is None else self.fell, self.rests, -self.moved)


def stand(robot: Robot, config: PolicyFileConfig, seconds: float = SECONDS) -> Stood:
    """Let a policy stand for so many seconds of the simulation, nearly undisturbed."""
    env = ResidualBalanceEnv(robot, controller=config, pushes=None, duration=seconds)
    env.reset(seed=0, options={"push": []})
    start, rest = env.simulation.state.com.copy(), np.zeros(len(env.action_names))
    while not env.fallen and env.simulation.time < seconds - 1e-9:
        env.step_without_info(rest)
    moved = float(np.linalg.norm((env.simulation.state.com - start)[:2]))
    return Stood(env.simulation.time if env.fallen else None, moved, bool(env.recovered))
