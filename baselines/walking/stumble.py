"""A swing foot that meets something before it may land: it rises before it goes on.

Toes that stand before an unseen edge would be pushed against it while the CoM goes on, which trips
the robot.
"""

from poise.baselines.stepping.swing import LANDING
from poise.envs.compiled.jit import compiled

from .blocks import WalkTick

LEFT = 0.2  # fraction of a swing after which the foot has left the ground


@compiled
def wait_at_edge(t: WalkTick) -> None:
    """Keep the swing's reference where a foot that touches something is, along the ground; its way
    up goes on, and the way to the foothold from there when it is free."""
    w, foot = t.walk.swing, t.walk.memory.foot[0]
    early = LEFT * w.duration[0] < w.time[0] < LANDING * w.duration[0]
    if not early or t.walk.state.contacts[foot] <= 0.5:
        return
    for a in range(2):
        w.reference[0, a] = t.walk.state.sole_point[foot, a]
        w.reference[1, a] = w.reference[2, a] = 0.0
