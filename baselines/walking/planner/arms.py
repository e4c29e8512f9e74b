"""Arms that swing against the legs, by as much as a command says.

The arm on the side of foot i is to be turned about the robot's left axis by

    A · (x_i − x_j)/L,

x_i and x_j the places of its foot and of the other one along the heading, L the length of a step:
ahead while its own foot is behind. Only the joints of the robot's roles `shoulder_pitch_left` and
`shoulder_pitch_right` take part.
"""

import numpy as np

from poise.baselines.balance.references.legs import foot_signs
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import along, copy_into
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.robots.description import match_names
from poise.envs.robots.robot import Robot

from .blocks import Arms, WalkTick

ROLES = ("shoulder_pitch_right", "shoulder_pitch_left")  # of foot sign −1, +1
LEAST_STEP = 0.15  # [h] for the whole swing


def has_arms(robot: Robot) -> bool:
    """Whether the robot says which joints swing its arms."""
    return all(role in robot.description.roles for role in ROLES)


def arm_scales(robot: Robot) -> np.ndarray:
    """(2, nj) the turn of each joint for a turn of the arm on the side of each foot; zero where the
    robot does not say which joints swing them."""
    names, scales = list(robot.joint_names), guarded_zeros((2, len(robot.joint_names)))
    if not has_arms(robot):
        return scales
    for foot, sign in enumerate(foot_signs(robot)):
        role = ROLES[int(sign > 0.0)]
        own = match_names(robot.description.roles[role], names, robot.name, f"roles.{role}")
        for joint, scale in own.items():
            scales[foot, names.index(joint)] = scale
    return scales


def swinging_arms(robot: Robot, posture_weight: np.ndarray, weight: float) -> Arms:
    """The arms of a robot; `posture_weight` (nv,) is that of the QP, which `swing_arms` changes,
    and `weight` the one of joints that swing, in 1/ω⁴."""
    scales, swung = arm_scales(robot), posture_weight.copy()
    swung[6:][np.any(scales != 0.0, axis=0)] = weight / robot.units.omega**4
    return Arms.allocate(
        scales=scales, weight=swung, free_weight=posture_weight.copy(),
        least_step=LEAST_STEP * robot.units.height,
    )  # fmt: skip


def largest_swing(robot: Robot) -> float:
    """The largest turn of both arms to either side that the joints' ranges allow [rad]."""
    scales = np.abs(arm_scales(robot)).max(axis=0)
    swing = scales > 0.0
    low, high = robot.joint_range[swing].T
    start = robot.standing_qpos[7:][swing]
    most = np.minimum(high - start, start - low) / scales[swing]
    return float(max(most.min(initial=np.inf), 0.0))


@compiled
def feet_apart(t: WalkTick, order: int) -> float:
    """x_0 − x_1 along the heading [m], as planned while a foot swings, or its derivative of this
    `order` in time."""
    c, w, level = t.walk, t.walk.swing, t.walk.memory.level_frame
    foot, feet = c.memory.foot, c.state.sole_point
    x, y = 0.0, 0.0
    if c.memory.swinging:
        x, y = w.reference[order, 0], w.reference[order, 1]
        if order == 0:
            x, y = x - feet[1 - foot, 0], y - feet[1 - foot, 1]
        if foot == 1:
            x, y = -x, -y
    elif order == 0:
        x, y = feet[0, 0] - feet[1, 0], feet[0, 1] - feet[1, 1]
    ahead, _ = along(level[0, 0], level[1, 0], x, y)
    return ahead


@compiled
def swing_arms(t: WalkTick, period: float) -> None:
    """Add the swing that is commanded to the posture's references; a step takes `period` [s]."""
    arms, own, g = t.arms, t.walk.reference_out, t.gait
    weight, amplitude = t.walk.on_both.posture.weight, g.commanded_arm_swing
    if amplitude <= 0.0:
        if arms.swinging:
            copy_into(arms.free_weight, weight)
            arms.swinging = 0
        return
    if not arms.swinging:
        copy_into(arms.weight, weight)
        arms.swinging = 1
    share = amplitude / max(abs(g.velocity[0]) * period, arms.least_step)
    angle, rate, acceleration = feet_apart(t, 0), feet_apart(t, 1), feet_apart(t, 2)
    angle, rate = share * angle, share * rate
    if abs(angle) > amplitude:
        angle, rate, acceleration = amplitude * np.sign(angle), 0.0, 0.0
    for j in range(own.q_ref.shape[0]):
        scale = arms.scales[0, j] - arms.scales[1, j]
        if scale != 0.0:
            own.q_ref[j] += scale * angle
            own.v_ref[j] += scale * rate
            own.a_ref[j] = scale * share * acceleration
