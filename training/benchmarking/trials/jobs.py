"""Jobs for worker processes, run by `run_job`."""

from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.balance.references.tempo import Tempo
from poise.envs.balance.config import StartNoise
from poise.envs.physics.engines.config import MUJOCO
from poise.envs.robots.robot import Robot, load_robot

from .agents import Agent, load_agent
from .play import run_trial
from .trial import Outcome, Trial, failed_trial
from .variants import AgentVariants

LONGEST = 600.0  # [s] of a trial that performs a motion
ANYWHERE = {"height": 1e-3, "tilt": 180.0}  # `FallLimits` that never end an episode


@dataclass(frozen=True)
class TrialStage:
    """The robot, duration and noise that all trials of a suite share."""

    robot: str | Path  #: name or path
    duration: float  #: of a trial [s]
    noise: StartNoise  #: of the start
    #: name and file (or packaged name) of each motion that trials perform; falls are relative to
    #: these then
    motions: tuple[tuple[str, str], ...] = ()
    tempo: Tempo = field(default_factory=Tempo)  #: of the motions
    #: time after a fall in which the robot may get up [s]; None: a fall ends the trial
    get_up: float | None = None
    physics: str = MUJOCO  #: engine that steps the robot, by its name or file

    def load(self, controller: str, robot: Robot | None = None) -> Agent:
        """Return the agent of this name; `robot` if already loaded. Raises ConfigError."""
        robot = robot or _robot(self.robot)
        duration = self.duration + (self.get_up or 0.0)
        given: dict[str, Any] = {"duration": duration, "pushes": None, "noise": self.noise,
                                 "physics": self.physics}  # fmt: skip
        if self.get_up is not None:
            given["fall"] = {"terminates": False}
        if self.motions:
            given["fall"] = ANYWHERE
        if self.tempo.waits:
            given["tempo"] = self.tempo
        return load_agent(controller, robot, **given)

    def motion(self, name: str | None, robot: Robot | None = None) -> ReferenceMotion | None:
        """Return the motion of this name, or None without a name. Raises ConfigError."""
        if name is None:
            return None
        return load_motion(dict(self.motions)[name], robot or _robot(self.robot))


@dataclass(frozen=True)
class Job:
    """One trial for one controller, by the name that `load_agent` takes."""

    stage: TrialStage
    controller: str
    trial: Trial


def run_job(job: Job) -> Outcome:
    """Run a job; an exception of the controller in the trial becomes the outcome's `error`.

    Raises PoiseError when the controller cannot be loaded here.
    """
    variants = _loaded(job.stage, job.controller)
    motion = _motion(job.stage, job.trial.motion)
    try:
        agent = variants.under(job.trial.conditions, job.trial.terrain, motion)
        return run_trial(agent, job.trial)
    except MemoryError:  # of this process, not of the controller
        raise
    except Exception as error:  # an external controller may raise anything
        del _variants[job.stage, job.controller]  # it may be broken: the next trial gets a new one
        return failed_trial(error)


@cache
def _motion(stage: TrialStage, name: str | None) -> ReferenceMotion | None:
    return stage.motion(name)


@lru_cache(maxsize=1)
def _robot(name: str | Path) -> Robot:
    return load_robot(name)


_variants: dict[tuple[TrialStage, str], AgentVariants] = {}  # of this process


def _loaded(stage: TrialStage, controller: str) -> AgentVariants:
    key = (stage, controller)
    if key not in _variants:
        _variants[key] = AgentVariants(stage.load(controller))
    return _variants[key]
