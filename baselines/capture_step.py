"""Feet in place as long as that holds; then steps to where the capture point can be stopped."""

from dataclasses import dataclass, field, fields
from typing import Literal, NamedTuple

import numpy as np

from poise.envs.robot import Robot
from poise.envs.state import RobotState

from .around_qp import AroundQP
from .capturability import Reach, turn
from .contact_sets import ContactSets
from .controller import Targets
from .momentum_qp import MomentumQPConfig
from .support import nearest_inside
from .swing import Swing, SwingTask, swing_rows


def _length(default: float):
    return field(default=default, metadata={"min": 0.0})


@dataclass(frozen=True)
class StepLimits:
    """Where a foot may be put, from the other one, heading frame; in h. Times in 1/ω."""

    ahead: float = _length(0.75)
    behind: float = _length(0.7)
    width_min: float = _length(0.19)
    width_max: float = _length(0.75)
    speed: float = field(default=0.7, metadata={"above": 0.0})  # mean, of the swing [h ω]
    side_speed: float = field(default=0.5, metadata={"above": 0.0})  # of it sideways [h ω]
    time_min: float = field(default=0.9, metadata={"above": 0.0})
    time_max: float = field(default=1.4, metadata={"above": 0.0})


@dataclass(frozen=True)
class CaptureStepConfig:
    """`qp` holds the feet in place, `step_qp` and `swing` step."""

    kind: Literal["capture-step"] = "capture-step"
    trigger: float = 0.0  # how far ξ leaves the reach of both soles before a step [h]
    margin: float = _length(0.06)  # by which ξ is to land inside the new reach, if it can [h]
    overshoot: float = 0.04  # of the foothold beyond ξ, forward or backward [h]
    outward: float = 0.03  # of the foothold beyond ξ, to the side of the foot [h]
    haste: float = _length(0.04)  # price of time, in h per 1/ω
    stretch: float = field(default=1.0, metadata={"above": 0.0})  # legs at touchdown [h]
    gain: float = field(default=1.0, metadata={"above": 0.0})  # k of p = ξ + k (ξ − ξ_ref)
    hips: float = _length(0.0)  # by which p may be asked for beyond the reach, standing [h]
    swing_hips: float = _length(0.0)  # the same in a swing
    root_accel: float = field(default=1.5, metadata={"above": 0.0})  # most that is asked [ω²]
    joint_accel: float = field(default=5.0, metadata={"above": 0.0})  # the same of joints [ω²]
    again: float = 0.01  # `trigger` of a further step [h]
    share: float = field(default=0.95, metadata={"above": 0.0, "max": 1.0})  # of the reach
    ramp: float = field(default=0.1, metadata={"min": 0.0})  # of the load after touchdown [1/ω]
    pause: float = field(default=0.15, metadata={"min": 0.0})  # between two steps [1/ω]
    limits: StepLimits = field(default_factory=StepLimits)
    swing: SwingTask = field(default_factory=SwingTask)
    qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)
    step_qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)


class Plan(NamedTuple):
    """A step: which foot, where to, how long, at what cost [m]."""

    foot: int
    foothold: np.ndarray  # (2,)
    time: float
    cost: float


