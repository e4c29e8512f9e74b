"""The controller of a result, as it took part."""

from poise.configs.errors import ConfigError, shown
from poise.configs.schema import build
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.metrics.motions import suite_stage
from poise.training.benchmarking.suites.suite import Suite
from poise.training.benchmarking.trials.agents import Agent
from poise.training.benchmarking.trials.jobs import Stage
from poise.training.benchmarking.trials.trial import Trial
from poise.training.benchmarking.trials.variants import AgentVariants
from poise.training.running.files import SETTINGS

from .read import Results


def player(results: Results, name: str, trial: Trial) -> Agent:
    """The controller as it took part, in the conditions of `trial`.

    Raises ConfigError if it or the robot has changed since.
    """
    agent, stage = _agent(results, name)
    motion = stage.motion(trial, agent.env.robot)
    return AgentVariants(agent).under(trial.conditions, trial.terrain, motion)


def _agent(results: Results, name: str) -> tuple[Agent, Stage]:
    settings, folder = results.settings, results.folder
    robot = load_robot(settings.robot)
    if robot.fingerprint != settings.robot_fingerprint:
        raise ConfigError(f"the robot {shown(settings.robot)} has changed since", source=folder,
                          field="robot_fingerprint")  # fmt: skip
    suite = build(Suite, settings.suite, str(folder / SETTINGS))
    stage = suite_stage(suite, settings.robot, folder)
    agent = stage.load(name, robot)
    if agent.fingerprint != settings.controllers[name]:
        raise ConfigError(f"the controller {shown(name)} has changed since", source=folder,
                          field="controllers")  # fmt: skip
    return agent, stage
