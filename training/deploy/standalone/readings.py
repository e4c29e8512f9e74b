"""What tells of a robot at one moment: a state estimate, or its sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from poise.configs.errors import ConfigError
from poise.configs.numbers import finite_array
from poise.envs.compiled.maths.vectors import axes_of
from poise.envs.robots.robot import Robot
from poise.envs.sensing.measurement import Rings

SOURCE = "readings"  # named as the source in error messages


@dataclass(frozen=True)
class Readings:
    """The base and the joints of a robot, and, where it is measured, the force of the ground.

    The world's axes: z up, the ground at z = 0. The base is the robot's root body; its frame has
    the origin and the axes of that body in the robot's model.

    Attributes:
        position: (3,) of the base's origin, world [m].
        orientation: (4,) quaternion w, x, y, z that turns the base's axes into the world's.
        velocity: (3,) of the base's origin, world axes [m/s].
        angular_velocity: (3,) of the base, its own axes, as measured by a gyroscope [rad/s].
        joint_positions: (nj,) in the order of `joint_names`, or by name [rad; m of a slide].
        joint_velocities: (nj,) in the same order, or by name [rad/s; m/s of a slide].
        ground_wrench: (6,) of the ground on the robot since the readings before: force [N], world
            axes, then moment [N·m] about the base's origin, the base's axes; None: not measured.
    """

    position: ArrayLike
    orientation: ArrayLike
    velocity: ArrayLike
    angular_velocity: ArrayLike
    joint_positions: ArrayLike | Mapping[str, float]
    joint_velocities: ArrayLike | Mapping[str, float]
    ground_wrench: ArrayLike | None = None

    @classmethod
    def of_mujoco(
        cls, qpos: np.ndarray, qvel: np.ndarray, ground_wrench: ArrayLike | None = None
    ) -> Readings:
        """Readings from MuJoCo's qpos (nq,) and qvel (nv,) of a robot with a free joint.

        `ground_wrench` may be ``data.qfrc_constraint[:6]`` where nothing but the ground touches it.
        """
        return cls(qpos[:3], qpos[3:7], qvel[:3], qvel[3:6], qpos[7:], qvel[6:], ground_wrench)

    def qpos(self, robot: Robot) -> np.ndarray:
        """(nq,) as MuJoCo orders it; raises ConfigError naming what is missing or no number."""
        turn = unit_quaternion(self.orientation, "orientation")
        joints = joint_numbers(self.joint_positions, robot.joint_names, "joint_positions")
        return np.concatenate([numbers(self.position, 3, "position"), turn, joints])

    def qvel(self, robot: Robot) -> np.ndarray:
        """(nv,) as MuJoCo orders it; raises ConfigError naming what is missing or no number."""
        linear = numbers(self.velocity, 3, "velocity")
        angular = numbers(self.angular_velocity, 3, "angular_velocity")
        joints = joint_numbers(self.joint_velocities, robot.joint_names, "joint_velocities")
        return np.concatenate([linear, angular, joints])

    def wrench(self) -> np.ndarray | None:
        """(6,) of the ground, if it is measured; raises ConfigError where it is no six numbers."""
        if self.ground_wrench is None:
            return None
        return numbers(self.ground_wrench, 6, "ground_wrench")


@dataclass(frozen=True)
class Measurement:
    """The inertial unit on the root, the encoders, and the force sensors of the feet.

    None of them tells where the robot is.

    Attributes:
        attitude: (4,) quaternion w, x, y, z, or (3, 3) axes, of the root in a frame whose z is up.
        angular_velocity: (3,) of the root, its own axes, as measured by a gyroscope [rad/s].
        acceleration: (3,) specific force Rᵀ(a − g), the root's axes, as an accelerometer tells it
            [m/s²]; at rest it points up with 9.81.
        joint_positions: (nj,) in the order of `joint_names`, or by name [rad; m of a slide].
        joint_velocities: (nj,) in the same order, or by name [rad/s; m/s of a slide].
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
        """Return every field as numbers; raises ConfigError naming what is missing or no number."""
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


def joint_numbers(
    values: ArrayLike | Mapping[str, float], names: Sequence[str], field: str, source: str = SOURCE
) -> np.ndarray:
    """Return (nj,) finite numbers, given in the order of `names` or by name; else ConfigError."""
    if not isinstance(values, Mapping):
        return numbers(values, len(names), field, source)
    if missing := [name for name in names if name not in values]:
        raise ConfigError(f"lacks {', '.join(missing)}", source=source, field=field)
    if unknown := [name for name in values if name not in names]:
        raise ConfigError(f"has unknown joints: {', '.join(map(str, unknown))}", source=source,
                          field=field, choices=names)  # fmt: skip
    return numbers([values[name] for name in names], len(names), field, source)


def numbers(values: object, count: int, field: str, source: str = SOURCE) -> np.ndarray:
    """Return (`count`,) finite numbers; else ConfigError."""
    found = finite_array(values, (count,))
    if found is None:
        raise ConfigError(f"must be {count} finite numbers", source=source, field=field)
    return found


def unit_quaternion(values: object, field: str, source: str = SOURCE) -> np.ndarray:
    """Return (4,) of length 1, w first; else ConfigError."""
    turn = numbers(values, 4, field, source)
    if abs(float(np.linalg.norm(turn)) - 1.0) > 1e-3:
        raise ConfigError("must be a quaternion of length 1", source=source, field=field)
    return turn
