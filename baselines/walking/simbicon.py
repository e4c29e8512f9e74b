"""SIMBICON: a state machine of poses, the trunk upright, feet placed by where the CoM goes."""

from dataclasses import dataclass, field
from typing import Literal

import mujoco
import numpy as np

from poise.baselines.controller import BaseController, Targets
from poise.baselines.in_place.pd import PDGains, joint_gains, motor_torques
from poise.baselines.stepping.cop_region import CopRegion, foot_signs
from poise.configs.errors import ConfigError
from poise.envs.maths.vectors import rotation_between, turn
from poise.envs.physics.arrays import robot_arrays
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot


@dataclass(frozen=True)
class Pose:
    """The angles of the legs in a state, from standing [rad]: swing thigh (θ_d0) and knees."""

    swing_hip: float = 0.0
    swing_knee: float = 0.0
    stance_knee: float = 0.0


@dataclass(frozen=True)
class Placement:
    """θ_d = θ_d0 + c_d d + c_v v; c_d in rad per h, c_v in rad per h ω."""

    c_d: float = 0.5
    c_v: float = 0.5


@dataclass(frozen=True)
class Gain:
    """Stiffness in m g h per radian, damping in 1/ω of the stiffness."""

    stiffness: float = field(default=0.5, metadata={"min": 0.0})
    damping: float = field(default=0.3, metadata={"min": 0.0})


@dataclass(frozen=True)
class SimbiconConfig:
    """Poses of the two states of a step, for `lift_time` [1/ω] and until touchdown.

    `first`: fraction of `lift_time` in the first step, which starts from rest. `width`: θ_d0 in the
    frontal plane, outward [rad]. `lean` of the trunk, forward [rad].
    """

    kind: Literal["simbicon"] = "simbicon"
    period: float = field(default=0.004, metadata={"above": 0.0, "max": 0.05})  # [s]
    lift_time: float = field(default=0.8, metadata={"above": 0.0})
    first: float = field(default=0.5, metadata={"above": 0.0})
    width: float = 0.0
    lean: float = 0.0
    lift: Pose = field(default_factory=lambda: Pose(swing_hip=0.4, swing_knee=0.8))
    lower: Pose = field(default_factory=Pose)
    sagittal: Placement = field(default_factory=Placement)
    frontal: Placement = field(default_factory=Placement)
    trunk: Gain = field(default_factory=lambda: Gain(1.0, 0.4))
    hip: Gain = field(default_factory=lambda: Gain(0.5, 0.3))
    knee: Gain = field(default_factory=lambda: Gain(0.5, 0.2))
    swing_ankle: Gain = field(default_factory=lambda: Gain(0.03, 0.2))
    stance_ankle: Gain = field(default_factory=lambda: Gain(0.3, 0.2))
    joints: PDGains = field(default_factory=PDGains)  # of waist and arms


