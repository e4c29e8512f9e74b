"""The term that tells of the motion that is performed, besides `envs.balance.mdp.terms`."""

from dataclasses import dataclass

import numpy as np

from poise.baselines.balance.references.targets import Motion
from poise.baselines.balance.references.tempo import TIME
from poise.envs.balance.mdp.observation import Terms, View
from poise.envs.balance.mdp.terms import TERMS
from poise.envs.compiled.block import Block


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
    now = v.clock[0] * v.robot.timestep
    if motion.pace.waits:
        now = motion.pace.memory[TIME]
    over = (now - begin) / (end - begin)
    over = over % 1.0 if motion.loop else min(max(over, 0.0), 1.0)
    v.out[0], v.out[1] = np.sin(2.0 * np.pi * over), np.cos(2.0 * np.pi * over)
    v.out[2] = 1.0 - over
