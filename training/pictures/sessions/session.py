"""Controllers side by side, all in one trial, which goes on and is pushed while it runs."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.environments.commanded import CommandedEnv
from poise.baselines.extras import load_extra
from poise.baselines.registry import walking_controllers
from poise.baselines.walking.planner.command import GaitCommand, command_of
from poise.baselines.walking.planner.reach import Reach, shared_reach
from poise.baselines.walking.schedule import MOST_COMMANDS, TimedCommand, parse_commands
from poise.configs.errors import ConfigError, PoiseError
from poise.envs.physics.pushes.options import parse_pushes
from poise.envs.physics.pushes.push import Push
from poise.envs.robots.robot import Robot
from poise.envs.sensing.realism import IDEAL, load_realism
from poise.training.benchmarking.trials.agents import Agent, load_agent
from poise.training.benchmarking.trials.play import SteppedTrial
from poise.training.benchmarking.trials.trial import Trial

LONGEST = 1e5  # [s] after which a session would end by itself: a day
SOON = 1e-9  # [s] by which times may round


class Side:
    """A controller in a session. After a fall its motors are off, which is no part of its trial."""

    def __init__(self, agent: Agent, trial: Trial):
        self.agent, self.env = agent, agent.env
        self.walker: CommandedEnv | None = None  #: takes commands
        if isinstance(agent.env, CommandedEnv) and agent.env.command is not None:
            self.walker = agent.env
        self.begin(trial)

    def begin(self, trial: Trial) -> None:
        """Restart the trial."""
        self.fall_time: float | None = None  #: [s] after the reset
        self._stepped = SteppedTrial(self.agent, self.own(trial))

    def own(self, trial: Trial) -> Trial:
        """Return the trial for this controller: one that only stands gets no velocity command."""
        return trial if self.walker is not None else replace(trial, commands=())

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

    Every push, of the schedule or from outside, meets all of them alike, and so does every command
    those that walk. `trial` has all that came, so that `run_trial` gives the same states again, bit
    for bit.

    Args:
        agents: who plays; their environments are for one robot.
        seed: of the disturbed start.
        pushes, commands: that are known before it begins.

    Raises:
        ConfigError: a command, and none of them walks.
    """

    def __init__(
        self,
        agents: Sequence[Agent],
        seed: int = 0,
        pushes: Sequence[Push] = (),
        commands: Sequence[TimedCommand] = (),
    ):
        self.seed, self._known = seed, (tuple(pushes), tuple(commands))
        self.pushes, self.commands = self._known
        self.sides = [Side(agent, self.trial) for agent in agents]
        self.robot: Robot = agents[0].env.robot
        self.period = agents[0].env.config.policy_period  #: of a step [s]
        if commands:
            self._expect_walkers()

    @property
    def trial(self) -> Trial:
        """The trial so far: its start, all its pushes and all its commands."""
        return Trial(0, self.seed, self.pushes, commands=self.commands)

    @property
    def names(self) -> list[str]:
        """The controllers, as the user wrote them."""
        return [side.agent.name for side in self.sides]

    @property
    def time(self) -> float:
        """Seconds since the reset."""
        return self.sides[0].time

    def reset(self) -> None:
        """Start over, without the pushes and commands that were added while it ran."""
        self.pushes, self.commands = self._known
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

    @property
    def walks(self) -> bool:
        """Whether any of the controllers takes commands."""
        return any(side.walker is not None for side in self.sides)

    @property
    def reach(self) -> Reach | None:
        """The command range shared by all that walk; None if one states none, or none walks."""
        return shared_reach([each.walker.reach for each in self.sides if each.walker is not None])

    @property
    def command(self) -> GaitCommand:
        """The command that holds now."""
        so_far = [each for each in self.commands if each.start <= self.time + SOON]
        return so_far[-1] if so_far else GaitCommand()

    def walk(self, **fields: object) -> TimedCommand:
        """Tell every controller that walks a command, which holds from now on until the next.

        `fields` are those of `GaitCommand`. Commands that were known for later do not come.

        What is refused leaves the command that holds.

        Raises:
            ConfigError: a field that is not valid; a command out of a robot's reach, with its
                limits; no controller walks.
            PoiseError: there have been as many commands as an episode may have.
        """
        (command,) = parse_commands({**fields, "start": self.time}, "command")
        walkers, commanded = self._expect_walkers(), command_of(command.array())
        for walker in walkers:  # before one of them is commanded
            walker.check_command(commanded)
        before = tuple(each for each in self.commands if each.start < self.time - SOON)
        if len(before) == MOST_COMMANDS:
            raise PoiseError(f"at most {MOST_COMMANDS} commands: start over with Reset")
        self.commands = (*before, command)
        for walker in walkers:
            walker.command = commanded
        return command

    def _expect_walkers(self) -> list[CommandedEnv]:
        walkers = [side.walker for side in self.sides if side.walker is not None]
        if not walkers:
            raise ConfigError("none of these controllers walks", field="command",
                              choices=walking_controllers())  # fmt: skip
        return walkers


def load_session(
    names: Sequence[str],
    robot: Robot,
    seed: int = 0,
    pushes: Sequence[Push] = (),
    *,
    commands: Sequence[TimedCommand] = (),
    motion: ReferenceMotion | None = None,
    realism: str = IDEAL,
) -> Session:
    """Return a session of these controllers in the standard conditions of an evaluation.

    With a motion all perform it; to be lower than it ever is is a fall, or further from upright.

    Raises ConfigError for a controller that is not valid, is for another robot, or plays no
    motions; for commands where none of them walks.
    """
    agents = [load_player(name, robot, motion, LONGEST, realism) for name in names]
    return Session(agents, seed, pushes, commands)


def load_player(
    name: str,
    robot: Robot,
    motion: ReferenceMotion | None,
    duration: float,
    realism: str = IDEAL,
) -> Agent:
    """Return a controller of a session that lasts `duration` [s]; errors as of `load_session`,
    and MissingExtra for a motion without poise[motion]."""
    if motion is None:
        level = load_realism(realism)
        return load_agent(name, robot, duration=duration, pushes=None, realism=level)
    performer = load_extra("motions", "performer", f"the motion {motion.name!r}")
    agent: Agent = performer(name, robot, motion, duration, realism=realism)
    return agent