class CaptureStep(AroundQP):
    """The momentum QP with feet in place, and steps by capturability where those cannot hold.

    Stands by `qp`, bit for bit, until the capture point ξ leaves what the CoP can reach; then
    steps until it is inside again, and stays where it came to rest.
    """

    def __init__(self, robot: Robot, config: CaptureStepConfig | None = None):
        self.config = config or CaptureStepConfig()
        super().__init__(robot, self.config.qp)
        self.sets = ContactSets(robot, self.config.step_qp)
        self.reach = Reach(robot, self.config.share)
        self.h = robot.height_com
        self.rate = float(np.sqrt(self.qp.arrays.gravity / self.h))  # ω
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
        self.steps = 0
        self.swing: Swing | None = None
        self.foot = -1
        self.yaw = 0.0
        self.clock = 0.0  # since the last touchdown
        self.stepped = False
        self._region: np.ndarray | None = None

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] for the next `period`."""
        if self.swing is None:
            if self._must_step(state):
                self._begin(state, self.plan(state))
            elif not self.stepped:
                return self.qp.torques(state, targets)
        guided = self._copy(state, targets)
        if self.swing is not None and self._landed(state):
            self._land(state)
        return self._swing(state, guided) if self.swing is not None else self._stand(state, guided)

    # ---- when, with which foot, where to

    def region(self, state: RobotState) -> np.ndarray:
        """(k, 2) where the CoP can be with both soles on the ground."""
        if self._region is None:
            self._region = self.reach.both(state.sole_points, self._heading(state))
        return self._region

    def _heading(self, state: RobotState) -> float:
        return self.yaw if self.stepped else state.heading_yaw

    def _must_step(self, state: RobotState) -> bool:
        if self.stepped and self.clock < self.config.pause / self.rate:
            return False
        feet, yaw = state.sole_points[:, :2], self._heading(state)
        away = self.reach.beyond(feet[0], feet[1], yaw, state.capture_point)
        limit = self.config.again if self.stepped else self.config.trigger
        return bool(away > limit * self.h)

    def plan(self, state: RobotState) -> Plan:
        """The step that leaves least of the fall; of equal ones the shortest in time."""
        limits = self.config.limits
        times = np.linspace(limits.time_min, limits.time_max, 8) / self.rate
        plans = []
        for foot in range(2):
            footholds, residual = self.steps_of(state, foot, times, state.sole_points[foot, :2])
            cost = residual + self.config.haste * times * self.h * self.rate
            k = int(np.argmin(cost))
            plans.append(Plan(foot, footholds[k], float(times[k]), float(cost[k])))
        return min(plans, key=lambda plan: plan.cost)

    def replan(self, state: RobotState, swing: Swing) -> Plan:
        """Foothold and time left of a running step."""
        limits = self.config.limits
        low = max(limits.time_min / self.rate - swing.time, Swing.FROZEN)
        high = max(limits.time_max / self.rate - swing.time, low)
        times = np.append(np.linspace(low, high, 8), max(swing.remaining, Swing.FROZEN))
        here = swing.reference[0, :2] + 0.5 * swing.reference[1, :2] * min(swing.remaining, 0.1)
        footholds, residual = self.steps_of(state, self.foot, times, here)
        cost = residual + self.config.haste * times * self.h * self.rate
        cost += 0.02 * np.abs(times - swing.remaining)
        k = int(np.argmin(cost))
        return Plan(self.foot, footholds[k], float(times[k]), float(cost[k]))

    def steps_of(
        self, state: RobotState, foot: int, times: np.ndarray, start: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Footholds (n, 2) of steps of `foot` that land after `times` (n,) [s], and how far ξ will
        then be outside the reach of both soles [m], no less than −margin.

        The CoP is taken to stay where the stance sole brakes ξ most; the foothold is a little
        beyond ξ, as far as limits of place and speed let it.
        """
        config, limits, h = self.config, self.config.limits, self.h
        stance, yaw = 1 - foot, self._heading(state)
        R = turn(yaw)
        p0 = state.sole_points[stance, :2]
        xi = state.capture_point
        p = nearest_inside(self.reach.under(stance, p0, yaw), xi)
        end = p + (xi - p) * np.exp(state.omega * times)[:, None]
        side = 1.0 if foot == 0 else -1.0
        local = (end - p0) @ R - self.reach.middle[foot]
        local[:, 0] += config.overshoot * h * np.tanh(local[:, 0] / (0.1 * h))
        local[:, 1] += side * config.outward * h
        local[:, 0] = np.clip(local[:, 0], -limits.behind * h, limits.ahead * h)
        local[:, 1] = side * np.clip(side * local[:, 1], limits.width_min * h, limits.width_max * h)
        gap = local - (start - p0) @ R
        span = np.array([limits.speed, limits.side_speed]) * h * self.rate * times[:, None]
        excess = np.linalg.norm(gap / span, axis=1)
        local -= gap * (1.0 - 1.0 / np.maximum(excess, 1.0))[:, None]
        footholds = p0 + local @ R.T
        feet = (footholds, p0) if foot == 0 else (p0, footholds)
        residual = self.reach.beyond(*feet, yaw, end)
        return footholds, np.maximum(residual, -config.margin * h)

    # ---- swing

    def _begin(self, state: RobotState, plan: Plan) -> None:
        if not self.stepped:
            self.yaw = state.heading_yaw
        self.stepped = True
        self.steps += 1
        self.foot = plan.foot
        point = state.sole_points[plan.foot].copy()
        self.swing = Swing(point, plan.time, self.config.swing, self.h)
        self.swing.ground = float(state.sole_points[1 - plan.foot, 2])
        self.swing.aim(plan.foothold)
        self._start = point[:2].copy()

    def _landed(self, state: RobotState) -> bool:
        assert self.swing is not None
        return bool(state.contacts[self.foot] > 0.5 and self.swing.time > 0.6 * self.swing.duration)

    def _land(self, state: RobotState) -> None:
        self.swing, self.clock, self._region = None, 0.0, None

    def _swing(self, state: RobotState, t: Targets) -> np.ndarray:
        swing, foot = self.swing, self.foot
        assert swing is not None
        stance = 1 - foot
        if swing.remaining > Swing.FROZEN:
            plan = self.replan(state, swing)
            swing.aim(plan.foothold, swing.time + plan.time)
        reference = swing.advance(self.period)
        under = self.reach.under(stance, state.sole_points[stance], self.yaw)
        xi = state.capture_point
        wanted = xi + self.config.gain * (xi - under.mean(axis=0))
        self._guide(state, t, self._within(under, wanted, self.config.swing_hips))
        t.com[2] = state.sole_points[stance, 2] + self._height(
            np.linalg.norm(swing.foothold - state.sole_points[stance, :2])
        )
        rows = swing_rows(state, foot, reference, self._level(), self.config.swing)
        return self.sets.tick(state, t, (stance,), [rows])

    def _level(self) -> np.ndarray:
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    # ---- both feet on the ground, somewhere

    def _stand(self, state: RobotState, t: Targets) -> np.ndarray:
        region = self.region(state)
        xi, reference = state.capture_point, region.mean(axis=0)
        p = self._within(region, xi + self.config.gain * (xi - reference), self.config.hips)
        self._guide(state, t, p)
        spread = np.linalg.norm(state.sole_points[0, :2] - state.sole_points[1, :2])
        t.com[2] = state.sole_points[:, 2].mean() + self._height(spread)
        limits = None
        ramp = self.config.ramp / self.rate
        if self.clock < ramp:
            limits = np.full(2, np.inf)
            limits[self.foot] = state.mass * 9.81 * (0.3 + 2.0 * self.clock / ramp)
        self.clock += self.period
        return self.sets.tick(state, t, (0, 1), (), limits)

    def _within(self, region: np.ndarray, wanted: np.ndarray, hips: float) -> np.ndarray:
        """The point of `region` nearest to `wanted`, or up to `hips` beyond: that takes the hips."""
        inside = nearest_inside(region, wanted)
        over = wanted - inside
        return inside + over * min(1.0, hips * self.h / max(np.linalg.norm(over), 1e-9))

    def _height(self, spread: float) -> float:
        """CoM height above the soles that legs with the feet `spread` apart allow [m]."""
        reach = self.config.stretch * self.h
        return float(min(self.h, np.sqrt(max(reach**2 - (0.5 * spread) ** 2, 0.0))))

    def _copy(self, state: RobotState, targets: Targets) -> Targets:
        if self._guided is None:
            self._guided = Targets.standing(self.robot, state)
        for item in fields(Targets):
            getattr(self._guided, item.name)[:] = getattr(targets, item.name)
        self._guided.root_axes[:] = self._level() @ self.qp.arrays.root_standing
        self._guided.root_vel[:] = 0.0
        self._guided.root_acc[:] = 0.0
        return self._guided

    def _guide(self, state: RobotState, t: Targets, p: np.ndarray) -> None:
        """c̈_ref = ω² (c − p) and p_ref = p in the plane."""
        t.com[:2], t.com_vel[:2] = state.com[:2], state.com_vel[:2]
        t.com_acc[:2] = state.omega**2 * (state.com[:2] - p)
        t.com_vel[2] = t.com_acc[2] = 0.0
        t.cop[:] = p
        self._limit_posture(state, t)

    def _limit_posture(self, state: RobotState, t: Targets) -> None:
        """Feed-forward that caps what the posture's PD law asks for.

        A push leaves the trunk turning at some rad/s; stopping that at once would cost CoM
        acceleration, L̇ = (p − c) × f, that no foothold makes good.
        """
        p, rate2 = self.sets.parameters, self.rate**2
        asked = p.stiffness[6:] * (t.q_ref - state.q) + p.damping[6:] * (t.v_ref - state.qvel[6:])
        bound = self.config.joint_accel * rate2
        t.a_ref[:] = np.clip(asked, -bound, bound) - asked
        R = state.root_axes
        error = 0.5 * sum(np.cross(R[:, i], t.root_axes[:, i]) for i in range(3))
        asked = p.stiffness[3:6] * (R.T @ error) - p.damping[3:6] * state.qvel[3:6]
        size = np.linalg.norm(asked)
        t.root_acc[:] = asked * (min(1.0, self.config.root_accel * rate2 / max(size, 1e-9)) - 1.0)
