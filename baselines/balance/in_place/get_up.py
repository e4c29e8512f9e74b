"""Getting up by a script of postures, then balance by the QP."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch
from typing import Literal

import numpy as np

from poise.baselines.controller import BaseController, Targets
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.easing import eased
from poise.envs.physics.arrays import robot_arrays
from poise.envs.physics.state import RobotState
from poise.envs.robots.mirror import mirror_robot
from poise.envs.robots.robot import Robot

UPRIGHT = 0.6  # cosine between the root's vertical and its own in standing, below which it is down
ON_FRONT = -0.8  # below which on its front
SCRIPTS = ("lie", "rise", "front", "side")
GRACE = 1.0  # [s] after the feet carry it, in which it is not looked at
ON_BACK = 0.9  # vertical part of the root's forward axis, above which it lies on its back


@dataclass(frozen=True)
class Key:
    """A posture: it is gone to in `move` [s] and kept for `rest` [s].

    `joints` are angles by name, with `*`; what is not named stands [°].
    """

    move: float = field(default=0.3, metadata={"above": 0.0, "max": 10.0})
    rest: float = field(default=0.0, metadata={"min": 0.0, "max": 10.0})
    joints: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class GetUpConfig:
    """`get-up`: scripts of postures, servos of τ = K (q* − q) − D q̇, and the QP that balances.

    `lie` comes first, then `rise` from the back. `front` and `side` turn onto the back from there,
    and end lying; they are mirrored where the left is up. `stiffness` is K in τ_max per radian,
    `damping` D over K [s].
    """

    kind: Literal["get-up"] = "get-up"
    period: float = field(default=0.002, metadata={"above": 0.0, "max": 0.01})  # [s]
    stiffness: float = field(default=6.0, metadata={"above": 0.0})
    damping: float = field(default=0.12, metadata={"min": 0.0})
    lie: tuple[Key, ...] = ()
    rise: tuple[Key, ...] = ()
    front: tuple[Key, ...] = ()
    side: tuple[Key, ...] = ()
    qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)


class GetUp(BaseController):
    """Balances as `momentum-qp` does; down, it plays scripts until both feet carry it.

    After `lie` it plays `rise` on its back, elsewhere `front` or `side` first. After `rise` the QP
    takes over if both feet are down and the CoM is over them, and brings the robot from the squat
    to standing; else it begins again. D is taken over a tick in the denominator, with the joint's
    own inertia M_ii, so that the servos are nearly as stable as implicit ones:

        τ = (K (q* − q) − D q̇)/(1 + Δt D/M_ii),   within the motors' limits.

    Raises ConfigError for joints that the robot does not have, and for turns of a robot that is not
    its own mirror image.
    """

    def __init__(self, robot: Robot, config: GetUpConfig | None = None):
        self.robot = robot
        self.config = config or GetUpConfig()
        self.period = self.config.period
        self.arrays = robot_arrays(robot)
        self.balance = MomentumQP(robot, self.config.qp)
        self.com_offset = self.balance.com_offset
        self._motor_joints = self.arrays.motor_dofs - 6
        limits = np.zeros(len(robot.joint_names))
        limits[self._motor_joints] = robot.torque_limit
        self.stiffness = self.config.stiffness * limits
        self.damping = self.config.damping * self.stiffness
        self.scripts = {
            name: [self._posture(key) for key in getattr(self.config, name)] for name in SCRIPTS
        }
        turns = self.config.front or self.config.side
        self.mirror = mirror_robot(robot)["joints"] if turns else None
        self.script: Sequence[tuple[Key, np.ndarray]] = ()
        self.own: Targets | None = None
        self.clock, self.ticks, self.stage = 0.0, 0, "balance"
        self.start = robot.standing_qpos[7:].copy()
        self.held = np.zeros(len(self._motor_joints))

    def _posture(self, key: Key) -> tuple[Key, np.ndarray]:
        names = self.robot.joint_names
        angles = self.robot.standing_qpos[7:].copy()
        for pattern, angle in key.joints.items():
            found = [i for i, name in enumerate(names) if fnmatch(name, pattern)]
            if not found:
                raise ConfigError(f"{self.robot.name!r} has no such joint", field=pattern,
                                  choices=names)  # fmt: skip
            angles[found] = np.radians(angle)
        low, high = self.robot.joint_range.T
        return key, np.clip(angles, low, high)

    @property
    def failures(self) -> int:
        """The ticks since the reset at which the QP found no solution."""
        return self.balance.failures

    def reset(self, state: RobotState) -> None:
        """Stand, or begin on the ground."""
        self.balance.reset(state)
        self.own, self.ticks = None, 0
        self.stage, self.clock = "balance", GRACE
        if self._down(state):
            self._play("lie", state)

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """The QP's torques while it stands, the servos' while it is down."""
        if self.stage == "balance":
            self.clock += self.period
            if self.clock > GRACE and self._down(state):
                self._play("lie", state)
        if self.stage != "balance" and self.clock >= self._length():
            self._next(state)
        if self.stage != "balance":
            return self._servos(state)
        every = max(round(self.balance.period / self.period), 1)
        if self.ticks % every == 0:
            self.held = self.balance.torques(state, self.own or targets)
        self.ticks += 1
        return self.held

    def _down(self, state: RobotState) -> bool:
        """Whether it lies: the CoM is low, or the root is tilted and more than the feet touch."""
        upright = float(state.root_axes[2] @ self.arrays.root_standing[2])
        low = state.com[2] - state.origin[2] < 0.25 * self.robot.height_com
        return bool(low or (upright < UPRIGHT and state.other_contact))

    def _squats(self, state: RobotState) -> bool:
        """Whether both feet are down and the CoM is over them; hands may still touch the ground."""
        ahead = np.linalg.norm((state.com - state.origin)[:2])
        return bool((state.contacts > 0.5).all() and ahead < 0.15 * self.robot.height_com)

    def _play(self, stage: str, state: RobotState) -> None:
        self.stage, self.clock = stage, 0.0
        self.start = state.q.copy()
        self.script = self.scripts[stage]
        if stage in ("front", "side") and self.mirror and state.root_axes[2, 1] > 0.0:
            self.script = [(key, self.mirror(posture)) for key, posture in self.script]

    def _length(self) -> float:
        return sum(key.move + key.rest for key, _ in self.script)

    def _next(self, state: RobotState) -> None:
        """What follows a script that is at its end."""
        facing = float(state.root_axes[2, 0])
        if self.stage in ("lie", "front", "side"):
            turn = "front" if facing < ON_FRONT else "side"
            if facing < ON_BACK and self.scripts[turn]:
                self._play(turn if self.stage == "lie" else "lie", state)
            else:
                self._play("rise", state)
        elif self.stage == "rise" and self._squats(state):
            self.stage, self.clock, self.ticks = "balance", 0.0, 0
            self.balance.reset(state)
            self.own = Targets.standing(self.robot, state)
        else:
            self._play("lie", state)

    def _servos(self, state: RobotState) -> np.ndarray:
        """Torques (nu,) towards the script's posture."""
        goal, begin, clock = self.start, self.start, self.clock
        for key, posture in self.script:
            if clock < key.move:
                goal = begin + eased(clock / key.move) * (posture - begin)
                break
            clock -= key.move
            goal = begin = posture
            if clock < key.rest:
                break
            clock -= key.rest
        self.clock += self.period
        own = state.M.diagonal()[6:]
        tau = self.stiffness * (goal - state.q) - self.damping * state.qvel[6:]
        tau /= 1.0 + self.period * self.damping / own
        limit = self.robot.torque_limit
        return np.clip(tau[self._motor_joints], -limit, limit)
