"""What is known of a walk: its strides as they were, and the terms that tell a policy of it."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.baselines.balance.stepping.planning.blocks import StepMemory
from poise.baselines.walking.planner.blocks import Gait
from poise.baselines.walking.planner.step import step_time
from poise.envs.balance.mdp.observation import GROUND, Terms, View
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import along
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.clock import Clock
from poise.envs.physics.kinematics import StateArrays

from .terms import STEP_TERMS, StepReport


@dataclass(eq=False)
class WalkReport(Block):
    """What is observed of a walk."""

    side: Mutable[int]  # the foot that it stands on next; −1: none
    cycle: Mutable[float]  # phase of the step


@dataclass(eq=False)
class Strides(Block):
    """The last three lift-offs of a walk, and how far the stride between them was off."""

    when: Annotated[np.ndarray, 3]  # times of the lift-offs, the latest first [s]
    where: Annotated[np.ndarray, 3, 3]  # the CoM along the ground [m] and the heading [rad] then
    count: Mutable[int]  # lift-offs since the walk began
    steps: Mutable[int]  # steps begun since the reset, when this was looked at last
    error: Annotated[np.ndarray, 3]  # mean velocity less the command: ahead, left [m/s], turn


@dataclass(frozen=True, eq=False)
class WalkReporter(Block):
    """The block that reports a walk's state and strides."""

    gait: Gait
    memory: StepMemory
    state: StateArrays  # the true one
    clock: Clock
    timestep: float  # [s]
    steps: StepReport
    strides: Strides
    report: WalkReport


@compiled
def keep_lift_off(r: WalkReporter):
    """Put the lift-off that has just been before the two that came last."""
    t, s = r.strides, r.state
    for i in (2, 1):
        t.when[i] = t.when[i - 1]
        for a in range(3):
            t.where[i, a] = t.where[i - 1, a]
    t.when[0] = r.clock.steps * r.timestep
    t.where[0, 0], t.where[0, 1] = s.com[0], s.com[1]
    t.where[0, 2] = np.arctan2(s.heading[1], s.heading[0])
    t.count += 1


@compiled
def measure_stride(r: WalkReporter):
    """The error of the stride, two steps, between the last lift-off and the one before its own."""
    t, g = r.strides, r.gait
    time = t.when[0] - t.when[2]
    x, y = (t.where[0, 0] - t.where[2, 0]) / time, (t.where[0, 1] - t.where[2, 1]) / time
    yaw = g.yaw - 0.5 * time * g.velocity[2]  # of the heading in the middle of the stride
    x, y = along(np.cos(yaw), np.sin(yaw), x, y)
    turned = t.where[0, 2] - t.where[2, 2]
    turned = np.arctan2(np.sin(turned), np.cos(turned))
    t.error[0], t.error[1] = x - g.velocity[0], y - g.velocity[1]
    t.error[2] = turned / time - g.velocity[2]


@compiled
def report_walk(r: WalkReporter):
    """Keep the strides, and fill `report`; `steps` must be up to date.

    Before the first stride the error is 0, and before the first step the command.
    """
    t, g, m = r.strides, r.gait, r.memory
    r.report.side, r.report.cycle = -1, 0.0
    if not g.walking:
        t.count, t.steps = 0, m.steps
        for a in range(3):
            t.error[a] = -g.command[a]
        return
    if m.steps > t.steps:
        t.steps = m.steps
        keep_lift_off(r)
        for a in range(3):
            t.error[a] = 0.0
        if t.count >= 3:
            measure_stride(r)
    if g.starting:
        return
    swinging = m.swinging != 0
    r.report.side = 1 - m.foot if swinging else m.foot
    part = step_time(g) / (step_time(g) + g.transfer_time)
    rest = min(g.clock / g.transfer_time, 1.0)
    r.report.cycle = part * r.steps.phase if swinging else part + (1.0 - part) * rest


@dataclass(frozen=True, eq=False)
class WalkView(Block):
    """The block of a term about walking: what it reads, and the place that it fills."""

    seen: View
    command: np.ndarray  # (8,) see `GaitCommand.array`
    report: WalkReport


WALK_TERMS = Terms(STEP_TERMS, WalkView)  #: by name; those of every environment that steps first


@WALK_TERMS.add(GROUND, "0.2 ω h", "commanded velocity, ahead and to the left", "vector")
def command_velocity(t: WalkView):
    seen = t.seen
    for a in range(2):
        seen.out[a] = t.command[a] / seen.scales.velocity


@WALK_TERMS.add(("z",), "0.2 ω", "commanded turning rate, to the left", "turn")
def command_turn(t: WalkView):
    seen = t.seen
    seen.out[0] = t.command[2] / (0.2 * seen.scales.omega)


@WALK_TERMS.add(("sin", "cos"), "1", "phase of the step, 0 at its lift-off; 0, 0: none", "number")
def gait_phase(t: WalkView):
    seen, angle = t.seen, 2.0 * np.pi * t.report.cycle
    walks = 1.0 if t.report.side >= 0 else 0.0
    seen.out[0], seen.out[1] = walks * np.sin(angle), walks * np.cos(angle)


@WALK_TERMS.add("feet", "1", "1 where the foot bears the robot, or is about to, else 0", "feet")
def stance(t: WalkView):
    out = t.seen.out
    for i in range(out.shape[0]):
        out[i] = 1.0 if t.report.side == i else 0.0
