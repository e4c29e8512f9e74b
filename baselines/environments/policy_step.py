"""One policy step of a controller and the physics, compiled."""

from dataclasses import dataclass

import numpy as np

from poise.baselines.balance.references.targets import Motion, Offsets, update_targets
from poise.baselines.balance.references.tempo import motion_time_of
from poise.baselines.controller import Outputs, TargetArrays
from poise.envs.balance.episode import (
    EpisodeArrays,
    StepEnd,
    end_step,
    record_tick,
)
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Erased, Kernel, Program, call, run
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.clock import Clock
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.motor_bus import ask_servo
from poise.envs.physics.simulation import World, simulate
from poise.envs.sensing.push_force import PushForce, observe_push


@compiled
def soft_root_force(s: StateArrays, wrench: np.ndarray, qfrc_applied: np.ndarray):
    """Apply a wrench about the CoM (world axes) on the root's six generalised forces."""
    rx = s.com[0] - s.qpos[0]
    ry = s.com[1] - s.qpos[1]
    rz = s.com[2] - s.qpos[2]
    nx = wrench[3] + ry * wrench[2] - rz * wrench[1]
    ny = wrench[4] + rz * wrench[0] - rx * wrench[2]
    nz = wrench[5] + rx * wrench[1] - ry * wrench[0]
    for a in range(3):
        qfrc_applied[a] = wrench[a]
        qfrc_applied[3 + a] = (
            s.root_axes[0, a] * nx + s.root_axes[1, a] * ny + s.root_axes[2, a] * nz
        )


@dataclass(frozen=True, eq=False)
class Residual(Block):
    """The law by which an action becomes offsets of the controller's targets."""

    moved: np.ndarray  # (na,) int: the offset that each entry of the action moves
    scale: np.ndarray  # (na,) the offset that it moves by 1
    blend: float  # of the way that a policy step goes from the last action to the next
    gate: float  # [m] see `gate_opening`
    offsets: Offsets  # of which it moves a part
    torque_scale: np.ndarray  # (nu,) [N·m] what the last nu entries add by 1; (0,): they do not
    torques: np.ndarray  # (nu,) [N·m] that they add


@compiled
def capture_error(s: StateArrays, motion: Motion, com_offset: float) -> float:
    """d², d the capture point's distance from that of the reference [m]."""
    nj = motion.samples.shape[1] - 6
    x = motion.samples[0, nj] + com_offset + motion.samples[1, nj] / s.omega
    y = motion.samples[0, nj + 1] + motion.samples[1, nj + 1] / s.omega
    cos, sin = s.heading[0], s.heading[1]
    dx = s.capture_point[0] - s.origin[0] - (cos * x - sin * y)
    dy = s.capture_point[1] - s.origin[1] - (sin * x + cos * y)
    return dx * dx + dy * dy


@compiled
def gate_opening(r: Residual, s: StateArrays, motion: Motion, com_offset: float) -> float:
    """1 − exp(−(d/gate)²), d the capture point's distance from that of the reference [m]."""
    if r.gate == 0.0:
        return 1.0
    return -np.expm1(-capture_error(s, motion, com_offset) / (r.gate * r.gate))


@compiled
def set_offsets(r: Residual, s: StateArrays, motion: Motion, com_offset: float, e: EpisodeArrays):
    """Offsets from the episode's action, which is smoothed first."""
    opened = gate_opening(r, s, motion, com_offset)
    first, motors = r.moved.shape[0], r.torque_scale.shape[0]
    if r.blend < 1.0:
        for a in range(first + motors):
            e.action[a] = e.last_action[a] + r.blend * (e.action[a] - e.last_action[a])
    for a in range(first):
        r.offsets.values[r.moved[a]] = opened * r.scale[a] * e.action[a]
    for i in range(motors):
        r.torques[i] = opened * r.torque_scale[i] * e.action[first + i]


