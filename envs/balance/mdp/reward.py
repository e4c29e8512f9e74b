"""The reward: a sum of terms, each of which stands here with its weight, formula and kernel.

A new term is one more function and its field of `RewardWeights`; with a weight of 0 it is off, and
not computed. All that a term may read are the fields of `RewardView`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, fields

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Program, value_of
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import along
from poise.envs.physics.arrays import RobotArrays, SimViews
from poise.envs.physics.kinematics import StateArrays

from .observation import Scales
from .termination import Limits, uprightness


@dataclass(frozen=True, eq=False)
class RewardView(Block):
    """The block that the kernel of a reward term reads; the state is the true one."""

    robot: RobotArrays
    state: StateArrays
    scales: Scales
    limits: Limits
    q_ref: np.ndarray  # (nj,) joint positions of the reference [rad]
    views: SimViews  # whose `ctrl` (nu,) are the torques of the last control tick [N·m]
    action: np.ndarray  # (na,)
    last_action: np.ndarray  # (na,) of the policy step before
    # (3,) of a walk's mean velocity from its command: ahead, left [m/s], turn [rad/s]
    velocity_error: np.ndarray
    command: np.ndarray  # (3,) commanded velocity: ahead, left [m/s], turn [rad/s]; zeros: to stand


@compiled
def squared_distance(v: RewardView, point: np.ndarray) -> float:
    """e² of a point of the ground from the middle of the soles [half support]."""
    s = v.state
    x, y = point[0] - s.origin[0], point[1] - s.origin[1]
    x, y = along(s.heading[0], s.heading[1], x, y)
    x, y = x * v.scales.per_support_x, y * v.scales.per_support_y
    return x * x + y * y


@compiled
def constant(v: RewardView) -> float:
    return 1.0


@compiled
def com_near(v: RewardView) -> float:
    return np.exp(-4.0 * squared_distance(v, v.state.com))


@compiled
def capture_near(v: RewardView) -> float:
    return np.exp(-2.0 * squared_distance(v, v.state.capture_point))


@compiled
def root_upright(v: RewardView) -> float:
    return max(uprightness(v.robot, v.state), 0.0) ** 4


@compiled
def com_slow(v: RewardView) -> float:
    for a in range(3):
        if v.command[a] != 0.0:
            return 0.0
    velocity = v.state.com_vel
    speed = np.sqrt(velocity[0] ** 2 + velocity[1] ** 2 + velocity[2] ** 2)
    return np.exp(-((speed / v.limits.quiet_speed) ** 2) / 4.0)


@compiled
def posture_near(v: RewardView) -> float:
    total = 0.0
    for a in range(v.q_ref.shape[0]):
        total += (v.state.qpos[7 + a] - v.q_ref[a]) ** 2
    return np.exp(-total)


@compiled
def torque_cost(v: RewardView) -> float:
    total, torques = 0.0, v.views.ctrl
    for i in range(torques.shape[0]):
        total += (torques[i] / v.robot.torque_limit[i]) ** 2 / torques.shape[0]
    return -total


@compiled
def action_cost(v: RewardView) -> float:
    total, n = 0.0, v.action.shape[0]
    for a in range(n):
        total += v.action[a] ** 2 / n
    return -total


@compiled
def action_change_cost(v: RewardView) -> float:
    total, n = 0.0, v.action.shape[0]
    for a in range(n):
        total += (v.action[a] - v.last_action[a]) ** 2 / n
    return -0.25 * total


@compiled
def momentum_small(v: RewardView) -> float:
    total, unit = 0.0, v.scales.momentum
    for a in range(3, 6):
        total += (v.state.momentum[a] / unit) ** 2
    return np.exp(-total)


@compiled
def velocity_small(v: RewardView) -> float:
    velocity, heading, command = v.state.com_vel, v.state.heading, v.command
    x = velocity[0] - heading[0] * command[0] + heading[1] * command[1]
    y = velocity[1] - heading[1] * command[0] - heading[0] * command[1]
    return np.exp(-(x**2 + y**2) / v.scales.velocity**2)


@compiled
def turning_small(v: RewardView) -> float:
    rate, up, unit = v.state.qvel[3:6], v.state.root_axes[2], 0.5 * v.scales.omega
    total = 0.0
    for a in range(3):
        total += (rate[a] - up[a] * v.command[2]) ** 2
    return np.exp(-total / unit**2)


@compiled
def joint_limit_cost(v: RewardView) -> float:
    total, n = 0.0, v.q_ref.shape[0]
    for a in range(n):
        low, high, q = v.robot.q_min[a], v.robot.q_max[a], v.state.qpos[7 + a]
        span = 0.05 * (high - low)
        beyond = max(low + span - q, q - high + span)
        if beyond > 0.0:  # not where there is no limit
            total += min(beyond / span, 1.0) / n
    return -total


@compiled
def slip_cost(v: RewardView) -> float:
    s, total, n = v.state, 0.0, v.state.contacts.shape[0]
    for i in range(n):
        x, y = s.J_v[6 * i] / v.scales.velocity, s.J_v[6 * i + 1] / v.scales.velocity
        total += s.contacts[i] * min(x * x + y * y, 1.0) / n
    return -total


@compiled
def power_cost(v: RewardView) -> float:
    power, torques = 0.0, v.views.ctrl
    for i in range(torques.shape[0]):
        power += abs(torques[i] * v.state.qvel[v.robot.motor_dofs[i]])
    unit = v.scales.weight * v.scales.omega * v.scales.height
    return -power / (power + unit)


@compiled
def command_followed(v: RewardView) -> float:
    x, y, turn = v.velocity_error[0], v.velocity_error[1], v.velocity_error[2]
    way, spin = 0.1 * v.scales.velocity, 0.05 * v.scales.omega
    return np.exp(-(x * x + y * y) / way**2 - (turn / spin) ** 2)


@compiled
def pace_kept(v: RewardView) -> float:
    x, y, near = v.velocity_error[0], v.velocity_error[1], 0.3 * v.scales.velocity
    return np.exp(-(x * x + y * y) / near**2)


@compiled
def risen(v: RewardView) -> float:
    height = v.state.com[2] / v.scales.height  # over level ground, whatever the feet do
    return min(max(height, 0.0), 1.0) * 0.5 * (1.0 + uprightness(v.robot, v.state))


@compiled
def turn_kept(v: RewardView) -> float:
    return np.exp(-((v.velocity_error[2] / (0.1 * v.scales.omega)) ** 2))


@compiled
def fall_cost(v: RewardView) -> float:
    return -1.0


# of a term: it is not earned in the step of a fall; it is paid then too, unless the simulation
# diverged; it is paid then only
NO_FALL, NO_DIVERGENCE, FALL = range(3)


def _term(
    weight: float, kernel: Callable[[RewardView], float], formula: str, when: int = NO_FALL
) -> float:
    """A field of `RewardWeights`; a term that is off by default is left out of files while off."""
    metadata = {"kernel": kernel, "formula": formula, "when": when}
    off = {"omit": "default"} if weight == 0.0 else {}
    return field(default=weight, metadata={**metadata, **off})


@dataclass(frozen=True)
class RewardWeights:
    """Weights of the reward terms; each term is smooth and lies in [0, 1] or [−1, 0]."""

    alive: float = _term(0.5, constant, "1")
    com: float = _term(
        0.2, com_near,
        "exp(−4 e²), e the CoM's distance from the middle of the soles [half support]",
    )  # fmt: skip
    capture: float = _term(0.2, capture_near, "exp(−2 e²), e the capture point's [half support]")
    upright: float = _term(
        0.1, root_upright, "max(cos φ, 0)⁴, φ the tilt of the root from standing"
    )
    quiet: float = _term(
        0.1, com_slow, "exp(−(|ċ| / quiet_speed)² / 4), 0 where the command is to walk"
    )
    posture: float = _term(0.1, posture_near, "exp(−Σ (q − q_ref)²)")
    effort: float = _term(0.02, torque_cost, "−mean (τ / τ_max)²", NO_DIVERGENCE)
    action: float = _term(0.1, action_cost, "−mean a²", NO_DIVERGENCE)
    action_rate: float = _term(0.05, action_change_cost, "−mean (a − a_before)² / 4", NO_DIVERGENCE)
    fall: float = _term(5.0, fall_cost, "−1 in the step of a fall", FALL)
    angular_momentum: float = _term(
        0.0, momentum_small, "exp(−(|L| / 0.1 m h² ω)²), L about the CoM"
    )
    velocity: float = _term(
        0.0,
        velocity_small,
        "exp(−(|ċ_xy − v| / 0.2 ω h)²), of the CoM along the ground; v the command",
    )
    turning: float = _term(
        0.0,
        turning_small,
        "exp(−(|ω_root − ψ̇ e_z| / 0.5 ω)²), angular velocity of the root; ψ̇ the command",
    )
    joint_limits: float = _term(
        0.0, joint_limit_cost,
        "−mean fraction of the last 5 % of a joint's range, at either end", NO_DIVERGENCE,
    )  # fmt: skip
    slip: float = _term(
        0.0, slip_cost,
        "−mean min((ṗ_xy / 0.2 ω h)², 1) of the soles, 0 of swing feet", NO_DIVERGENCE,
    )  # fmt: skip
    tracking: float = _term(
        0.0, command_followed,
        "exp(−(|Δv| / 0.02 ω h)² − (Δψ̇ / 0.05 ω)²), of a walk's mean velocity from its command"
    )  # fmt: skip
    pace: float = _term(
        0.0, pace_kept,
        "exp(−(|Δv| / 0.06 ω h)²), which still tells a walk that is far too slow to go faster"
    )  # fmt: skip
    rise: float = _term(
        0.0, risen, "min(z/h, 1) (1 + cos φ)/2, z the CoM's height over the ground, also after a "
        "fall", NO_DIVERGENCE,
    )  # fmt: skip
    turn_pace: float = _term(0.0, turn_kept, "exp(−(Δψ̇ / 0.1 ω)²), the same of the turning rate")
    power: float = _term(
        0.0, power_cost, "−P / (P + m g ω h), P = Σ |τ q̇| of the motors now", NO_DIVERGENCE
    )


REWARD_TERMS = tuple(RewardWeights.__dataclass_fields__)


def reward_table() -> str:
    """The terms as a Markdown table with their default weights."""
    rows = ["| term | weight | value |", "| --- | --- | --- |"]
    for each in fields(RewardWeights):
        rows.append(f"| {each.name} | {each.default} | {each.metadata['formula']} |")
    return "\n".join(rows)


@dataclass(frozen=True, eq=False)
class Rewards(Block):
    """The reward terms as compiled code reads them."""

    kernels: Program  # a row for each term, free where the weight is 0
    weights: np.ndarray  # (terms,)
    when: np.ndarray  # (terms,) int: `NO_FALL`, `NO_DIVERGENCE` or `FALL`


def rewards(weights: RewardWeights, view: RewardView) -> Rewards:
    """The terms with these `weights`, of what is seen in `view`."""
    terms = fields(weights)
    numbers = np.array([getattr(weights, term.name) for term in terms], dtype=float)
    calls = [
        (term.metadata["kernel"], view) if weight != 0.0 else None
        for term, weight in zip(terms, numbers, strict=True)
    ]
    when = np.array([term.metadata["when"] for term in terms], dtype=np.int64)
    return Rewards(kernels=Program.of(calls), weights=numbers, when=when)


@compiled
def sum_rewards(r: Rewards, fallen: bool, diverged: bool, terms: np.ndarray) -> float:
    """The reward of a policy step, and its weighted `terms` (terms,)."""
    rows = r.kernels.rows
    for i in range(terms.shape[0]):
        counts = not fallen if r.when[i] == NO_FALL else fallen
        if r.when[i] == NO_DIVERGENCE:
            counts = not diverged
        terms[i] = value_of(rows[i, 0], rows[i, 1]) if counts and r.weights[i] != 0.0 else 0.0
    total = 0.0
    for i in range(terms.shape[0]):
        terms[i] *= r.weights[i]
        total += terms[i]
    return total
