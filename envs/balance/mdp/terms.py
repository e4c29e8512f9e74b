"""The terms that every environment can observe: all that there is to say of one stands here.

A new term is one more function in this file, with its entries, unit, meaning and image. An
environment has it if `observation` in its configuration names it. All that a term may read are
the fields of `View`, or of `MeasuredView`; frames are as in docs/notation.md.
"""

from dataclasses import dataclass

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import along
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.pushes.table import HALF_SINE, PUSH
from poise.envs.sensing.measurement import Rings, arrived

from .observation import GROUND, SPACE, Terms, View

TERMS = Terms()  #: by name


@compiled
def put_local(s: StateArrays, x: float, y: float, unit: float, out: np.ndarray):
    """A horizontal vector (x, y) along the heading frame's axes, over `unit`, into `out` (≥ 2,)."""
    forward, left = along(s.heading[0], s.heading[1], x, y)
    out[0], out[1] = forward / unit, left / unit


@compiled
def put_relative(v: View, point: np.ndarray):
    """A point of the ground from the middle of the soles, in half supports."""
    s = v.state
    x, y = point[0] - s.origin[0], point[1] - s.origin[1]
    x, y = along(s.heading[0], s.heading[1], x, y)
    v.out[0], v.out[1] = x * v.scales.per_support_x, y * v.scales.per_support_y


@TERMS.add(GROUND, "half support", "CoM from the middle of the soles", "vector")
def com(v: View):
    put_relative(v, v.state.com)


@TERMS.add(("z",), "0.1 h", "CoM height minus its standing value", "vector")
def com_height(v: View):
    height = v.scales.height
    v.out[0] = (v.state.com[2] - v.state.origin[2] - height) / (0.1 * height)


@TERMS.add(GROUND, "half support", "ξ from the middle of the soles", "vector")
def capture_point(v: View):
    put_relative(v, v.state.capture_point)


@TERMS.add(GROUND, "half support", "CoP from the middle of the soles", "vector")
def cop(v: View):
    put_relative(v, v.state.cop)


@TERMS.add(SPACE, "0.2 ω h", "CoM velocity", "vector")
def com_vel(v: View):
    velocity, unit = v.state.com_vel, v.scales.velocity
    put_local(v.state, velocity[0], velocity[1], unit, v.out)
    v.out[2] = velocity[2] / unit


@TERMS.add(SPACE, "0.1 m h² ω", "angular momentum about the CoM", "turn")
def angular_momentum(v: View):
    momentum, unit = v.state.momentum, v.scales.momentum
    put_local(v.state, momentum[3], momentum[4], unit, v.out)
    v.out[2] = momentum[5] / unit


@TERMS.add(SPACE, "1", "direction of gravity, root axes", "root vector")
def gravity(v: View):
    for a in range(3):
        v.out[a] = -v.state.root_axes[2, a]


@TERMS.add(SPACE, "ω", "angular velocity of the root, root axes", "root turn")
def root_rate(v: View):
    for a in range(3):
        v.out[a] = v.state.qvel[3 + a] / v.scales.omega


@TERMS.add(
    SPACE, "0.2 ω h", "velocity of the root's origin, root axes", "root vector", default=False
)
def root_vel(v: View):
    R, velocity, unit = v.state.root_axes, v.state.qvel, v.scales.velocity
    for a in range(3):
        along_axis = R[0, a] * velocity[0] + R[1, a] * velocity[1] + R[2, a] * velocity[2]
        v.out[a] = along_axis / unit


@TERMS.add(("z",), "m g", "vertical force of the ground minus the weight", "vector")
def load(v: View):
    v.out[0] = v.state.contact_wrench[2] / v.scales.weight - 1.0


@TERMS.add("joints", "rad", "joint position minus the reference", "joints")
def joint_pos(v: View):
    for j in range(v.out.shape[0]):
        v.out[j] = v.state.qpos[7 + j] - v.q_ref[j]


