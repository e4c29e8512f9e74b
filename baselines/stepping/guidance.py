"""The targets of the QPs in a step and after; kernels on a `CaptureTick`."""

import numpy as np

from poise.baselines.motions.offsets import COM_X, COM_Y, COM_Z, COP_X, COP_Y, LEAN_X, LEAN_Y
from poise.envs.compiled.jit import compiled
from poise.envs.maths.polygons import find_nearest
from poise.envs.maths.vectors import copy_into, rotation_error, turned

from .blocks import CaptureTick
from .feedback import HEIGHT, STANCE, SWING, pivot_offset
from .recentring import LOADING, SHIFTING, limit_cop_distance
from .search import set_capture_point


@compiled
def copy_reference(t: CaptureTick) -> None:
    """Copy the joints' and the momentum's references, and set the root's: upright at rest along
    the heading of the step, but for the lean that a policy adds."""
    given, own, level, standing = t.reference_in, t.reference_out, t.memory.level_frame, t.vector
    copy_into(given.q_ref, own.q_ref)
    copy_into(given.v_ref, own.v_ref)
    copy_into(given.angular_momentum, own.angular_momentum)
    x, y = t.offsets[LEAN_X], t.offsets[LEAN_Y]
    angle = np.sqrt(x * x + y * y)
    cos, sin = np.cos(angle), np.sin(angle)
    if angle > 0.0:
        x, y = x / angle, y / angle
    # Each standing axis leans, as by `rotated` about an axis in the plane, then is turned to the
    # heading. The order of the operations decides about last bits, and with them about trials.
    for a in range(3):
        for b in range(3):
            standing[b] = t.robot.root_standing[b, a]
        along = (1.0 - cos) * (x * standing[0] + y * standing[1])
        u = cos * standing[0] + sin * y * standing[2] + along * x
        v = cos * standing[1] - sin * x * standing[2] + along * y
        own.root_axes[0, a] = level[0, 0] * u + level[0, 1] * v
        own.root_axes[1, a] = level[1, 0] * u + level[1, 1] * v
        own.root_axes[2, a] = cos * standing[2] + sin * (x * standing[1] - y * standing[0])
        own.root_vel[a] = 0.0


@compiled
def guide_com(
    t: CaptureTick,
    region: np.ndarray,
    overreach: float,
    ground: float,
    stride_x: float,
    stride_y: float,
) -> None:
    """References of CoM and CoP: c̈_ref = ω² (c − p + r) with p = ξ + k (ξ − ξ_ref).

    p stays within `overreach` [m] of the CoP `region` (n, 2), whose middle is ξ_ref, on both feet
    moved by `rest_ahead` to where the posture has the CoM. The height
    over the `ground` [m] is what legs reach with the feet a stride (x, y) apart [m].
    """
    s, g, own, offsets, p = t.state, t.gains, t.reference_out, t.offsets, t.pair
    cos, sin = t.memory.level_frame[0, 0], t.memory.level_frame[1, 0]
    rest_x, rest_y, n = 0.0, 0.0, region.shape[0]
    for i in range(n):
        rest_x += region[i, 0] / n
        rest_y += region[i, 1] / n
    if not t.memory.swinging[0]:
        rest_x += cos * g.rest_ahead
        rest_y += sin * g.rest_ahead
    if t.recentring.stage[0] == SHIFTING:
        rest_x, rest_y = t.recentring.capture_target[0], t.recentring.capture_target[1]
    x, y = turned(cos, sin, offsets[COM_X], offsets[COM_Y])
    rest_x += x
    rest_y += y
    desired, xi = t.vector, t.search.capture_point
    set_capture_point(t.search)
    desired[0] = xi[0] + g.gain * (xi[0] - rest_x)
    desired[1] = xi[1] + g.gain * (xi[1] - rest_y)
    if t.recentring.stage[0] == LOADING:
        limit_cop_distance(t, rest_x, rest_y, desired)
    find_nearest(region, desired, p)
    over_x, over_y = desired[0] - p[0], desired[1] - p[1]
    scale = min(1.0, overreach / max(np.sqrt(over_x * over_x + over_y * over_y), 1e-9))
    p[0] += over_x * scale + cos * offsets[COP_X] - sin * offsets[COP_Y]
    p[1] += over_y * scale + sin * offsets[COP_X] + cos * offsets[COP_Y]
    for a in range(2):
        own.com[a], own.com_vel[a], own.cop[a] = s.com[a], s.com_vel[a], p[a]
        own.com_acc[a] = s.omega[0] * s.omega[0] * (s.com[a] - p[a])
    row = SWING if t.memory.swinging[0] else STANCE
    x, y = pivot_offset(t.search.feedback, s, row, cos, sin)
    own.com_acc[0] += s.omega[0] * s.omega[0] * x
    own.com_acc[1] += s.omega[0] * s.omega[0] * y
    half = 0.25 * (stride_x * stride_x + stride_y * stride_y)
    leg_height = np.sqrt(max(g.leg_length * g.leg_length - half, 0.0))
    own.com[2] = ground + min(t.robot.height_com, leg_height) + offsets[COM_Z]
    if t.memory.swinging[0]:
        own.com[2] += t.search.feedback.added[HEIGHT] - g.swing_com_drop
    own.com_vel[2] = own.com_acc[2] = 0.0
    limit_posture(t)


@compiled
def limit_posture(t: CaptureTick) -> None:
    """Set a feed-forward that caps what the posture's PD law asks for.

    A push leaves the trunk turning at some rad/s. To stop that at once would cost CoM
    acceleration, L̇ = (p − c) × f, which no foothold makes good.
    """
    s, g, own, error = t.state, t.gains, t.reference_out, t.vector
    p = t.on_both.problem.parameters
    for j in range(own.q_ref.shape[0]):
        asked = p.stiffness[6 + j] * (own.q_ref[j] - s.qpos[7 + j]) + p.damping[6 + j] * (
            own.v_ref[j] - s.qvel[6 + j]
        )
        own.a_ref[j] = min(max(asked, -g.joint_accel), g.joint_accel) - asked
    rotation_error(s.root_axes, own.root_axes, error)
    R, total = s.root_axes, 0.0
    for a in range(3):
        turn = R[0, a] * error[0] + R[1, a] * error[1] + R[2, a] * error[2]
        own.root_acc[a] = p.stiffness[3 + a] * turn - p.damping[3 + a] * s.qvel[3 + a]
        total += own.root_acc[a] * own.root_acc[a]
    most = g.swing_accel if t.memory.swinging[0] else g.root_accel
    scale = min(1.0, most / max(np.sqrt(total), 1e-9)) - 1.0
    for a in range(3):
        own.root_acc[a] *= scale
