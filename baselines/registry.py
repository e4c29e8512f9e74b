"""Controllers by name: `configs/controllers/*.yaml`, or a path to such a file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from poise.envs.config import build, packaged, read_yaml, resolve
from poise.envs.errors import ConfigError
from poise.envs.robot import Robot

from .momentum_qp import MomentumQP, MomentumQPConfig


def controller_config(name_or_path: str | Path) -> MomentumQPConfig:
    """The configuration in a packaged file or a path.

    Raises ConfigError naming the file, the field and the choices.
    """
    path = resolve("controllers", name_or_path)
    return build(MomentumQPConfig, read_yaml(path), str(path))


def load_controller(controller: Any, robot: Robot) -> Any:
    """A controller for `robot`: from a name, a path, a mapping or a MomentumQPConfig.

    Whatever has `period`, `reset` and `torques` (see `Controller`) is returned as it is.
    Raises ConfigError naming the file, the field and the choices.
    """
    if isinstance(controller, MomentumQPConfig):
        return MomentumQP(robot, controller)
    if isinstance(controller, (str, Path)):
        return MomentumQP(robot, controller_config(controller))
    if isinstance(controller, Mapping):
        return MomentumQP(robot, build(MomentumQPConfig, dict(controller), "controller"))
    if all(hasattr(controller, name) for name in ("period", "reset", "torques")):
        return controller
    raise ConfigError(
        f"must be a name, a .yaml file, a mapping or a controller, not {controller!r}",
        field="controller",
        choices=packaged("controllers"),
    )