@TERMS.add("joints", "3 ω", "joint velocity minus the reference's", "joints")
def joint_vel(v: View):
    for j in range(v.out.shape[0]):
        v.out[j] = (v.state.qvel[6 + j] - v.v_ref[j]) / (3.0 * v.scales.omega)


@TERMS.add("feet", "1", "1 where the foot touches the ground, else 0", "feet")
def contacts(v: View):
    for i in range(v.out.shape[0]):
        v.out[i] = v.state.contacts[i]


@TERMS.add("actions", "1", "action of the step before", "actions")
def last_action(v: View):
    for a in range(v.out.shape[0]):
        v.out[a] = v.action[a]


@TERMS.add(("mass",), "1", "mass over what is known of it, minus 1", "number", default=False)
def mass(v: View):
    v.out[0] = v.robot.mass * v.robot.gravity / v.scales.weight - 1.0


@TERMS.add(("mu",), "1", "friction of the ground: a teacher's privilege", "number", default=False)
def friction(v: View):
    v.out[0] = v.views.geom_friction[0, 0]


@TERMS.add(SPACE, "m g", "force that pushes now: a teacher's privilege", "vector", default=False)
def push(v: View):
    now = v.clock.steps * v.robot.timestep
    v.out[:] = 0.0
    for k in range(v.pushes.shape[0]):
        row = v.pushes[k]
        age, duration, force = now - row.start, row.duration, row.force
        if row.kind == PUSH and 0.0 <= age < duration:
            fraction = np.sin(np.pi * age / duration) if row.profile == HALF_SINE else 1.0
            for a in range(3):
                v.out[a] += fraction * force[a]
    put_local(v.state, v.out[0], v.out[1], v.scales.weight, v.out)
    v.out[2] /= v.scales.weight


@dataclass(eq=False)
class MeasuredView(Block):
    """The block of a term of what sensors measure, as late and as noisy as it is: nothing is
    estimated. Where nothing errs and nothing is late, it is what the state says."""

    seen: View
    rings: Rings
    late: Mutable[int]  # physics steps by which measurements are late
    ideal: bool  # nothing is measured


MEASURED_TERMS = Terms(view=MeasuredView)  #: by name


@MEASURED_TERMS.add(
    SPACE, "1", "direction of gravity by the IMU, its axes", "root vector", default=False
)
def measured_gravity(m: MeasuredView):
    row = arrived(m.rings, m.late)
    for a in range(3):
        up = m.seen.state.root_axes[2, a] if m.ideal else m.rings.attitude[row, 2, a]
        m.seen.out[a] = -up


@MEASURED_TERMS.add(SPACE, "ω", "angular velocity by the gyro", "root turn", default=False)
def measured_rate(m: MeasuredView):
    row = arrived(m.rings, m.late)
    for a in range(3):
        rate = m.seen.state.qvel[3 + a] if m.ideal else m.rings.gyro[row, a]
        m.seen.out[a] = rate / m.seen.scales.omega


@MEASURED_TERMS.add(
    "joints", "rad", "joint position by the encoder, minus the reference", "joints",
    default=False,
)  # fmt: skip
def measured_joint_pos(m: MeasuredView):
    v, row = m.seen, arrived(m.rings, m.late)
    for j in range(v.out.shape[0]):
        v.out[j] = (v.state.qpos[7 + j] if m.ideal else m.rings.q[row, j]) - v.q_ref[j]


@MEASURED_TERMS.add(
    "joints", "3 ω", "joint velocity by the encoder, minus the reference's", "joints",
    default=False,
)  # fmt: skip
def measured_joint_vel(m: MeasuredView):
    v, row = m.seen, arrived(m.rings, m.late)
    for j in range(v.out.shape[0]):
        rate = v.state.qvel[6 + j] if m.ideal else m.rings.dq[row, j]
        v.out[j] = (rate - v.v_ref[j]) / (3.0 * v.scales.omega)


TERMS.update(MEASURED_TERMS)
