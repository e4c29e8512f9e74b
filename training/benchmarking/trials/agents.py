"""Agents: a controller by its name, ready to act in its own environment."""

import contextlib
import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from poise.baselines.allowance import is_plugin, noting
from poise.baselines.environments.commanded import CommandedEnv
from poise.baselines.environments.guard.config import (
    GuardConfig,
    guard_config,
    is_guard,
    walker_config,
)
from poise.baselines.environments.guard.env import GuardedEnv
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.stepping import ResidualStepEnv
from poise.baselines.environments.velocity import VelocityEnv
from poise.baselines.environments.walking import ResidualWalkEnv
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.baselines.plugins import PluginConfig, find_plugin, make_plugin, plugin_config
from poise.baselines.policy_files.config import PolicyFileConfig
from poise.baselines.policy_files.controller import PolicyFile
from poise.baselines.policy_files.reading import is_policy
from poise.baselines.registry import (
    ControllerConfig,
    controller_config,
    walking_controllers,
    where_uncertain,
)
from poise.baselines.walking.config import WalkConfig
from poise.baselines.walking.planner.command import GaitCommand
from poise.baselines.walking.simbicon import SimbiconConfig
from poise.configs.errors import ConfigError, PoiseError, shown
from poise.configs.files import packaged
from poise.configs.reading import is_folder
from poise.configs.schema import to_dict, to_yaml
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.robots.robot import Robot
from poise.envs.sensing.realism import Realism

from .names import NO_CONTROL, check_name


@dataclass(frozen=True, eq=False)
class Agent:
    """A name, an environment, and the actions in it."""

    name: str  #: as typed by the user
    env: BalanceEnv  #: the environment it acts in
    act: Callable[[np.ndarray], np.ndarray]  #: deterministic action (na,) for an observation (no,)
    fingerprint: str  #: hash of the controller's configuration and the policy's weights
    #: called at the start of every trial, for policies with a memory
    begin: Callable[[], object] | None = None
    timesteps: int | None = None  #: environment steps that a policy of `poise train` learned from


def load_agent(name: str, robot: Robot, **overrides: Any) -> Agent:
    """Return an agent from the name of a controller.

    Args:
        name: a packaged controller or a path to a ``.yaml`` of one (run with action zero),
            a packaged policy (``residual``), ``zero`` (no torque at all), a folder written by
            ``poise train``, an external policy (an ONNX file, or a folder with a
            ``deploy.yaml``), ``module:Class`` or ``file.py:Class`` of a controller or a policy, or
            a guard (a packaged one or its ``.yaml``).
        robot: that is controlled. A policy must have been trained on it.
        overrides: arguments of the environment, or fields of its `EnvConfig`.

    Raises:
        ConfigError: no such controller, or one that is not valid or is for another robot; or
            an external one that the user has not allowed, see `allowing`.
    """
    check_name(name)
    if name == NO_CONTROL:
        return _idle(name, TorqueBalanceEnv(robot, **overrides), NO_CONTROL)
    if name in packaged("policies") or (is_folder(name) and not is_policy(name)):
        return _policy(name, robot, overrides)
    if is_guard(name):
        return _guarded(name, guard_config(name), robot, overrides)
    if is_plugin(name) and not _is_controller(name, robot):
        return _outside_policy(name, robot, overrides)
    config = controller_config(name)
    try:
        env = ResidualBalanceEnv(robot, controller=config, **overrides)
    except ConfigError as error:
        if error.field != "controller period":
            raise
        raise ConfigError(error.message, source=name, field="period") from None
    return _idle(name, env, to_yaml(_wherever(config)) + _stand_in(config))


def stand_in(agent: Agent, level: Realism) -> str | None:
    """Return the controller that runs in place of an agent's at a realism level, or None."""
    return agent.env.stand_in(level) if isinstance(agent.env, ResidualBalanceEnv) else None


def code_of(name: str) -> list[str]:
    """Return what a command must allow by ``--allow`` to load the agent of this name.

    That is the external class or TorchScript file to which the name, or the file or folder of this
    name, refers. Code that is not allowed does not run here.
    """
    if is_plugin(name):
        return [name]
    with noting() as code, contextlib.suppress(PoiseError):
        if is_guard(name):
            walker_config(guard_config(name), name)
        elif is_folder(name) and not is_policy(name):
            from poise.training.learning.policy import load_policy

            load_policy(name)
        elif name != NO_CONTROL and name not in packaged("policies"):
            controller_config(name)
    return code


def check_walks(name: str, agent: Agent, source: str) -> None:
    """Raise ConfigError unless the controller of an agent walks; `source` requires it."""
    if not can_walk(agent):
        raise does_not_walk(name, source)


def can_walk(agent: Agent) -> bool:
    """Return whether the controller of an agent takes commands of a walk."""
    return isinstance(agent.env, CommandedEnv) and agent.env.command is not None


def check_may_walk(name: str, source: str) -> ControllerConfig | None:
    """Return the configuration of a controller that is described by a packaged name or a file, or
    None.

    Raises ConfigError as `check_walks` if that configuration does not walk; nothing is compiled.
    """
    check_name(name)
    described = name in packaged("controllers") or Path(name).suffix in (".yaml", ".yml")
    if not described or is_policy(name) or is_guard(name):
        return None
    config = controller_config(name)
    if not isinstance(config, (WalkConfig, SimbiconConfig, PluginConfig, PolicyFileConfig)):
        raise does_not_walk(name, source)
    return config


def does_not_walk(name: str, source: str) -> ConfigError:
    """Return the error of a controller that does not walk where `source` requires one that does."""
    return ConfigError(f"the controller {shown(name)} does not walk", source=source,
                       field="controller", choices=walking_controllers())  # fmt: skip


