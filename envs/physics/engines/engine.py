"""The interface of what steps a robot; of the base class, MuJoCo."""

import mujoco

from poise.envs.compiled.callbacks import NO_CALLBACK, CallbackAddress
from poise.envs.compiled.copies import Copyable
from poise.envs.robots.robot import Robot
from poise.envs.terrain.terrain import Terrain

from .config import DRAKE, Physics


class Engine(Copyable):
    """What takes the physics steps of one simulation; of this class, MuJoCo itself.

    All that acts on a robot and all that reads it goes by MuJoCo's arrays, so that pushes, motors,
    sensors, judges and pictures are the same whatever steps it. Before a step `data` holds the
    torques of the motors (`ctrl` [N·m]), generalised forces (`qfrc_applied`), and pushes at the
    bodies' centres of mass (`xfrc_applied`); its position and velocity stages are current. A step
    of another engine leaves in `data`

    - `qpos`, `qvel` and `time` after the step,
    - the wrench of the ground during the step in the root rows of `qfrc_constraint`: force [N] in
      world axes, moment [N·m] about the root's origin in root axes, of the pose before the step,
    - the numbers of contacts with the ground during the step in the contact sensors.

    The position and velocity stages of the new state are then MuJoCo's, as all kinematics are.

    Args:
        robot: that is simulated; its model may be changed between episodes.
        data: of that model.
    """

    physics = Physics()  #: the settings

    def __init__(self, robot: Robot, data: mujoco.MjData):
        self.robot, self.data = robot, data

    @property
    def stepper(self) -> CallbackAddress:
        """The address of what compiled code calls for a step; 0: MuJoCo's `mj_step2`."""
        return NO_CALLBACK

    def begin(self) -> None:
        """Start an episode; `data` holds its start, and the model may have changed."""

    def check(self) -> None:
        """Raise what has gone wrong in a step: compiled code cannot raise."""


def make_engine(physics: Physics, robot: Robot, data: mujoco.MjData) -> Engine:
    """The engine of these settings.

    Raises ConfigError for a robot, or ground, that it cannot hold; the text names the element.
    """
    if physics.engine == DRAKE:
        from .drake import DrakeEngine

        return DrakeEngine(robot, data, physics)
    return Engine(robot, data)


def check_engine(physics: Physics, robot: Robot, terrain: Terrain | None = None) -> None:
    """Raise ConfigError for a robot, or ground, that an engine cannot hold; nothing is built.

    `terrain` takes the place of the robot's.
    """
    if physics.engine == DRAKE:
        from .held import check_held

        check_held(robot, terrain)