@compiled
def add_torques(r: Residual, limit: np.ndarray, ctrl: np.ndarray):
    """Add the action's torques to `ctrl` (nu,), within ± `limit` (nu,) [N·m]."""
    for i in range(r.torque_scale.shape[0]):
        ctrl[i] = min(max(ctrl[i] + r.torques[i], -limit[i]), limit[i])


@dataclass(frozen=True, eq=False)
class TargetInputs(Block):
    """The inputs of `set_targets`; the state is the estimate."""

    robot: RobotArrays
    state: StateArrays
    clock: Clock
    motion: Motion
    com_offset: float  # [m]
    residual: Residual
    push: PushForce  # the force that is estimated where a term of the observation asks for it
    observes_push: bool
    period: float  # of the controller [s]
    targets: TargetArrays


@compiled
def set_targets(a: TargetInputs):
    """Targets of this tick."""
    if a.observes_push:
        observe_push(a.push, a.robot, a.state, a.period)
    now, motion = a.clock.steps * a.robot.timestep, a.motion
    time = motion_time_of(motion.pace, a.state, a.targets.com, motion.knots[0], now)
    update_targets(a.robot, a.state, motion, time, a.com_offset, a.residual.offsets, a.targets)


@dataclass(frozen=True, eq=False)
class PolicyStep(Block):
    """All that a policy step works on."""

    inputs: TargetInputs
    kernel: Kernel[Erased]  # the controller's tick
    tick: Erased  # that it works on
    outputs: Outputs  # what that finds
    # (nv,) where the state source reads promised accelerations; (0,): it does not
    promise: np.ndarray
    world: World
    estimate: Program  # of the state source
    ticks: int
    substeps: int  # physics steps of each
    episode: EpisodeArrays
    end: StepEnd


@compiled
def promise_motion(step: PolicyStep):
    """Tell the state source which accelerations the controller's torques are to bring."""
    vdot = step.outputs.vdot
    if step.promise.shape[0] == vdot.shape[0]:
        copy_into(vdot, step.promise)


@compiled
def ask_motors(step: PolicyStep):
    """Where the motors are real, let them run the controller's servos, if it has any."""
    bus, world, o = step.world.bus, step.world, step.outputs
    bus.servoed = 0
    if bus.q.shape[0] > 0 and o.target.shape[0] > 0:
        for i in range(world.views.ctrl.shape[0]):
            j = world.robot.motor_dofs[i] - 6
            rest = world.views.ctrl[i] - o.tau[j]
            ask_servo(bus, i, rest, o.target[j], o.stiffness[j], o.damping[j])


@compiled
def policy_tick(step: PolicyStep):
    """The controller, held for `substeps` physics steps; `ticks` calls are a policy step."""
    a, world, e, o = step.inputs, step.world, step.episode, step.outputs
    robot, views, s = world.robot, world.views, world.state
    if e.ticks == 0:
        set_offsets(a.residual, a.state, a.motion, a.com_offset, e)
    set_targets(a)
    call(step.kernel, step.tick)
    promise_motion(step)
    for i in range(views.ctrl.shape[0]):
        views.ctrl[i] = o.tau[robot.motor_dofs[i] - 6]
    add_torques(a.residual, robot.torque_limit, views.ctrl)
    ask_motors(step)
    if o.soft_root:
        m, w = e.metrics, o.root_wrench
        soft_root_force(s, w, views.qfrc_applied)
        m.root_force = max(m.root_force, np.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2))
        m.root_moment = max(m.root_moment, np.sqrt(w[3] ** 2 + w[4] ** 2 + w[5] ** 2))
    record_tick(robot, s.qvel, views.ctrl, step.substeps * robot.timestep, e)
    simulate(world, step.substeps)
    run(step.estimate)
    end_tick(step)


@compiled
def end_tick(step: PolicyStep):
    """Count the tick; the last one ends the policy step."""
    e = step.episode
    e.ticks += 1
    if e.ticks < step.ticks:
        return
    e.ticks = 0
    copy_into(step.outputs.root_wrench, e.root_wrench)
    e.metrics.failures = step.outputs.failures
    end_step(step.end)
