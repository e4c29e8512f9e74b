"""What the sensors of a robot measure at one moment; none of them tells where it is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from poise.configs.numbers import finite_array
from poise.envs.compiled.maths.vectors import axes_of
from poise.envs.robots.robot import Robot
from poise.envs.sensing.measurement import Rings

from .readings import joint_numbers, numbers, unit_quaternion


@dataclass(frozen=True)
class Measurement:
    """The inertial unit on the root, the encoders, and the force sensors of the feet.

    Attributes:
        attitude: (4,) quaternion w, x, y, z, or (3, 3) axes, of the root in a frame whose z is up.
        angular_velocity: (3,) of the root, its own axes, as a gyroscope tells it [rad/s].
        acceleration: (3,) specific force Rᵀ(a − g), the root's axes, as an accelerometer tells it
            [m/s²]; at rest it points up with 9.81.
        joint_positions: (nj,) in the order of `joint_names`, or by name [rad; m of a slide].
        joint_velocities: (nj,) likewise [rad/s; m/s].
        ground_wrench: (6,) of the ground on the robot, the root's axes: force [N], then moment
            [N·m] about the root's origin.
        contacts: (nc,) whether each sole touches the ground, in the order of `robot.soles`.
    """

    attitude: ArrayLike
    angular_velocity: ArrayLike
    acceleration: ArrayLike
    joint_positions: ArrayLike | Mapping[str, float]
    joint_velocities: ArrayLike | Mapping[str, float]
    ground_wrench: ArrayLike
    contacts: Sequence[bool] | np.ndarray

    def check(self, robot: Robot) -> dict[str, np.ndarray]:
        """Every field as numbers; raises ConfigError naming what is missing or no number."""
        source, names = "measurement", robot.joint_names
        return {
            "attitude": self._axes(source),
            "gyro": numbers(self.angular_velocity, 3, "angular_velocity", source),
            "force": numbers(self.acceleration, 3, "acceleration", source),
            "q": joint_numbers(self.joint_positions, names, "joint_positions", source),
            "dq": joint_numbers(self.joint_velocities, names, "joint_velocities", source),
            "wrench": numbers(self.ground_wrench, 6, "ground_wrench", source),
            "found": numbers(self.contacts, len(robot.soles), "contacts", source),
        }

    def write(self, rings: Rings, k: int, robot: Robot) -> None:
        """Fill row `k` of `rings`; raises ConfigError as `check` does."""
        for name, value in self.check(robot).items():
            if name == "found":  # of each sole, and of anything
                value = np.append(value, value.any())
            getattr(rings, name)[k] = value

    def _axes(self, source: str) -> np.ndarray:
        axes = finite_array(self.attitude, (3, 3))
        if axes is None:
            axes = np.zeros((3, 3))
            axes_of(unit_quaternion(self.attitude, "attitude", source), axes)
        return axes
