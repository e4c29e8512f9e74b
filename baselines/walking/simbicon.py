"""SIMBICON: a state machine of poses, the trunk upright, feet placed by where the CoM goes."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from poise.baselines.balance.in_place.pd import PDGains, joint_gains, motor_torques
from poise.baselines.balance.references.legs import foot_signs
from poise.baselines.balance.stepping.capture_step import allocate_step_memory
from poise.baselines.balance.stepping.planning.cop_region import cop_region
from poise.baselines.controller import BaseController, Targets
from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.vectors import rotation_between, turn
from poise.envs.physics.arrays import robot_arrays
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .config import GaitConfig
from .controller import Commanded
from .models.legs import leg_joints
from .planner.command import STEP_PARAMETERS, GaitCommand
from .walk import allocate_gait


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
class SpeedGains:
    """How it follows a command: no faster than `acceleration` [g] and `turn_acceleration` [ω²].

    What each stride's velocity is off is summed up, times `correction`, up to `correction_limit`
    [h ω].
    """

    acceleration: float = field(default=0.05, metadata={"above": 0.0})
    turn_acceleration: float = field(default=0.02, metadata={"above": 0.0})
    correction: float = field(default=0.2, metadata={"min": 0.0})
    correction_limit: float = field(default=0.14, metadata={"min": 0.0})


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
    speed: SpeedGains = field(default_factory=SpeedGains, metadata={"omit": "default"})


class Simbicon(Commanded, BaseController):
    """Left and right foot in turn, each lifted for a time, then lowered to the ground: it marks
    time, or walks at a commanded velocity.

    Four states, two for each foot [Yin07; Notes, lecture 11]. In each

        swing thigh   N_s = K (θ_d − θ) − D ω,  θ_d = θ_d0 + c_d d + c_v (v − v_d)  (world axes)
        trunk         N_t = K (θ_ref − θ) − D ω                                 (world axes)
        stance hip    Σ a_j τ_j = −N_t − Σ a_k τ_k,  τ_k = a_k · N_s
        other joints  τ = K (q_d − q) − D q̇;  the swing sole is kept level

    a_j, a_k are the hips' axes; d and v the CoM's place from the stance ankle and its velocity,
    in the sagittal and in the frontal plane. v_d is the velocity that is commanded and the sum of
    the strides' errors; a turn turns these planes. As feed-forward, the pendulum's force
    f = m g (c − p)/z_c through the stance ankle p: τ = h − Jᵀ f. Raises ConfigError for a robot
    without two feet or without knees.
    """

    walking = True  #: it always steps

    def __init__(self, robot: Robot, config: SimbiconConfig | None = None):
        if len(robot.soles) != 2:
            raise ConfigError(
                f"needs two feet, {robot.name!r} has {len(robot.soles)}", field="controller"
            )
        self.robot, self.config = robot, config or SimbiconConfig()
        self.period = self.config.period
        self.arrays = robot_arrays(robot)
        self.rate, self.moment = robot.omega, robot.units.moment
        region = cop_region(robot)
        self.ankles = region.middle
        self.foot_sign = foot_signs(robot)
        self.legs = [leg_joints(robot, i) for i in range(2)]
        self.stiffness, self.damping = joint_gains(self.arrays, self.config.joints)
        steps = GaitConfig(step_time=self.config.lift_time)
        self.gait = allocate_gait(steps, robot.units, steps.limits)
        self.memory = allocate_step_memory(region)
        self.reset()

    def check_command(self, command: GaitCommand) -> None:
        """Raise ConfigError for a step parameter: it follows velocity and turn alone."""
        refused = [name for name in STEP_PARAMETERS if getattr(command, name)]
        if refused:
            raise ConfigError("is not followed by simbicon, which follows ahead, left and turn",
                              field=f"command.{refused[0]}")  # fmt: skip

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial, its command too."""
        g = self.gait
        for member in (g.command, g.velocity, g.error, g.planned):
            member[:] = 0.0
        g.walking, g.step_clock = 1, -1.0
        self.stage = 0  #: 0 and 1: the left foot lifts and is lowered; 2 and 3: the right one
        self.steps = 0  #: begun since the reset
        self._clock = (1.0 - self.config.first) * self.config.lift_time / self.rate
        self._yaw: float | None = None

    @property
    def foot(self) -> int:
        """The sole that swings."""
        return self.stage // 2

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        if self._yaw is None:
            self._yaw = state.heading_yaw
        self._clock += self.period
        self._follow_command()
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
            if self.stage == 0:
                self._end_stride(state)
        m = self.memory
        m.steps, m.foot, m.swinging = self.steps, self.foot, self.stage % 2 == 0

    def _follow_command(self) -> None:
        """Let velocity and heading follow the command, no faster than they may."""
        g, c, units, dt = self.gait, self.config.speed, self.robot.units, self.period
        most = dt * np.array([c.acceleration * units.gravity] * 2
                             + [c.turn_acceleration * self.rate**2])  # fmt: skip
        g.velocity[:] += np.clip(g.command[:3] - g.velocity, -most, most)
        g.planned[:] = g.velocity[:2] + g.error
        self._yaw = (self._yaw or 0.0) + dt * float(g.velocity[2])
        if g.step_clock >= 0.0:
            g.step_clock += dt

    def _end_stride(self, state: RobotState) -> None:
        """Sum up how far the velocity of the last stride was off, where one is asked for."""
        g, c = self.gait, self.config.speed
        if not g.velocity[:2].any():
            g.error[:] = 0.0
        elif g.step_clock > 0.0:
            way = (state.com[:2] - g.middle) @ turn(self._yaw or 0.0)
            most = c.correction_limit * self.robot.height_com * self.rate
            error = g.error + c.correction * (g.velocity[:2] - way / g.step_clock)
            g.error[:] = np.clip(error, -most, most)
        g.middle[:], g.step_clock = state.com[:2], 0.0

    def _pd(self, gain: Gain, error: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """K error − D speed [N·m]."""
        return self.moment * gain.stiffness * (error - gain.damping / self.rate * speed)

    def placement(self, state: RobotState, pose: Pose) -> np.ndarray:
        """(2,) θ_d of the swing thigh, forward and to the left [rad]; d in h, v in h ω."""
        c, stance = self.config, 1 - self.foot
        h = self.robot.height_com
        R = turn(self._yaw or 0.0)
        d = (state.com[:2] - self._ankle(state, stance)[:2]) @ R / h
        v = (state.com_vel[:2] @ R - self.gait.planned) / (h * self.rate)
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
