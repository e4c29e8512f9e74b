"""Terms of what sensors measure, as late and as noisy as it is: nothing is estimated.

Where nothing errs and nothing is late, they are what the state says.
"""

from dataclasses import dataclass

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.sensing.measurement import Rings, arrived

from .observation import SPACE, Terms, View


@dataclass(frozen=True, eq=False)
class MeasuredView(Block):
    """The block of a term of measurements: what it reads, and the place that it fills."""

    seen: View
    rings: Rings
    late: np.ndarray  # (≥ 1,) int: physics steps by which measurements are late
    ideal: bool  # nothing is measured


MEASURED_TERMS = Terms(view=MeasuredView)  #: by name


@MEASURED_TERMS.add(
    SPACE, "1", "direction of gravity that the IMU tells, its axes", "root vector", default=False
)
def measured_gravity(m: MeasuredView):
    row = arrived(m.rings, m.late[0])
    for a in range(3):
        up = m.seen.state.root_axes[2, a] if m.ideal else m.rings.attitude[row, 2, a]
        m.seen.out[a] = -up


@MEASURED_TERMS.add(SPACE, "ω", "angular velocity that the gyro tells", "root turn", default=False)
def measured_rate(m: MeasuredView):
    row = arrived(m.rings, m.late[0])
    for a in range(3):
        rate = m.seen.state.qvel[3 + a] if m.ideal else m.rings.gyro[row, a]
        m.seen.out[a] = rate / m.seen.scales.omega


@MEASURED_TERMS.add(
    "joints", "rad", "joint position that the encoder tells, minus the reference", "joints",
    default=False,
)  # fmt: skip
def measured_joint_pos(m: MeasuredView):
    v, row = m.seen, arrived(m.rings, m.late[0])
    for j in range(v.out.shape[0]):
        v.out[j] = (v.state.qpos[7 + j] if m.ideal else m.rings.q[row, j]) - v.q_ref[j]


@MEASURED_TERMS.add(
    "joints", "3 ω", "joint velocity that the encoder tells, minus the reference's", "joints",
    default=False,
)  # fmt: skip
def measured_joint_vel(m: MeasuredView):
    v, row = m.seen, arrived(m.rings, m.late[0])
    for j in range(v.out.shape[0]):
        rate = v.state.qvel[6 + j] if m.ideal else m.rings.dq[row, j]
        v.out[j] = (rate - v.v_ref[j]) / (3.0 * v.scales.omega)
