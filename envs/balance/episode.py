"""What is recorded during an episode: fall, quiet time, effort, excursions; and the reward."""

from dataclasses import dataclass, field

import mujoco
import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import apart
from poise.envs.maths.vectors import along
from poise.envs.physics.arrays import Plant, RobotArrays
from poise.envs.physics.kinematics import StateArrays, support_distance, update_support

from .observation import Scales


@dataclass(frozen=True)
class FallLimits:
    """When a robot has fallen, and when it is upright and quiet again."""

    height: float = field(default=0.6, metadata={"above": 0.0, "max": 1.0})  # of the standing h
    # root [deg]: a deep bow, the hip strategy at its end, is not yet a fall
    tilt: float = field(default=90.0, metadata={"above": 0.0, "max": 180.0})
    ground_contact: bool = True  # anything but the feet on the ground is a fall
    quiet_speed: float = field(default=0.1, metadata={"above": 0.0})  # CoM [m/s]
    quiet_tilt: float = field(default=30.0, metadata={"above": 0.0, "max": 90.0})  # root [deg]
    quiet_time: float = field(default=1.0, metadata={"above": 0.0})  # [s]


@dataclass(frozen=True)
class RewardWeights:
    """Weights of the reward terms; each term is smooth and lies in [0, 1] or [−1, 0]."""

    alive: float = 0.5
    com: float = 0.2
    capture: float = 0.2
    upright: float = 0.1
    quiet: float = 0.1
    posture: float = 0.1
    effort: float = 0.02
    action: float = 0.1
    action_rate: float = 0.05
    fall: float = 5.0


REWARD_TERMS = tuple(RewardWeights.__dataclass_fields__)

(
    QUIET_STEPS,  # policy steps in a row that were quiet
    FALLEN,  # 1 after a fall
    ENERGY,  # ∫ Σ |τ q̇| dt [J]
    PEAK_TORQUE,  # largest |τ|/τ_max
    SATURATED,  # sum over ticks of the share of motors at their limit
    TICKS,  # control ticks
    MAX_COM,  # largest distance of the CoM from the middle of the soles [m]
    MAX_CAPTURE,  # the same of the capture point [m]
    MIN_COP_MARGIN,  # smallest distance of the CoP from the edge of the support [m]
    MAX_SLIDE,  # largest distance of a sole from where it started [m]
    ROOT_FORCE,  # largest force of a soft root [N]
    ROOT_MOMENT,  # largest moment of a soft root [N·m]
    LAST_MOVING,  # time of the last policy step that was not quiet [s]
    FAILURES,  # control ticks at which the controller's solver failed
) = range(14)
METRICS = 14


@dataclass(frozen=True, eq=False)
class EpisodeArrays(Block):
    """What compiled steps write about the running episode."""

    action: np.ndarray  # (na,)
    last_action: np.ndarray  # (na,)
    observation: np.ndarray  # (no,)
    reward: np.ndarray  # (1,) of the last policy step
    reward_terms: np.ndarray  # (terms,) weighted; their sum is the reward
    metrics: np.ndarray  # (METRICS,)
    root_wrench: np.ndarray  # (6,) of a soft root in the last tick [N, N·m]
    sole_start: np.ndarray  # (nc, 2)
    steps: np.ndarray  # (1,) int: policy steps since the reset
    running: np.ndarray  # (1,) int: whether there may be another one
    ticks: np.ndarray  # (1,) int: control ticks of the running policy step


@dataclass(frozen=True, eq=False)
class Judge(Block):
    """Limits and weights as compiled code reads them."""

    height: float  # [m]
    cos_tilt: float
    ground_contact: bool
    quiet_speed: float
    quiet_cos_tilt: float
    max_steps: int  # of an episode
    weights: np.ndarray  # (terms,)


def judge(limits: FallLimits, weights: RewardWeights, height_com: float, max_steps: int) -> Judge:
    """Numbers for compiled code."""
    return Judge(
        height=limits.height * height_com,
        cos_tilt=float(np.cos(np.radians(limits.tilt))),
        ground_contact=limits.ground_contact,
        quiet_speed=limits.quiet_speed,
        quiet_cos_tilt=float(np.cos(np.radians(limits.quiet_tilt))),
        max_steps=max_steps,
        weights=np.array([getattr(weights, name) for name in REWARD_TERMS], dtype=float),
    )


def allocate_episode(actions: int, observations: int, nc: int) -> EpisodeArrays:
    """Zeroed storage."""
    return EpisodeArrays(
        action=apart(actions),
        last_action=apart(actions),
        observation=apart(observations),
        reward=apart(1),
        reward_terms=apart(len(REWARD_TERMS)),
        metrics=apart(METRICS),
        root_wrench=apart(6),
        sole_start=apart((nc, 2)),
        steps=apart(1, dtype=np.int64),
        running=apart(1, dtype=np.int64),
        ticks=apart(1, dtype=np.int64),
    )


@compiled
def begin_episode(s: StateArrays, e: EpisodeArrays):
    """Clear the record; feet are where they should stay."""
    e.action[:] = 0.0
    e.last_action[:] = 0.0
    e.reward[0] = 0.0
    e.reward_terms[:] = 0.0
    e.metrics[:] = 0.0
    e.root_wrench[:] = 0.0
    e.metrics[MIN_COP_MARGIN] = np.inf
    e.steps[0], e.running[0], e.ticks[0] = 0, 1, 0
    for i in range(s.sole_point.shape[0]):
        e.sole_start[i, 0], e.sole_start[i, 1] = s.sole_point[i, 0], s.sole_point[i, 1]


