"""Stepping in plain NumPy: what the kernels of the stepping controllers do, readable and slow."""

import numpy as np

from poise.baselines.balance.stepping.planning.cop_region import (
    DIRECTIONS,
    LOAD_FRACTIONS,
    rest_ahead,
)
from poise.baselines.balance.stepping.planning.recentring import LOADING, SHIFTING
from poise.baselines.balance.stepping.planning.swing import time_left
from poise.envs.compiled.maths.polygons import nearest_inside
from poise.envs.compiled.maths.vectors import turn
from tests.support.planned import StepPlan, alone

FROZEN = 0.03


def drifted(xi: np.ndarray, p: np.ndarray, omega: float, t: float | np.ndarray) -> np.ndarray:
    """ξ(t) = p + (ξ − p) e^(ωt): where the capture point gets while the CoP stays at p."""
    return p + (xi - p) * np.exp(omega * t)


def quintic(start, end, duration, t):
    """Position, velocity, acceleration at `t`; `start` and `end` are the three of them."""
    T = max(duration, 1e-6)
    p0, v0, a0 = start[0], start[1] * T, start[2] * T * T
    p1, v1, a1 = end[0], end[1] * T, end[2] * T * T
    A = np.array([[1.0, 1.0, 1.0], [3.0, 4.0, 5.0], [6.0, 12.0, 20.0]])
    c = np.linalg.solve(
        A, [p1 - p0 - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0]
    )  # so that value, slope and curvature fit at the end
    s = min(max(t / T, 0.0), 1.0)
    position = p0 + v0 * s + 0.5 * a0 * s**2 + c @ [s**3, s**4, s**5]
    velocity = v0 + a0 * s + c @ [3 * s**2, 4 * s**3, 5 * s**4]
    acceleration = a0 + c @ [6 * s, 12 * s**2, 20 * s**3]
    return np.array([position, velocity / T, acceleration / T**2])


def advanced(swing, dt):
    """(3, 3) what `planned.advance` should give."""
    rest, speed, w = time_left(swing), swing.landing_speed, swing
    reference, ground = swing.reference.T, float(w.ground)
    ways = []
    for now, place in zip(reference[:2], swing.foothold, strict=True):
        end = np.array([place, 0.0, 0.0])
        ways.append(quintic(now, end, rest, dt) if rest > dt else end)
    lift = w.lift * swing.duration
    if swing.time + dt < lift:
        apex = [ground + w.apex, 0.0, 0.0]
        ways.append(quintic(reference[2], apex, lift - swing.time, dt))
    elif rest > dt:
        ways.append(quintic(reference[2], [ground, -speed, 0.0], rest, dt))
    else:
        ways.append(np.array([reference[2, 0] - speed * dt, -speed, 0.0]))
    return np.array(ways).T


def rotation_error(axes, wanted):
    """(3,) ½ Σ aᵢ × bᵢ of the columns of two frames."""
    return 0.5 * sum(np.cross(axes[:, i], wanted[:, i]) for i in range(3))


def swing_rows(state, sole, reference, axes, task):
    """A, b and weights of a sole's task."""
    h, g = state.robot.height_com, state.robot.gravity
    k = task.stiffness * g / h
    d = 2.0 * task.damping_ratio * np.sqrt(k)
    rows = slice(6 * sole, 6 * sole + 6)
    velocity, error = state.J_v[rows], rotation_error(state.sole_axes[sole], axes)
    linear = reference[2] + k * (reference[0] - state.sole_points[sole])
    linear = linear + d * (reference[1] - velocity[:3])
    wanted = np.concatenate([linear, k * error - d * velocity[3:]])
    weights = np.repeat([task.weight / g**2, task.turn_weight / (g / h) ** 2], 3)
    weights[5] *= task.yaw_fraction
    return state.J[rows], wanted - state.Jdot_v[rows], weights


def beyond(region, first, second, yaw, xi):
    """How far ξ lies outside what two soles reach: the worst of 48 directions."""
    ways, worst = DIRECTIONS @ turn(yaw).T, -np.inf
    for d, way in enumerate(ways):
        ends = [
            region.support[k, d] + share * (first @ way) + (1.0 - share) * (second @ way)
            for k, share in enumerate(LOAD_FRACTIONS)
        ]
        worst = max(worst, xi @ way - max(ends))
    return worst