def can_follow(agent: Agent) -> bool:
    """Return whether an agent tracks a reference; the network of an external policy sees none."""
    env = agent.env
    return isinstance(env, ResidualBalanceEnv) and not isinstance(env.controller, PolicyFile)


def follows_no_motion(name: str, source: str | None = None) -> ConfigError:
    """Return the error of a controller that tracks no reference where `source` has a motion
    performed."""
    return ConfigError(f"{shown(name)} follows no motion: name a controller that tracks a "
                       "reference, or a policy on one", source=source,
                       field="controller")  # fmt: skip


def _stand_in(config: ControllerConfig) -> str:
    """Return the controller that replaces this one at realism levels, or an empty text."""
    other = where_uncertain(config)
    return "" if other is None else to_yaml(other)


def _wherever(config: ControllerConfig) -> ControllerConfig:
    """Return the configuration without the folder of a policy's files, which have a digest."""
    if isinstance(config, PolicyFileConfig):
        return replace(
            config, policy=Path(config.policy).name, described_in="", said=(), origin=None
        )
    return config


def _idle(name: str, env: BalanceEnv, content: str) -> Agent:
    """Return an agent whose action is always zero."""
    action = np.zeros(len(env.action_names))
    return Agent(name, env, lambda observation: action, _hash(content.encode()))


def _policy(name: str, robot: Robot, overrides: dict[str, object]) -> Agent:
    from poise.training.learning.policy import load_policy
    from poise.training.learning.policy_files import controller_fingerprint

    policy = load_policy(name, robot)
    if policy.config.action == "velocity":  # it stands in a trial that commands nothing
        overrides = {"command": GaitCommand(), **overrides}
    env = policy.make_env(robot=robot, **overrides)
    sizes = (policy.layers[0][0].shape[0], policy.layers[-1][0].shape[1])
    expected = (env.episode.observation.size, len(env.action_names))
    if sizes != expected:
        raise ConfigError(
            f"the policy has {sizes[0]} observations and {sizes[1]} actions, the environment of "
            f"{robot.name!r} has {expected[0]} and {expected[1]}",
            source=name,
        )
    world = {k: v for k, v in to_dict(policy.config).items() if k not in TRAINING}
    below = controller_fingerprint(policy.config)
    if below:
        below += _stand_in(policy.config.controller_below())
    content = _hash(to_yaml(world).encode(), below.encode(), *policy.content())
    return Agent(name, env, policy.act, content, timesteps=policy.state["timesteps"])


def _guarded(name: str, guard: GuardConfig, robot: Robot, overrides: dict[str, object]) -> Agent:
    """Return a walker and the recovery policy that takes over from it."""
    from poise.training.learning.policy import load_policy

    walker = walker_config(guard, name)
    if guard.recovery not in packaged("policies") and not is_folder(guard.recovery):
        raise ConfigError(f"no such policy: {shown(guard.recovery)}", source=name,
                          field="recovery", choices=packaged("policies"))  # fmt: skip
    policy = load_policy(guard.recovery, robot)
    own = policy.config
    if own.action != "whole":
        raise ConfigError(f"{shown(guard.recovery)} moves {own.action!r}, not servos that take "
                          "over (whole)", source=name, field="recovery")  # fmt: skip
    hand_over = replace(own.hand_over, calm_time=guard.calm_time, uncertain=None)
    env = GuardedEnv(
        robot, own.env, guard=guard, controller=walker, servos=own.servos, hand_over=hand_over,
        smoothing=own.smoothing, **overrides,
    )  # fmt: skip
    below = to_yaml(_wherever(walker)).encode()
    content = _hash(to_yaml(guard).encode(), below, to_yaml(own.env).encode(), *policy.content())
    return Agent(name, env, policy.act, content, timesteps=policy.state["timesteps"])


# fields of a training configuration that do not affect its policy's actions
TRAINING = (
    *("seed", "steps", "threads", "keep_every", "physics_step", "start_from"),
    *("ppo", "curriculum", "evaluation"),
)
ENVIRONMENTS = {
    "residual": ResidualBalanceEnv,
    "step": ResidualStepEnv,
    "walk": ResidualWalkEnv,
    "whole": ResidualWholeEnv,
    "torque": TorqueBalanceEnv,
    "position": PositionBalanceEnv,
    "velocity": VelocityEnv,
}


def _is_controller(name: str, robot: Robot) -> bool:
    """Return whether a class, or the object made by a function, is a controller (has `torques`)."""
    found = find_plugin(name)
    return hasattr(found if isinstance(found, type) else make_plugin(name, robot), "torques")


def _outside_policy(name: str, robot: Robot, overrides: dict[str, object]) -> Agent:
    """Return the agent of an external policy, in the environment that it names or makes."""
    policy = make_plugin(name, robot)
    if not hasattr(policy, "act"):
        raise ConfigError("has neither torques (a controller) nor act (a policy)", source=name)
    if hasattr(policy, "make_env"):
        env = policy.make_env(robot=robot, **overrides)
    else:
        kind = getattr(policy, "environment", "torque")
        if kind not in ENVIRONMENTS:
            raise ConfigError(f"no such environment: {shown(kind)}", source=name,
                              field="environment", choices=ENVIRONMENTS)  # fmt: skip
        env = ENVIRONMENTS[kind](robot, **overrides)
    content = to_yaml(plugin_config(name)).encode()
    return Agent(name, env, policy.act, _hash(content), getattr(policy, "reset", None))


def _hash(*parts: bytes) -> str:
    return hashlib.sha256(b"\0".join(parts)).hexdigest()