@compiled
def record_tick(
    robot: RobotArrays, s: StateArrays, tau: np.ndarray, period: float, e: EpisodeArrays
):
    """Account for one control tick with motor torques `tau` (nu,)."""
    m = e.metrics
    power, saturated = 0.0, 0.0
    for i in range(tau.shape[0]):
        power += abs(tau[i] * s.qvel[robot.motor_dofs[i]])
        load = abs(tau[i]) / robot.torque_limit[i]
        m[PEAK_TORQUE] = max(m[PEAK_TORQUE], load)
        saturated += 1.0 if load > 0.999 else 0.0
    m[ENERGY] += power * period
    m[SATURATED] += saturated / tau.shape[0]
    m[TICKS] += 1.0


@compiled
def uprightness(robot: RobotArrays, s: StateArrays) -> float:
    """Cosine of the root's tilt from standing: between its vertical axes, whatever the yaw."""
    upright = 0.0
    for a in range(3):
        upright += s.root_axes[2, a] * robot.root_standing[2, a]
    return upright


@compiled
def has_fallen(robot: RobotArrays, s: StateArrays, j: Judge) -> bool:
    """CoM too low, root tilted too far, or more than the feet on the ground."""
    low = s.com[2] - s.origin[2] < j.height
    touching = j.ground_contact and s.other_contacts[0] > 0.5
    # not np.isfinite(x + y): x + y − (x + y), reordered, is 0 for NaN too
    finite = abs(s.com[2]) < np.inf and abs(s.com_vel[2]) < np.inf
    return low or uprightness(robot, s) < j.cos_tilt or touching or not finite


BAD_STATE = tuple(
    2 * int(getattr(mujoco.mjtWarning, f"mjWARN_BAD{name}")) for name in ("QPOS", "QVEL", "QACC")
)


@compiled
def has_diverged(plant: Plant) -> bool:
    """Whether numbers became too large since the reset; MuJoCo then starts anew by itself."""
    for i in BAD_STATE:
        if plant.warnings[i] > 0:
            return True
    return False


@compiled
def judge_step(
    robot: RobotArrays,
    plant: Plant,
    s: StateArrays,
    scale: Scales,
    j: Judge,
    q_ref: np.ndarray,
    tau: np.ndarray,
    time: float,
    e: EpisodeArrays,
):
    """Metrics and reward of one policy step that ended at `time`, and whether it was the last."""
    m = e.metrics
    update_support(robot, s)
    diverged = has_diverged(plant)
    fallen = diverged or has_fallen(robot, s, j)
    m[FALLEN] = 1.0 if fallen else 0.0
    com_x, com_y = s.com[0] - s.origin[0], s.com[1] - s.origin[1]
    xi_x, xi_y = s.capture_point[0] - s.origin[0], s.capture_point[1] - s.origin[1]
    speed = np.sqrt(s.com_vel[0] ** 2 + s.com_vel[1] ** 2 + s.com_vel[2] ** 2)
    upright = uprightness(robot, s)
    quiet = not fallen and speed < j.quiet_speed and upright > j.quiet_cos_tilt
    quiet = quiet and support_distance(s, s.com[0], s.com[1]) > 0.0
    m[QUIET_STEPS] = m[QUIET_STEPS] + 1.0 if quiet else 0.0
    if not quiet:
        m[LAST_MOVING] = time
    m[MAX_COM] = max(m[MAX_COM], np.sqrt(com_x * com_x + com_y * com_y))
    m[MAX_CAPTURE] = max(m[MAX_CAPTURE], np.sqrt(xi_x * xi_x + xi_y * xi_y))
    m[MIN_COP_MARGIN] = min(m[MIN_COP_MARGIN], support_distance(s, s.cop[0], s.cop[1]))
    for i in range(e.sole_start.shape[0]):
        dx = s.sole_point[i, 0] - e.sole_start[i, 0]
        dy = s.sole_point[i, 1] - e.sole_start[i, 1]
        m[MAX_SLIDE] = max(m[MAX_SLIDE], np.sqrt(dx * dx + dy * dy))

    cos, sin = s.heading[0], s.heading[1]
    posture = 0.0
    for a in range(q_ref.shape[0]):
        posture += (s.qpos[7 + a] - q_ref[a]) ** 2
    effort, action, action_rate = 0.0, 0.0, 0.0
    for i in range(tau.shape[0]):
        effort += (tau[i] / robot.torque_limit[i]) ** 2 / tau.shape[0]
    for a in range(e.action.shape[0]):
        action += e.action[a] ** 2 / e.action.shape[0]
        action_rate += (e.action[a] - e.last_action[a]) ** 2 / e.action.shape[0]
    x, y = along(cos, sin, com_x, com_y)
    x, y = x / scale.support_x, y / scale.support_y
    com_error = x * x + y * y
    x, y = along(cos, sin, xi_x, xi_y)
    x, y = x / scale.support_x, y / scale.support_y
    capture_error = x * x + y * y
    terms = e.reward_terms
    terms[0] = 1.0
    terms[1] = np.exp(-4.0 * com_error)
    terms[2] = np.exp(-2.0 * capture_error)
    terms[3] = max(upright, 0.0) ** 4
    terms[4] = np.exp(-((speed / j.quiet_speed) ** 2) / 4.0)
    terms[5] = np.exp(-posture)
    terms[6] = -effort
    terms[7] = -action
    terms[8] = -0.25 * action_rate
    terms[9] = -1.0 if fallen else 0.0
    if fallen:
        for i in range(9 if diverged else 6):
            terms[i] = 0.0
    total = 0.0
    for i in range(terms.shape[0]):
        terms[i] *= j.weights[i]
        total += terms[i]
    e.reward[0] = total
    e.steps[0] += 1
    e.running[0] = not fallen and e.steps[0] < j.max_steps
