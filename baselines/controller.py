"""What every controller is: state and targets in, joint torques out."""

from dataclasses import dataclass, field, fields
from operator import is_not
from typing import NamedTuple, Protocol

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.memory import apart
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot


class Outputs(NamedTuple):
    """Where compiled code finds what a controller's tick gave."""

    tau: np.ndarray  # (nv−6,) joint torques [N·m]
    root_wrench: np.ndarray  # (6,) of a soft root
    failures: np.ndarray  # (1,) int: ticks since the reset that could not be solved
    soft_root: bool


@dataclass(frozen=True, eq=False)
class TargetArrays(Block):
    """What the controller is asked to reach (nj = nv−6 joints), world axes."""

    q_ref: np.ndarray  # (nj,)
    v_ref: np.ndarray  # (nj,)
    a_ref: np.ndarray  # (nj,)
    root_axes: np.ndarray  # (3, 3) desired root orientation
    root_vel: np.ndarray  # (3,) desired angular velocity of the root, body axes
    root_acc: np.ndarray  # (3,)
    com: np.ndarray  # (3,) c_ref
    com_vel: np.ndarray  # (3,)
    com_acc: np.ndarray  # (3,)
    cop: np.ndarray  # (2,) p_ref
    angular_momentum: np.ndarray  # (3,) L_ref that the posture is to carry; zero: none


@dataclass
class Targets(Copyable):
    """References of one tick, world axes; nj = nv−6 joints.

    Writing into the arrays changes what the controller sees at its next tick.
    """

    q_ref: np.ndarray  #: (nj,) joint positions [rad]
    v_ref: np.ndarray  #: (nj,) [rad/s]
    a_ref: np.ndarray  #: (nj,) [rad/s²]
    root_axes: np.ndarray  #: (3, 3) root orientation
    com: np.ndarray  #: (3,) c_ref [m]
    root_vel: np.ndarray = field(default_factory=lambda: np.zeros(3))  #: [rad/s], body axes
    root_acc: np.ndarray = field(default_factory=lambda: np.zeros(3))  #: [rad/s²], body axes
    com_vel: np.ndarray = field(default_factory=lambda: np.zeros(3))  #: ċ_ref [m/s]
    com_acc: np.ndarray = field(default_factory=lambda: np.zeros(3))  #: c̈_ref [m/s²]
    cop: np.ndarray = field(default_factory=lambda: np.zeros(2))  #: p_ref [m]

    @classmethod
    def standing(cls, robot: Robot, state: RobotState) -> "Targets":
        """Standing posture, CoM and CoP over the middle of the soles, facing their heading."""
        arrays = state.robot
        cos, sin = state.heading
        yaw = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        nj = len(robot.joint_names)
        return cls(
            q_ref=arrays.q_standing.copy(),
            v_ref=np.zeros(nj),
            a_ref=np.zeros(nj),
            root_axes=yaw @ arrays.root_standing,
            com=state.origin + np.array([0.0, 0.0, robot.height_com]),
            cop=state.origin[:2].copy(),
        )

    # (3,) L_ref [N·m·s] that the posture is to carry besides
    angular_momentum: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self):
        for item in fields(self):
            given = np.asarray(getattr(self, item.name), dtype=float)
            array = apart(given.shape)
            array[...] = given
            setattr(self, item.name, array)
        self._arrays: tuple[np.ndarray, ...] = ()

    def take(self, other: "Targets") -> None:
        """Copy the values of others."""
        for own, array in zip(self._own(), other._own(), strict=True):
            own[:] = array

    def _own(self) -> tuple[np.ndarray, ...]:
        return (
            self.q_ref, self.v_ref, self.a_ref, self.root_axes, self.root_vel, self.root_acc,
            self.com, self.com_vel, self.com_acc, self.cop, self.angular_momentum,
        )  # fmt: skip

    def arrays(self) -> TargetArrays:
        """The same arrays, not copies, for compiled code."""
        arrays = self._own()
        if not self._arrays or any(map(is_not, arrays, self._arrays)):
            self._arrays = arrays
            self._block = TargetArrays(*arrays)
        return self._block


class Controller(Protocol):
    """A balance controller. It knows no environment and never sees a push."""

    period: float  #: seconds between two calls of `torques`

    def reset(self, state: RobotState) -> None:
        """Forget everything; a new trial starts at `state`."""

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] to hold for one `period`."""
