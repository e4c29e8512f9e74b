"""Controllers by name: `configs/controllers/*.yaml`, or a path to such a file."""

from pathlib import Path

from poise.envs.config import build, read_yaml, resolve
from poise.envs.robot import Robot

from .momentum_qp import MomentumQP, MomentumQPConfig


def controller_config(name_or_path: str | Path) -> MomentumQPConfig:
    """The configuration in a packaged file or a path.

    Raises ConfigError naming the file, the field and the choices.
    """
    path = resolve("controllers", name_or_path)
    return build(MomentumQPConfig, read_yaml(path), str(path))


def load_controller(
    controller: str | Path | MomentumQPConfig | MomentumQP, robot: Robot
) -> MomentumQP:
    """A controller for `robot` from a name, a path, a configuration, or as it is."""
    if isinstance(controller, MomentumQP):
        return controller
    if not isinstance(controller, MomentumQPConfig):
        controller = controller_config(controller)
    return MomentumQP(robot, controller)
