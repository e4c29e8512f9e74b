"""Feet in place as long as that holds; then steps to where the capture point can be stopped."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from poise.envs.errors import ConfigError
from poise.envs.robot import Robot
from poise.envs.state import RobotState

from .around_qp import AroundQP
from .capturability import Reach, turn
from .contact_sets import ContactSets
from .controller import Targets
from .momentum_qp import MomentumQPConfig
from .step_plan import Foothold, Plan, StepLimits, StepPlanner
from .step_shift import STANDING, Stepping, lean_matrix
from .support import nearest_inside
from .swing import Swing, SwingTask, rotation_error, swing_rows
from .warmup import prepare

LANDING = 0.6  # share of a swing after which contact is touchdown, not the lift-off
LOW = 0.04  # [h] above the ground: a foot that touches it higher up stands on its edge
FIRST_LOAD = 0.3  # [m g] that a foot may bear at touchdown; then the limit rises by m g a ramp


@dataclass(frozen=True)
class CaptureStepConfig:
    """`qp` holds the feet in place, `step_qp` and `swing` move them; lengths in h, times in 1/ω.

    `trigger`, `again`: how far ξ leaves the reach of both soles before the first step and before
    further ones; to the first `spin` · ω L/(m g) is added, L the angular momentum in the sense of
    the fall: hips that turn the trunk already have given what they can. `gain` k of
    p = ξ + k (ξ − ξ_ref); `hips`: how far beyond its reach p may be asked for, which costs angular
    momentum. `share` of the reach that counts. `stretch`: length of the legs at touchdown, which
    sets the CoM's height, `sink` lower in a swing. `unload`, `ramp`: time in which a foot gives its
    load away, and takes it up; `pause` between two steps.
    `jump`: largest change of a torque from tick to tick, share of its limit. `root_accel` (in a
    swing `swing_accel`), `joint_accel`: most that the posture asks for [ω²].
    """

    kind: Literal["capture-step"] = "capture-step"
    trigger: float = 0.0
    spin: float = field(default=0.0, metadata={"min": 0.0})
    again: float = 0.01
    gain: float = field(default=1.0, metadata={"above": 0.0})
    hips: float = field(default=0.0, metadata={"min": 0.0})
    share: float = field(default=0.95, metadata={"above": 0.0, "max": 1.0})
    stretch: float = field(default=0.96, metadata={"above": 0.0})
    sink: float = field(default=0.0, metadata={"min": 0.0})
    ramp: float = field(default=0.1, metadata={"min": 0.0})
    unload: float = field(default=0.04, metadata={"min": 0.0})
    pause: float = field(default=0.15, metadata={"min": 0.0})
    jump: float = field(default=0.6, metadata={"above": 0.0})
    root_accel: float = field(default=100.0, metadata={"above": 0.0})
    swing_accel: float = field(default=100.0, metadata={"above": 0.0})
    joint_accel: float = field(default=100.0, metadata={"above": 0.0})
    limits: StepLimits = field(default_factory=StepLimits)
    foothold: Foothold = field(default_factory=Foothold)
    swing: SwingTask = field(default_factory=SwingTask)
    qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)
    step_qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)


class CaptureStep(AroundQP):
    """The momentum QP with feet in place, and steps by capturability where those cannot hold.

    Stands by `qp`, bit for bit, until the capture point ξ leaves what the CoP can reach; then
    steps until it is inside again, and stays where it came to rest. In a step the CoM follows
    c̈ = ω² (c − p), p = ξ + k (ξ − ξ_ref) at most at the edge of the soles in contact [Koolen12,
    Englsberger11], and the foothold follows ξ. Raises ConfigError unless there are two soles.
    """

    def __init__(self, robot: Robot, config: CaptureStepConfig | None = None):
        if len(robot.soles) != 2:
            raise ConfigError(
                f"needs two feet, {robot.name!r} has {len(robot.soles)}", field="controller"
            )
        prepare("contacts")
        self.config = config or CaptureStepConfig()
        super().__init__(robot, self.config.qp)
        self.sets = ContactSets(robot, self.config.step_qp, self.config.jump)
        self.reach = Reach(robot, self.config.share)
        self.planner = StepPlanner(robot, self.reach, self.config.limits, self.config.foothold)
        self.h, self.rate = self.planner.h, self.planner.rate
        self.shift = self.planner.shift  #: what a policy adds
        self._guided: Targets | None = None
        self.reset()

    @property
    def failures(self) -> int:
        """Ticks since the reset at which a QP was not solved."""
        return self.qp.failures + self.sets.failures

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial."""
        super().reset(state)
        self.sets.reset()
        self.shift.clear()
        self.steps = 0  #: begun since the reset
        self.swing: Swing | None = None  #: of the running step
        self.foot = -1  #: that stepped last
        self._yaw = 0.0  # heading at the first step
        self._load, self._left = 0.0, 0.0  # of the foot that lifts off: [N], share still borne
        self._clock = 0.0  # since the last touchdown [s]
        self._region: np.ndarray | None = None

    @property
    def stepped(self) -> bool:
        """Whether a step has begun since the reset."""
        return self.steps > 0

    def stepping(self) -> Stepping:
        """Where it is in its steps."""
        if self.swing is None:
            return STANDING._replace(steps=self.steps, since=self._clock)
        swing = self.swing
        phase = swing.time / swing.duration
        return Stepping(
            self.steps, self.foot, swing.reference[0], swing.foothold, phase, swing.remaining, 0.0
        )

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] for the next `period`."""
        if self.swing is None:
            if self._must_step(state):
                self._begin(state)
            elif not self.stepped:
                return self.qp.torques(state, targets)
        guided = self._copy(state, targets)
        if self.swing is not None and self._landed(state, self.swing):
            self.swing, self._clock, self._region = None, 0.0, None
        if self.swing is not None:
            return self._swing(state, guided, self.swing)
        return self._stand(state, guided)

    def _must_step(self, state: RobotState) -> bool:
        if self.stepped and self._clock < self.config.pause / self.rate:
            return False
        feet, yaw = state.sole_points[:, :2], self._heading(state)
        away = self.reach.beyond(feet[0], feet[1], yaw, state.capture_point)
        if self.stepped:
            return bool(away > self.config.again * self.h + self.shift.trigger)
        away += self.config.spin * self._spent(state)
        return bool(away > self.config.trigger * self.h + self.shift.trigger)

    def _spent(self, state: RobotState) -> float:
        """ω L/(m g) [m] of the angular momentum in the sense of the fall: hips already used."""
        way = state.capture_point - state.origin[:2]
        L = state.angular_momentum
        turning = (way[0] * L[1] - way[1] * L[0]) / max(float(np.linalg.norm(way)), 1e-9)
        return float(turning * self.rate / (state.mass * state.robot.gravity))

    def _heading(self, state: RobotState) -> float:
        return self._yaw if self.stepped else state.heading_yaw

    def _begin(self, state: RobotState) -> None:
        if not self.stepped:
            self.sets.follow(self.qp.workspace.tau)
        self._yaw = self._heading(state)
        plan: Plan = self.planner.plan(state, self._yaw)
        self.steps += 1
        self.foot = plan.foot
        self.swing = Swing(state.sole_points[plan.foot], plan.time, self.config.swing, self.h)
        self.swing.ground = float(state.sole_points[1 - plan.foot, 2])
        self.swing.aim(plan.foothold)
        self.swing.shift = plan.shift
        before = self.qp.workspace if self.steps == 1 else self.sets.workspace
        self._load, self._left = float(before.wrenches[6 * plan.foot + 2]), 1.0

    def _landed(self, state: RobotState, swing: Swing) -> bool:
        low = state.sole_points[self.foot, 2] - swing.ground < LOW * self.h
        late = swing.time > LANDING * swing.duration
        return bool(state.contacts[self.foot] > 0.5 and late and low)

    def _swing(self, state: RobotState, t: Targets, swing: Swing) -> np.ndarray:
        """A tick on one foot."""
        stance = 1 - self.foot
        if swing.remaining > Swing.FROZEN:
            plan = self.planner.replan(state, self.foot, self._yaw, swing)
            swing.aim(plan.foothold, swing.time + plan.time)
            swing.shift = plan.shift
        under = self.reach.under(stance, state.sole_points[stance], self._yaw)
        way = swing.foothold - state.sole_points[stance, :2]
        self._guide(state, t, under, 0.0, state.sole_points[stance, 2], way)
        self._left -= self.period * self.rate / max(self.config.unload, 1e-9)
        if self._left > 0.0:  # the foot that will leave gives its load to the other one
            limits = np.full(2, np.inf)
            limits[self.foot] = self._left * max(self._load, 0.0)
            return self.sets.tick(state, t, (0, 1), (), limits)
        rows = swing_rows(
            state, self.foot, swing.advance(self.period), self._level(), self.config.swing
        )
        return self.sets.tick(state, t, (stance,), [rows])

    def _stand(self, state: RobotState, t: Targets) -> np.ndarray:
        """A tick on both feet, wherever they are."""
        feet = state.sole_points
        if self._region is None:  # feet have just come to rest
            self._region = self.reach.both(feet, self._yaw)
        way = feet[0, :2] - feet[1, :2]
        self._guide(state, t, self._region, self.config.hips, float(feet[:, 2].mean()), way)
        limits, ramp = None, self.config.ramp / self.rate
        if self._clock < ramp:
            weight = state.mass * state.robot.gravity
            limits = np.full(2, np.inf)
            limits[self.foot] = weight * (FIRST_LOAD + self._clock / ramp)
        self._clock += self.period
        return self.sets.tick(state, t, (0, 1), (), limits)

    def _level(self) -> np.ndarray:
        """(3, 3) axes of a level sole along the heading."""
        axes = np.eye(3)
        axes[:2, :2] = turn(self._yaw)
        return axes

    def _copy(self, state: RobotState, targets: Targets) -> Targets:
        """Targets of our own: those given, but upright at rest along the heading."""
        if self._guided is None:
            self._guided = Targets.standing(self.robot, state)
        self._guided.take(targets)
        upright = self._level() @ lean_matrix(self.shift.lean)
        self._guided.root_axes[:] = upright @ self.qp.arrays.root_standing
        self._guided.root_vel[:] = 0.0
        return self._guided

    def _guide(
        self,
        state: RobotState,
        t: Targets,
        region: np.ndarray,
        hips: float,
        ground: float,
        way: np.ndarray,
    ) -> None:
        """c̈_ref = ω² (c − p) in the plane; a height that legs reach with the feet `way` apart."""
        xi, R = state.capture_point, turn(self._yaw)
        wanted = xi + self.config.gain * (xi - region.mean(axis=0) - R @ self.shift.com)
        p = nearest_inside(region, wanted)
        over = wanted - p
        p = p + over * min(1.0, hips * self.h / max(float(np.linalg.norm(over)), 1e-9))
        p = p + R @ self.shift.cop
        t.com[:2], t.com_vel[:2] = state.com[:2], state.com_vel[:2]
        t.com_acc[:2] = state.omega**2 * (state.com[:2] - p)
        t.cop[:] = p
        leg = self.config.stretch * self.h
        reach = np.sqrt(max(leg**2 - 0.25 * (way @ way), 0.0))
        t.com[2] = ground + min(self.h, reach) + self.shift.height
        if self.swing is not None:
            t.com[2] -= self.config.sink * self.h
        t.com_vel[2] = t.com_acc[2] = 0.0
        self._limit_posture(state, t)

    def _limit_posture(self, state: RobotState, t: Targets) -> None:
        """Feed-forward that caps what the posture's PD law asks for.

        A push leaves the trunk turning at some rad/s. To stop that at once would cost CoM
        acceleration, L̇ = (p − c) × f, which no foothold makes good.
        """
        p, rate2 = self.sets.parameters, self.rate**2
        asked = p.stiffness[6:] * (t.q_ref - state.q) + p.damping[6:] * (t.v_ref - state.qvel[6:])
        bound = self.config.joint_accel * rate2
        t.a_ref[:] = np.clip(asked, -bound, bound) - asked
        R = state.root_axes
        error = rotation_error(R, t.root_axes)
        asked = p.stiffness[3:6] * (R.T @ error) - p.damping[3:6] * state.qvel[3:6]
        most = self.config.root_accel if self.swing is None else self.config.swing_accel
        bound = most * rate2 / max(float(np.linalg.norm(asked)), 1e-9)
        t.root_acc[:] = asked * (min(1.0, bound) - 1.0)
