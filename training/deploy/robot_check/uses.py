"""The packaged controllers that take a robot."""

from dataclasses import dataclass

from poise.baselines.balance.stepping.capture_step import CaptureStep
from poise.baselines.balance.stepping.planning.config import CaptureStepConfig
from poise.baselines.policy_files.config import PolicyFileConfig
from poise.baselines.registry import (
    ControllerConfig,
    available_controllers,
    controller_config,
    load_controller,
)
from poise.baselines.walking.simbicon import SimbiconConfig
from poise.configs.errors import PoiseError
from poise.envs.robots.robot import Robot

IN_PLACE, STEPPING = "in place", "stepping"


@dataclass(frozen=True)
class Uses:
    """Packaged controllers of one family.

    Attributes:
        takes: those that take the robot.
        refused: name → why it does not.
        never_step: those of `takes` whose feet stay, since its legs are too slow for their steps.
    """

    takes: tuple[str, ...]
    refused: dict[str, str]
    never_step: tuple[str, ...] = ()


def controllers_for(robot: Robot) -> dict[str, Uses]:
    """Family, `IN_PLACE` or `STEPPING` → its controllers; each is made once for the robot."""
    configs = {name: controller_config(name) for name in available_controllers()}
    return {
        family: _uses(robot, {n: c for n, c in configs.items() if _family(c) == family})
        for family in (IN_PLACE, STEPPING)
    }


def _family(config: ControllerConfig) -> str | None:
    """None for a policy, which is for the robot it was trained on."""
    if isinstance(config, PolicyFileConfig):
        return None
    return STEPPING if isinstance(config, (CaptureStepConfig, SimbiconConfig)) else IN_PLACE


def _uses(robot: Robot, configs: dict[str, ControllerConfig]) -> Uses:
    takes, refused, never = [], {}, []
    for name, config in configs.items():
        try:
            controller = load_controller(config, robot)
        except PoiseError as error:
            refused[name] = str(error)
            continue
        takes.append(name)
        if isinstance(controller, CaptureStep) and controller.step_limits is None:
            never.append(name)
    return Uses(tuple(takes), refused, tuple(never))