class Simbicon(BaseController):
    """Marks time: left and right foot in turn, each lifted for a time, then lowered to the ground.

    Four states, two for each foot [Yin07; Notes, lecture 11]. In each

        swing thigh   N_s = K (θ_d − θ) − D ω,  θ_d = θ_d0 + c_d d + c_v v      (world axes)
        trunk         N_t = K (θ_ref − θ) − D ω                                 (world axes)
        stance hip    Σ a_j τ_j = −N_t − Σ a_k τ_k,  τ_k = a_k · N_s
        other joints  τ = K (q_d − q) − D q̇;  the swing sole is kept level

    a_j, a_k are the hips' axes; d and v the CoM's place from the stance ankle and its velocity,
    in the sagittal and in the frontal plane. As feed-forward, the pendulum's force
    f = m g (c − p)/z_c through the stance ankle p: τ = h − Jᵀ f. Raises ConfigError for a robot
    without two feet or without knees.
    """

    def __init__(self, robot: Robot, config: SimbiconConfig | None = None):
        if len(robot.soles) != 2:
            raise ConfigError(
                f"needs two feet, {robot.name!r} has {len(robot.soles)}", field="controller"
            )
        self.robot, self.config = robot, config or SimbiconConfig()
        self.period = self.config.period
        self.arrays = robot_arrays(robot)
        self.rate, self.moment = robot.omega, robot.units.moment
        self.ankles = CopRegion(robot).middle
        self.foot_sign = foot_signs(robot)
        self.legs = [_leg(robot, i) for i in range(2)]
        self.stiffness, self.damping = joint_gains(self.arrays, self.config.joints)
        self.reset()

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial."""
        self.stage = 0  #: 0 and 1: the left foot lifts and is lowered; 2 and 3: the right one
        self.steps = 0  #: begun since the reset
        self._clock = (1.0 - self.config.first) * self.config.lift_time / self.rate
        self._yaw: float | None = None

    @property
    def foot(self) -> int:
        """The sole that swings."""
        return self.stage // 2

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] for the next `period`."""
        if self._yaw is None:
            self._yaw = state.heading_yaw
        self._clock += self.period
        self._advance(state)
        c = self.config
        pose = c.lower if self.stage % 2 else c.lift
        swing, stance = self.legs[self.foot], self.legs[1 - self.foot]
        heading = np.eye(3)
        heading[:2, :2] = turn(self._yaw)
        tau = self.stiffness * (targets.q_ref - state.q) - self.damping * state.qvel[6:]
        for leg, bend in ((swing, pose.swing_knee), (stance, pose.stance_knee)):
            desired = targets.q_ref[leg.knee] + leg.bend * bend
            tau[leg.knee] = self._pd(c.knee, desired - state.q[leg.knee], state.qvel[6 + leg.knee])
        ankle = stance.ankle
        error = targets.q_ref[ankle] - state.q[ankle]
        tau[ankle] = self._pd(c.stance_ankle, error, state.qvel[6 + ankle])
        axes = state.J[6 * self.foot + 3 : 6 * self.foot + 6, 6:]
        tilt = rotation_between(heading, state.sole_axes[self.foot])
        spin = state.J_v[6 * self.foot + 3 : 6 * self.foot + 6]
        tau[swing.ankle] = axes[:, swing.ankle].T @ self._pd(c.swing_ankle, -tilt, spin)
        self._hips(state, pose, heading, tau)
        f = self._pendulum_force(state, 1 - self.foot)
        tau += (state.h - state.J.T @ f)[6:]
        return motor_torques(self.arrays, tau)

    def _advance(self, state: RobotState) -> None:
        """The next state: after a time, or at touchdown."""
        lifted = self._clock > self.config.lift_time / self.rate
        landed = state.contacts[self.foot] > 0.5
        if lifted if self.stage % 2 == 0 else landed:
            self.steps += self.stage % 2 == 0
            self.stage = (self.stage + 1) % 4
            self._clock = 0.0

    def _pd(self, gain: Gain, error: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """K error − D speed [N·m]."""
        return self.moment * gain.stiffness * (error - gain.damping / self.rate * speed)

    def placement(self, state: RobotState, pose: Pose) -> np.ndarray:
        """(2,) θ_d of the swing thigh, forward and to the left [rad]."""
        c, stance = self.config, 1 - self.foot
        h = self.robot.height_com
        R = turn(self._yaw or 0.0)
        d = (state.com[:2] - self._ankle(state, stance)[:2]) @ R / h
        v = state.com_vel[:2] @ R / (h * self.rate)
        forward = pose.swing_hip + c.sagittal.c_d * d[0] + c.sagittal.c_v * v[0]
        left = self.foot_sign[self.foot] * c.width + c.frontal.c_d * d[1] + c.frontal.c_v * v[1]
        return np.array([forward, left])

    def _hips(self, state: RobotState, pose: Pose, heading: np.ndarray, tau: np.ndarray) -> None:
        """Swing hip by the placement, stance hip by what trunk and swing hip need."""
        c, swing, stance = self.config, self.legs[self.foot], self.legs[1 - self.foot]
        axes = state.J[6 * self.foot + 3 : 6 * self.foot + 6, 6:]
        R = state.root_axes
        trunk = rotation_between(heading @ self.arrays.root_standing, R)  # from standing
        spin = R @ state.qvel[3:6]
        upper = axes[:, swing.upper]
        thigh = trunk + upper @ (state.q - self.arrays.q_standing)[swing.upper]
        forward, left = self.placement(state, pose)
        desired = heading @ np.array([left, -forward, 0.0])
        speed = spin + upper @ state.qvel[6 + swing.upper]
        tau[swing.hip] = axes[:, swing.hip].T @ self._pd(c.hip, desired - thigh, speed)
        lean = c.lean * heading[:, 1]
        moment = self._pd(c.trunk, lean - trunk, spin) + axes[:, swing.hip] @ tau[swing.hip]
        held = state.J[6 * (1 - self.foot) + 3 : 6 * (1 - self.foot) + 6, 6 + stance.hip]
        tau[stance.hip] = -np.linalg.lstsq(held, moment, rcond=None)[0]

    def _ankle(self, state: RobotState, sole: int) -> np.ndarray:
        """(3,) the point of a sole that presses without ankle torque [m]."""
        return state.sole_points[sole] + state.sole_axes[sole][:, :2] @ self.ankles[sole]

    def _pendulum_force(self, state: RobotState, sole: int) -> np.ndarray:
        """(6 nc,) sole wrenches: m g (c − p)/z_c through the ankle of one sole."""
        p = self._ankle(state, sole)
        way = state.com - p
        force = self.robot.units.force * way / max(way[2], 0.1)
        w = np.zeros(len(state.J))
        w[6 * sole : 6 * sole + 3] = force
        w[6 * sole + 3 : 6 * sole + 6] = np.cross(p - state.sole_points[sole], force)
        return w


@dataclass(frozen=True)
class _Leg:
    """Joints of a leg, by index: on the way to the thigh, the hip's own, the knee, the ankle."""

    upper: np.ndarray
    hip: np.ndarray
    knee: np.ndarray
    ankle: np.ndarray
    bend: np.ndarray  # what a bend of 1 adds to the knee


def _leg(robot: Robot, sole: int) -> _Leg:
    """Joints of a leg by how far down they are: in the upper quarter, in the lower one, between."""
    model = robot.model
    data = mujoco.MjData(model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(model, data)

    def chain(body: int) -> list[int]:
        joints: list[int] = []
        while body != robot.root_body_id:
            first = model.body_jntadr[body]
            joints = [first + k for k in range(model.body_jntnum[body])] + joints
            body = model.body_parentid[body]
        return joints

    mine, other = (chain(robot.soles[i].body_id) for i in (sole, 1 - sole))
    own = np.array([j for j in mine if j not in other])
    top, foot = data.xanchor[own[0]], data.xanchor[own[-1]]
    depth = (data.xanchor[own] - top) @ (foot - top) / ((foot - top) @ (foot - top))
    knee = own[(depth > 0.25) & (depth < 0.75)]
    if len(knee) != 1:
        raise ConfigError(f"needs legs with a knee, unlike {robot.name!r}", field="controller")
    shortens = np.cross(data.xaxis[knee], foot - data.xanchor[knee]) @ (top - foot)
    return _Leg(
        upper=np.array([j for j in mine if j < knee[0]]) - 1,  # the first joint is the root's
        hip=own[depth <= 0.25] - 1,
        knee=knee - 1,
        ankle=own[depth >= 0.75] - 1,
        bend=np.sign(shortens),
    )
