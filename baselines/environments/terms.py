"""Terms of a controller's motion and steps, in addition to those of `envs.balance.mdp.terms`."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.baselines.balance.references.targets import Motion
from poise.baselines.balance.stepping.controller import Stepping
from poise.baselines.balance.stepping.planning.blocks import StepMemory
from poise.baselines.balance.stepping.planning.swing import Swing
from poise.baselines.balance.stepping.planning.swing import time_left as remaining_time
from poise.envs.balance.mdp.observation import GROUND, SPACE, Terms, View
from poise.envs.balance.mdp.terms import TERMS, put_local
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.mutable import Mutable
from poise.envs.sensing.push_force import PushForce


@dataclass(frozen=True, eq=False)
class MotionView(Block):
    """The block of a term about the motion: what it reads, and the place that it fills."""

    seen: View
    motion: Motion


MOTION_TERMS = Terms(TERMS, MotionView)  #: by name; those of every environment come first


@MOTION_TERMS.add(
    ("sin", "cos", "left"),
    "1",
    "phase of the motion, a turn from begin to end, and the fraction of it that is left",
    "number",
    default=False,
)
def motion_phase(t: MotionView):
    motion, v = t.motion, t.seen
    begin, end = motion.knots[0], motion.knots[-1]
    now = v.clock.steps * v.robot.timestep
    if motion.pace.waits:
        now = motion.pace.time
    over = (now - begin) / (end - begin)
    over = over % 1.0 if motion.loop else min(max(over, 0.0), 1.0)
    v.out[0], v.out[1] = np.sin(2.0 * np.pi * over), np.cos(2.0 * np.pi * over)
    v.out[2] = 1.0 - over


@dataclass(frozen=True, eq=False)
class ForceView(Block):
    """The block of a term about what pushes: what it reads, and the place that it fills."""

    seen: View
    push: PushForce


FORCE_TERMS = Terms(MOTION_TERMS, ForceView)  #: by name; those about the motion come first


@FORCE_TERMS.add(GROUND, "0.1 m g", "estimated force that pushes", "vector", default=False)
def push_force(t: ForceView):
    force, v = t.push.force, t.seen
    put_local(v.state, force[0], force[1], 0.1 * v.scales.weight, v.out)


@FORCE_TERMS.add(
    GROUND, "0.02 m g", "its leaky mean over the last seconds", "vector", default=False
)
def push_mean(t: ForceView):
    mean, v = t.push.mean, t.seen
    put_local(v.state, mean[0], mean[1], 0.02 * v.scales.weight, v.out)


@dataclass(eq=False)
class StepReport(Block):
    """What is observed of a controller's steps, see `Stepping`."""

    steps: Mutable[int]  # begun
    foot: Mutable[int]  # that swings; −1: none
    foothold: Annotated[np.ndarray, 2]  # of that foot [m]
    phase: Mutable[float]  # fraction of its swing that is over
    remaining: Mutable[float]  # [s] until its touchdown
    since: Mutable[float]  # the last touchdown [s]

    def fill(self, steps: Stepping) -> None:
        """Report the steps of a controller that is called from Python."""
        self.steps, self.foot, self.phase = steps.steps, steps.foot, steps.phase
        self.foothold[:] = steps.foothold
        self.remaining, self.since = steps.remaining, steps.since


@dataclass(frozen=True, eq=False)
class StepView(Block):
    """The block of a term about steps: what it reads, and the place that it fills."""

    seen: View
    report: StepReport


@dataclass(frozen=True, eq=False)
class StepReporter(Block):
    """The memory of a compiled controller's steps, and the report that is made of it."""

    memory: StepMemory
    swing: Swing
    report: StepReport


@compiled
def report_steps(t: StepReporter):
    """Fill `report` as `StepReport.fill` does."""
    m, w, r = t.memory, t.swing, t.report
    r.steps, r.foot, r.since = m.steps, -1, m.clock
    r.phase, r.remaining = 0.0, 0.0
    if m.swinging:
        r.foot, r.since = m.foot, 0.0
        r.foothold[0], r.foothold[1] = w.foothold[0], w.foothold[1]
        r.phase, r.remaining = w.time / w.duration, remaining_time(w)


STEP_TERMS = Terms(FORCE_TERMS, StepView)  #: by name; those of every environment come first


@compiled
def put_from_stance(t: StepView, x: float, y: float):
    """The point (x, y) of the ground from the stance sole, heading frame [0.5 h]; 0 without one."""
    v, foot = t.seen, t.report.foot
    v.out[:] = 0.0
    if foot >= 0:
        stance, half = v.state.sole_point[1 - foot], 0.5 * v.scales.height
        put_local(v.state, x - stance[0], y - stance[1], half, v.out)


@STEP_TERMS.add("feet", "1", "1 where the foot swings, else 0", "feet")
def swing(t: StepView):
    for i in range(t.seen.out.shape[0]):
        t.seen.out[i] = 1.0 if t.report.foot == i else 0.0


@STEP_TERMS.add(("fraction",), "1", "fraction of the swing that is over", "number")
def phase(t: StepView):
    t.seen.out[0] = t.report.phase


@STEP_TERMS.add(("t",), "1/ω", "until touchdown is planned", "number")
def time_left(t: StepView):
    t.seen.out[0] = t.seen.scales.omega * t.report.remaining


@STEP_TERMS.add(("t",), "1/ω", "since the last touchdown", "number")
def since(t: StepView):
    t.seen.out[0] = t.seen.scales.omega * t.report.since


@STEP_TERMS.add(("count",), "1", "steps begun", "number")
def steps(t: StepView):
    t.seen.out[0] = t.report.steps


@STEP_TERMS.add(GROUND, "0.5 h", "first sole from the second", "between feet")
def feet(t: StepView):
    s, half = t.seen.state, 0.5 * t.seen.scales.height
    first, second = s.sole_point[0], s.sole_point[1]
    put_local(s, first[0] - second[0], first[1] - second[1], half, t.seen.out)


@STEP_TERMS.add(SPACE, "0.5 h", "swinging sole from the stance sole, 0 if both are down", "vector")
def swing_foot(t: StepView):
    v, foot = t.seen, t.report.foot
    moving = v.state.sole_point[max(foot, 0)]
    put_from_stance(t, moving[0], moving[1])
    if foot >= 0:
        v.out[2] = (moving[2] - v.state.sole_point[1 - foot, 2]) / (0.5 * v.scales.height)


@STEP_TERMS.add(GROUND, "0.5 h", "foothold from the stance sole, 0 if both are down", "vector")
def foothold(t: StepView):
    put_from_stance(t, t.report.foothold[0], t.report.foothold[1])


@STEP_TERMS.add(GROUND, "0.5 h", "ξ from the stance sole, 0 if both are down", "vector")
def stance_capture_point(t: StepView):
    xi = t.seen.state.capture_point
    put_from_stance(t, xi[0], xi[1])