class ReadablePlanner:
    """`planned.Planner` with the law of the capture point."""

    def __init__(self, planner):
        self.planner, self.region, self.offsets = planner, planner.region, planner.offsets
        self.limits, self.choice, self.h = planner.limits, planner.choice, planner.units.height
        self.omega = planner.units.omega
        self.phase, self.gains = 0.0, planner.feedback.always

    def see(self, state, yaw):
        """Take the gains of where the body falls: each linear in the angle from the heading."""
        f, (ahead, left) = self.planner.feedback, turn(yaw).T @ state.com_vel[:2]
        self.gains = f.always.copy()
        if f.signals.later_step == 0.0 and len(f.angles):
            angle = np.arctan2(abs(left), ahead)
            for i, k in np.ndindex(f.always.shape):
                self.gains[i, k] += np.interp(angle, f.angles, f.added_at[:, i, k])

    def added(self, state, foot, yaw):
        """What is fed back: foothold ahead and outward, time, height."""
        f, side, robot = self.planner.feedback, self.planner.foot_sign[foot], state.robot
        out = np.array([1.0, side])  # ahead, outward
        R = turn(yaw)
        capture = R.T @ (state.capture_point - state.sole_points[1 - foot, :2]) / self.h
        standing = robot.root_standing
        lean = R.T @ (state.root_axes @ standing.T @ [0.0, 0.0, 1.0])[:2]
        L = state.arrays.momentum[3:5]
        spin = R.T @ [L[1], -L[0]] * self.omega / (robot.mass * robot.gravity * self.h)
        signals = [1.0, f.signals.later_step, self.phase, *out * capture, *out * lean, *out * spin]
        return self.gains @ signals

    def plan(self, state, yaw):
        """The best step of either foot."""
        low, high = self.limits.time_min, self.limits.time_max
        self.phase = 0.0
        self.see(state, yaw)
        times = np.linspace(low, high, 8) / self.omega
        starts = [state.sole_points[foot, :2] for foot in range(2)]
        plans = [self.best(state, foot, yaw, times, starts[foot], 0.0) for foot in range(2)]
        best = min(plans, key=lambda plan: plan.cost)
        return self.shifted(state, yaw, best, starts[best.foot])

    def replan(self, state, foot, yaw, swing):
        """The best time and place of a running step."""
        rate = self.omega
        self.phase = swing.time / swing.duration
        low = max(self.limits.time_min / rate - swing.time, FROZEN)
        high = max(self.limits.time_max / rate - swing.time, low)
        left = max(time_left(swing) - swing.time_offset, FROZEN)
        times = np.append(np.linspace(low, high, 8), left)
        start = swing.reference[0, :2] + 0.5 * swing.reference[1, :2] * min(left, 0.1)
        best = self.best(state, foot, yaw, times, start, 0.02 * np.abs(times - left))
        return self.shifted(state, yaw, best, start)

    def shifted(self, state, yaw, plan, start):
        """It lands earlier or later, as feedback and a policy want."""
        later = self.added(state, plan.foot, yaw)[2] + self.offsets.time
        if later == 0.0:
            return plan
        time = max(plan.time + later, FROZEN)
        foothold, _ = self.foothold(state, plan.foot, yaw, time, start)
        return StepPlan(plan.foot, foothold, time, plan.cost, time - plan.time)

    def best(self, state, foot, yaw, times, start, extra):
        """The cheapest of several times."""
        tried = [self.foothold(state, foot, yaw, time, start) for time in times]
        cost = np.array([left for _, left in tried]) + extra
        cost = cost + self.choice.time_price * times * self.h * self.omega
        k = int(np.argmin(cost))
        return StepPlan(foot, tried[k][0], float(times[k]), float(cost[k]))

    def foothold(self, state, foot, yaw, time, start):
        """Foothold (2,) of a step, and how far ξ will then be outside both soles' reach."""
        choice, h, R, side = self.choice, self.h, turn(yaw), self.planner.foot_sign[foot]
        stance, xi = state.sole_points[1 - foot, :2], state.capture_point
        p = nearest_inside(alone(self.region, 1 - foot, stance, yaw), xi)
        end = drifted(xi, p, state.omega, time)
        local = R.T @ (end - stance) - self.region.middle[foot]
        local[0] += choice.sagittal_offset * h * np.tanh(local[0] / (0.1 * h))
        local[1] += side * choice.lateral_offset * h
        ahead, outward, _, _ = self.added(state, foot, yaw)
        local = local + self.offsets.foothold + [ahead, side * outward]
        local = self.allowed(local, R.T @ (start - stance), foot, time)
        foothold = stance + R @ local
        first, second = (foothold, stance) if foot == 0 else (stance, foothold)
        outside = beyond(self.region, first, second, yaw, end)
        return foothold, max(outside, -choice.margin * h)

    def allowed(self, local, start, foot, time):
        """What limits of place and speed leave of a foothold from the stance sole."""
        limits, h, side = self.limits, self.h, self.planner.foot_sign[foot]
        x = np.clip(local[0], -limits.behind * h, limits.ahead * h)
        y = side * np.clip(side * local[1], limits.width_min * h, limits.width_max * h)
        gap = np.array([x, y]) - start
        span = np.array([limits.speed, limits.side_speed]) * h * self.omega * time
        excess = max(float(np.linalg.norm(gap / span)), 1.0)
        return np.array([x, y]) - gap * (1.0 - 1.0 / excess)


