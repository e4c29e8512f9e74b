"""Controllers side by side, all in one trial, which goes on and is pushed while it runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from poise.envs.pushes.options import parse_pushes
from poise.envs.pushes.push import Push
from poise.envs.robots.robot import Robot
from poise.training.trials.agents import Agent, load_agent
from poise.training.trials.play import SteppedTrial
from poise.training.trials.trial import Trial

LONGEST = 1e5  # [s] after which a session would end by itself: a day
MOST = 3  # controllers side by side


class Side:
    """A controller in a session. After a fall its motors are off, which is no part of its trial."""

    def __init__(self, agent: Agent, trial: Trial):
        self.agent, self.env = agent, agent.env
        self.begin(trial)

    def begin(self, trial: Trial) -> None:
        """Start the trial anew."""
        self.fall_time: float | None = None  #: [s] after the reset
        self._stepped = SteppedTrial(self.agent, trial)

    @property
    def time(self) -> float:
        """Seconds since the reset."""
        return self.env.simulation.time

    def advance(self, time: float) -> None:
        """Play on until `time` [s] after the reset."""
        while self.time < time - 1e-9:
            if self._stepped.done:
                self.env.simulation.step(np.zeros(self.env.model.nu), self.env.substeps)
                continue
            self._stepped.step()
            if self.env.fallen:
                self.fall_time = self.time


class Session:
    """A trial that several controllers play at once, each with a robot of its own.

    Every push, of the schedule or from outside, meets all of them alike. `trial` has all that came,
    so that `run_trial` gives the same states again, bit for bit.

    Args:
        agents: who plays; their environments are for one robot.
        seed: of the disturbed start.
        pushes: that are known before it begins.
    """

    def __init__(self, agents: Sequence[Agent], seed: int = 0, pushes: Sequence[Push] = ()):
        self.seed, self._known = seed, tuple(pushes)
        self.pushes = self._known
        self.sides = [Side(agent, self.trial) for agent in agents]
        self.robot: Robot = agents[0].env.robot
        self.period = agents[0].env.config.policy_period  #: of a step [s]

    @property
    def trial(self) -> Trial:
        """The trial so far: its start and all its pushes."""
        return Trial(0, self.seed, self.pushes)

    @property
    def names(self) -> list[str]:
        """The controllers, as the user wrote them."""
        return [side.agent.name for side in self.sides]

    @property
    def time(self) -> float:
        """Seconds since the reset."""
        return self.sides[0].time

    def reset(self) -> None:
        """Begin anew, without the pushes that came while it ran."""
        self.pushes = self._known
        for side in self.sides:
            side.begin(self.trial)

    def step(self) -> None:
        """Play a policy step of every controller."""
        time = self.time + self.period
        for side in self.sides:
            side.advance(time)

    def push(self, **fields: object) -> Push:
        """Push every robot from now on; `fields` are those of `parse_pushes`, without a start.

        Raises ConfigError naming the field that is not valid; nothing is pushed then.
        """
        (push,) = parse_pushes({**fields, "start": self.time}, self.robot)
        assert isinstance(push, Push)  # a kick has no magnitude among the fields
        self.pushes = (*self.pushes, push)
        for side in self.sides:
            side.env.simulation.set_pushes(self.pushes)
        return push


def load_session(
    names: Sequence[str], robot: Robot, seed: int = 0, pushes: Sequence[Push] = ()
) -> Session:
    """A session of these controllers in the standard conditions of an evaluation.

    Raises ConfigError for a controller that is not valid, or is for another robot.
    """
    agents = [load_agent(name, robot, duration=LONGEST, pushes=None) for name in names]
    return Session(agents, seed, pushes)
