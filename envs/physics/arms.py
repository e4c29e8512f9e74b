"""Arms moved by external commands: what a controller commands of them is ignored."""

from dataclasses import dataclass
from itertools import chain
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.easing import eased
from poise.envs.compiled.maths.noise import uniform
from poise.envs.compiled.mutable import Mutable
from poise.envs.robots.description import match_names
from poise.envs.robots.models.tree import lineage
from poise.envs.robots.robot import Robot

from .arrays import RobotArrays, SimViews
from .simulation import Simulation

ROLES = ("shoulder_pitch_left", "shoulder_pitch_right")
RATE = 15.0  # [rad/s] natural frequency of the servos that move the arms
PERIOD = 1.0  # [s] from one posture of the arms to the next


@dataclass(frozen=True)
class Arm:
    """The joints (of robot.joint_names) from a shoulder on, and the body of the last one."""

    joints: tuple[int, ...]
    hand: int


def find_arms(robot: Robot) -> tuple[Arm, ...]:
    """The left and the right arm: all that the body with a role's first joint carries.

    None for a robot whose description does not say which joints pitch its shoulders.
    """
    model, roles, names = robot.model, robot.description.roles, list(robot.joint_names)
    if not all(role in roles for role in ROLES):
        return ()
    arms = []
    for role in ROLES:
        said = match_names(roles[role], names, robot.name, f"roles.{role}")
        shoulder = int(model.joint(min(said, key=names.index)).bodyid[0])
        lines = {j: lineage(model, int(model.jnt_bodyid[j])) for j in range(1, model.njnt)}
        joints = [joint for joint, line in lines.items() if shoulder in line]
        deep = max(joints, key=lambda joint: len(lines[joint]))
        arms.append(Arm(tuple(j - 1 for j in joints), int(model.jnt_bodyid[deep])))
    return tuple(arms)


@dataclass(eq=False)
class MovedArms(Block):
    """Externally commanded servos on the motors of both arms (n)."""

    robot: RobotArrays
    views: SimViews
    motors: np.ndarray  # (n,) int: of the arms
    moved: Mutable[int]  # 1 where external commands move them
    step: Mutable[int]  # physics steps since the reset
    period: int  # physics steps from one posture to the next
    seed: Annotated[np.ndarray, 1, np.uint64]  # see `uniform`
    stand: np.ndarray  # (n,) standing posture [rad]
    reach: np.ndarray  # (n, 2) the way from there to the joint's limits [rad]
    part: Mutable[float]  # of that way
    last: Annotated[np.ndarray, "n"]  # posture that is left [rad]
    goal: Annotated[np.ndarray, "n"]  # posture that is next [rad]
    inertia: np.ndarray  # (n,) of each joint, standing [kg·m²]


def allocate_arms(simulation: Simulation, known: Simulation) -> MovedArms:
    """Return the arms of the `known` robot, standing, not yet moved by external commands."""
    robot = known.robot
    joints = set(chain.from_iterable(arm.joints for arm in find_arms(robot)))
    motors = [i for i, dof in enumerate(robot.motor_dofs) if dof - 6 in joints]
    dofs = robot.motor_dofs[motors]
    stand = robot.standing_qpos[dofs + 1]
    span = robot.joint_range[dofs - 6] - stand[:, None]
    return MovedArms.allocate(
        {"n": len(motors)},
        robot=simulation.arrays,
        views=simulation.views,
        motors=np.array(motors, dtype=np.int64),
        period=round(PERIOD / simulation.arrays.timestep),
        stand=stand,
        reach=np.clip(span, -np.pi, np.pi),
        inertia=np.diag(known.state.M)[dofs],
    )


def begin_arms(a: MovedArms, part: float, seed: int) -> None:
    """Start an episode from the standing posture; without external commands `part` is 0."""
    a.part, a.moved, a.step = part, int(part > 0.0), 0
    a.seed[0], a.goal[:] = seed, a.stand


@compiled
def move_arms(a: MovedArms):
    """Replace the torques of the arms' motors by those of the external servos.

    Once a period a posture is drawn within `part` of the way to each joint's limits, and reached
    with the least jerk: τ = I ω² (q* − q) − 2 I ω q̇, within the motor's limit. `views.ctrl` stays
    what the controller asks for.
    """
    if not a.moved:
        return
    within = a.step % a.period
    a.step += 1
    for k in range(a.motors.shape[0]):
        if within == 0:
            a.last[k] = a.goal[k]
            way = a.reach[k, 0] + uniform(a.seed) * (a.reach[k, 1] - a.reach[k, 0])
            a.goal[k] = a.stand[k] + a.part * way
        i = a.motors[k]
        dof, most = a.robot.motor_dofs[i], a.robot.torque_limit[i]
        target = a.last[k] + (a.goal[k] - a.last[k]) * eased(within / a.period)
        torque = RATE * RATE * (target - a.views.qpos[dof + 1]) - 2.0 * RATE * a.views.qvel[dof]
        torque = min(max(a.inertia[k] * torque, -most), most)
        a.views.qfrc_applied[dof] = torque - a.views.ctrl[i]