def lean_matrix(lean):
    """(3, 3) turn by the rotation vector (lean_x, lean_y, 0): Rodrigues' formula."""
    angle = float(np.hypot(*lean))
    if angle == 0.0:
        return np.eye(3)
    x, y = np.asarray(lean) / angle
    K = np.array([[0.0, 0.0, y], [0.0, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K)


def guided(controller, state, targets, region, overreach, ground, stride, raised):
    """What `copy_reference` and `guide_com` should put into the targets, by name; `raised` is fed
    back."""
    c, h, offsets = controller.config, controller.robot.units.height, controller.offsets
    level, rate2 = controller.memory.level_frame, controller.robot.units.omega**2
    R, xi, p = level[:2, :2], state.capture_point, controller.sets.posture
    r = controller.recentring
    rest = region.mean(axis=0)
    if controller.swing is None:
        rest = rest + R @ [rest_ahead(controller.robot, controller.region), 0.0]
    if r.stage == SHIFTING:
        rest = r.capture_target
    wanted = xi + c.gain * (xi - rest - R @ offsets.com)
    if r.stage == LOADING:
        away = wanted - xi
        wanted = xi + away * min(
            1.0, c.recentring.cop_distance * h / max(float(np.linalg.norm(away)), 1e-9)
        )
    cop = nearest_inside(region, wanted)
    over = wanted - cop
    cop = cop + over * min(1.0, overreach * h / max(float(np.linalg.norm(over)), 1e-9))
    cop = cop + R @ offsets.cop
    reach = np.sqrt(max((c.leg_length * h) ** 2 - 0.25 * (stride @ stride), 0.0))
    height = ground + min(h, reach) + offsets.height
    swinging = controller.swing is not None
    height += raised * swinging
    asked = p.stiffness[6:] * (targets.q_ref - state.q)
    asked = asked + p.damping[6:] * (targets.v_ref - state.qvel[6:])
    bound = c.joint_accel * rate2
    axes = level @ lean_matrix(offsets.lean) @ controller.qp.arrays.root_standing
    error = state.root_axes.T @ rotation_error(state.root_axes, axes)
    turning = p.stiffness[3:6] * error - p.damping[3:6] * state.qvel[3:6]
    most = (c.swing_accel if swinging else c.root_accel) * rate2
    share = min(1.0, most / max(float(np.linalg.norm(turning)), 1e-9))
    return {
        "com": np.append(state.com[:2], height - c.swing_com_drop * h * swinging),
        "com_vel": np.append(state.com_vel[:2], 0.0),
        "com_acc": np.append(state.omega**2 * (state.com[:2] - cop), 0.0),
        "cop": cop,
        "q_ref": targets.q_ref,
        "a_ref": np.clip(asked, -bound, bound) - asked,
        "root_axes": axes,
        "root_vel": np.zeros(3),
        "root_acc": turning * (share - 1.0),
        "angular_momentum": targets.angular_momentum,
    }
