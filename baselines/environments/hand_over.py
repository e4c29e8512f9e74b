"""The hand-over from a controller to joint servos and back, see `ResidualWholeEnv`."""

from dataclasses import dataclass, field

import numpy as np

from poise.envs.balance.episode import record_tick
from poise.envs.balance.mdp.termination import uprightness
from poise.envs.balance.servos import Servos, aim, hand_to_motors, servo_torque
from poise.envs.compiled.block import Block
from poise.envs.compiled.callbacks import CallbackAddress, call_back
from poise.envs.compiled.calls import call, run
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.kinematics import update_state
from poise.envs.physics.simulation import physics_step
from poise.envs.sensing.realism import Realism

from .policy_step import (
    PolicyStep,
    capture_error,
    end_tick,
    policy_tick,
    promise_motion,
    set_offsets,
    set_targets,
)

MISPLACED = 0.02  # [rad] by which joints and tilt together may be biased, see `uncertain`


@dataclass(frozen=True)
class HandOverConfig:
    """The conditions on which the servos may take over, and on which the controller takes back.

    The servos may take over from the moment when the capture point is `opens` from the reference's.
    They may no longer when the robot was calm for `calm_time`: the capture point nearer than
    `closes`, both feet on the ground, the root's tilt below `tilt`, the CoM slower than `speed` and
    all joints together than `joint_speed` (root mean square).

    Attributes:
        opens: Distance of the capture point from its reference from which servos may take over [m].
        closes: Distance of the capture point below which the robot counts as calm [m].
        tilt: Tilt of the root below which it counts as calm [rad].
        speed: Speed of the CoM below which it counts as calm [m/s].
        joint_speed: Speed of all joints together, root mean square, below which it counts as calm
            [rad/s].
        calm_time: Time for which it must be calm before the controller takes back [s].
        uncertain: Distance that replaces `opens` and `closes` where joints and tilt together may
            be biased by 0.02 rad or more, or external commands move the arms [m]; None: it is not
            replaced.
    """

    opens: float = field(default=0.06, metadata={"above": 0.0})
    closes: float = field(default=0.04, metadata={"above": 0.0})
    tilt: float = field(default=0.2, metadata={"above": 0.0})
    speed: float = field(default=0.1, metadata={"above": 0.0})
    joint_speed: float = field(default=0.4, metadata={"above": 0.0})
    calm_time: float = field(default=0.2, metadata={"above": 0.0})
    uncertain: float | None = field(default=None, metadata={"above": 0.0, "omit": "default"})

    def __post_init__(self) -> None:
        if self.closes > self.opens:
            raise ValueError(f"closes: {self.closes} m is above opens, {self.opens} m")

    def distances(self, level: Realism) -> tuple[float, float]:
        """Return the distances that open and close [m] at a realism level."""
        moved = bool(np.any(level.motors.arms))
        if self.uncertain is not None and (moved or level.misplaced >= MISPLACED):
            return self.uncertain, self.uncertain
        return self.opens, self.closes


@dataclass(eq=False)
class HandOverMemory(Block):
    """The state of the hand-over in the running episode."""

    open: Mutable[int]  # 1 while servos may take over
    calm: Mutable[float]  # calm policy steps in a row
    authority: Mutable[float]  # w, the fraction of the torques that is the servos'
    took: Mutable[int]  # 1 once they have taken over, until the controller restarts
    opens: Mutable[float]  # squares of the distances that open and close [m²]
    closes: Mutable[float]


@dataclass(frozen=True, eq=False)
class HandOver(Block):
    """The limits of `HandOverConfig`, and the state."""

    cos_tilt: float
    speed: float  # squared [m²/s²]
    joint_speed: float  # mean square [rad²/s²]
    calm_steps: float  # policy steps
    memory: HandOverMemory
    begin: CallbackAddress  # begins a new trial of the controller


@dataclass(frozen=True, eq=False)
class WholeStep(Block):
    """All that a policy step works on."""

    base: PolicyStep  # the controller's
    servos: Servos
    hand: HandOver


@compiled
def is_calm(h: HandOver, step: PolicyStep, distance: float) -> bool:
    """Return whether the robot is calm now.

    `distance` [m²] is the square of the capture point's distance from the reference's.
    """
    s = step.inputs.state
    if distance > h.memory.closes or uprightness(step.inputs.robot, s) < h.cos_tilt:
        return False
    for i in range(s.contacts.shape[0]):
        if not s.contacts[i]:
            return False
    speed, total, nj = 0.0, 0.0, s.qvel.shape[0] - 6
    for a in range(3):
        speed += s.com_vel[a] ** 2
    for j in range(nj):
        total += s.qvel[6 + j] ** 2 / nj
    return speed < h.speed and total < h.joint_speed


@compiled
def set_authority(h: HandOver, step: PolicyStep):
    """Set w, the fraction of the torques that is the servos', at the start of a policy step."""
    a, m, action = step.inputs, h.memory, step.episode.action
    distance = capture_error(a.state, a.motion, a.com_offset)
    m.calm = m.calm + 1.0 if is_calm(h, step, distance) else 0.0
    if distance > m.opens:
        m.open = 1
    elif m.calm >= h.calm_steps:
        m.open = 0
    wanted = 2.0 * action[action.shape[0] - 1]
    m.authority = m.open * min(max(wanted, 0.0), 1.0)
    if m.authority > 0.0:
        m.took = 1
    elif m.took:
        m.took = 0
        call_back(h.begin)


@compiled
def blend_torques(step: WholeStep):
    """`views.ctrl`: (1 − w) times the controller's torques, `outputs.tau`, and w the servos'."""
    base, servos, w = step.base, step.servos, step.hand.memory.authority
    views, tau = base.world.views, base.outputs.tau
    for i in range(views.ctrl.shape[0]):
        views.ctrl[i] = w * servo_torque(servos, base.world, i)
        if w < 1.0:
            views.ctrl[i] += (1.0 - w) * tau[servos.dofs[i] - 6]
    hand_to_motors(servos, base.world, w, tau)


@compiled
def whole_tick(step: WholeStep):
    """The control tick of `policy_tick`, with the servos' authority w over the torques."""
    if step.base.episode.ticks == 0:
        set_authority(step.hand, step.base)
    shared_tick(step)


@compiled
def shared_tick(step: WholeStep):
    """A control tick with the authority that is set."""
    base, hand, e = step.base, step.hand, step.base.episode
    if e.ticks == 0:
        first = base.inputs.residual.moved.shape[0]
        aim(step.servos, e.action[first:-1])
    if hand.memory.authority == 0.0:
        policy_tick(base)
        return
    a, world = base.inputs, base.world
    if e.ticks == 0:
        set_offsets(a.residual, a.state, a.motion, a.com_offset, e)
    if hand.memory.authority < 1.0:
        set_targets(a)
        call(base.kernel, base.tick)
        promise_motion(base)
    for _ in range(base.substeps):
        blend_torques(step)
        record_tick(world.robot, world.views.qvel, world.views.ctrl, world.robot.timestep, e)
        physics_step(world)
    update_state(world.robot, world.views, world.state)
    run(base.estimate)
    end_tick(base)
