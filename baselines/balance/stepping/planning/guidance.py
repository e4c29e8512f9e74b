"""The targets of the QPs in a step and after; kernels on a `CaptureTick`."""

import numpy as np

from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.polygons import find_nearest
from poise.envs.compiled.maths.vectors import copy_into, rotated, rotation_error, turn_error, turned

from .blocks import CaptureTick
from .feedback import pivot_offset
from .recentring import LOADING, SHIFTING, limit_cop_distance
from .search import set_capture_point

STILL = 1e-6  # [rad/s] of the joints together, slower is rounding
RETURN = 0.3  # of the way back to the motion in 1/ω
UPRIGHT = 0.95  # [h] a motion that has the CoM lower crouches


@compiled
def crouch(t: CaptureTick) -> float:
    """How far below 0.95 h the motion has the CoM [m]; 0 where it stands."""
    height = t.reference_in.com[2] - t.state.origin[2] - t.offsets.height
    return max(UPRIGHT * t.robot.height_com - height, 0.0)


@compiled
def moves(t: CaptureTick) -> bool:
    """Return whether the motion that is asked for moves; standing does not, but for rounding."""
    rates, total = t.reference_in.v_ref, 0.0
    for j in range(rates.shape[0]):
        total += rates[j] * rates[j]
    return total > STILL * STILL


@compiled
def turned_away(t: CaptureTick) -> tuple[float, float]:
    """The angle of the root from where the motion has it [rad], and how fast it grows [rad/s]."""
    s, given, error = t.state, t.reference_in, t.vector
    scale = turn_error(s.root_axes, given.root_axes, error)
    angle, rate = 0.0, 0.0
    for a in range(3):
        angle += error[a] * error[a]
        rate += error[a] * (given.root_vel[a] - s.qvel[3 + a])
    angle = np.sqrt(angle)
    return scale * angle, rate / max(angle, 1e-9)


@compiled
def copy_reference(t: CaptureTick) -> None:
    """Copy the joints' and the momentum's references, and set the root's: upright at rest along
    the heading of the step, but for the lean that a policy adds."""
    given, own, level, standing = t.reference_in, t.reference_out, t.memory.level_frame, t.vector
    copy_into(given.q_ref, own.q_ref)
    copy_into(given.v_ref, own.v_ref)
    copy_into(given.angular_momentum, own.angular_momentum)
    x, y = t.offsets.lean[0], t.offsets.lean[1]
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
    if not t.memory.swinging:
        rest_x += cos * g.rest_ahead
        rest_y += sin * g.rest_ahead
    if t.recentring.stage == SHIFTING:
        rest_x, rest_y = t.recentring.capture_target[0], t.recentring.capture_target[1]
    x, y = turned(cos, sin, offsets.com[0], offsets.com[1])
    rest_x += x
    rest_y += y
    back = t.memory.return_fraction
    if back > 0.0 and not t.memory.recovering:  # the motion is gone on with
        rest_x += back * (t.reference_in.com[0] - rest_x)
        rest_y += back * (t.reference_in.com[1] - rest_y)
    desired, xi = t.vector, t.search.capture_point
    set_capture_point(t.search)
    desired[0] = xi[0] + g.gain * (xi[0] - rest_x)
    desired[1] = xi[1] + g.gain * (xi[1] - rest_y)
    if t.recentring.stage == LOADING:
        limit_cop_distance(t, rest_x, rest_y, desired)
    find_nearest(region, desired, p)
    over_x, over_y = desired[0] - p[0], desired[1] - p[1]
    scale = min(1.0, overreach / max(np.sqrt(over_x * over_x + over_y * over_y), 1e-9))
    p[0] += over_x * scale + cos * offsets.cop[0] - sin * offsets.cop[1]
    p[1] += over_y * scale + sin * offsets.cop[0] + cos * offsets.cop[1]
    for a in range(2):
        own.com[a], own.com_vel[a], own.cop[a] = s.com[a], s.com_vel[a], p[a]
        own.com_acc[a] = s.omega * s.omega * (s.com[a] - p[a])
    f = t.search.feedback
    x, y = pivot_offset(f, s, f.swing if t.memory.swinging else f.stance, cos, sin)
    own.com_acc[0] += s.omega * s.omega * x
    own.com_acc[1] += s.omega * s.omega * y
    half = 0.25 * (stride_x * stride_x + stride_y * stride_y)
    leg_height = np.sqrt(max(g.leg_length * g.leg_length - half, 0.0))
    own.com[2] = ground + min(t.robot.height_com, leg_height) + offsets.height
    if t.memory.swinging:
        own.com[2] += t.search.feedback.added.height - g.swing_com_drop
    own.com_vel[2] = own.com_acc[2] = 0.0
    limit_posture(t)


@compiled
def world(axes: np.ndarray, v: np.ndarray) -> tuple[float, float, float]:
    """A vector (3,) of a frame in the world."""
    return (
        axes[0, 0] * v[0] + axes[0, 1] * v[1] + axes[0, 2] * v[2],
        axes[1, 0] * v[0] + axes[1, 1] * v[1] + axes[1, 2] * v[2],
        axes[2, 0] * v[0] + axes[2, 1] * v[1] + axes[2, 2] * v[2],
    )


@compiled
def return_to_motion(t: CaptureTick) -> None:
    """Lead height of the CoM and root to the motion's, once the robot is home and calm; guides the
    CoM to the motion's from the next tick on."""
    s, m, given, own = t.state, t.memory, t.reference_in, t.reference_out
    if m.recovering:
        m.return_fraction = 0.0
        return
    m.return_fraction = min(m.return_fraction + RETURN * s.omega * t.gains.period, 1.0)
    back = m.return_fraction
    own.com[2] += back * (given.com[2] - own.com[2])
    own.com_vel[2], own.com_acc[2] = back * given.com_vel[2], back * given.com_acc[2]
    axis, R = t.vector, own.root_axes
    scale = turn_error(R, given.root_axes, axis)
    sine = np.sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2])
    x, y, z = world(R, axis)
    if sine > 0.0:
        x, y, z = x / sine, y / sine, z / sine
    cos, sin = np.cos(back * scale * sine), np.sin(back * scale * sine)
    for a in range(3):
        R[0, a], R[1, a], R[2, a] = rotated(x, y, z, cos, sin, R[:, a])
        own.root_vel[a] = back * given.root_vel[a]
    limit_posture(t)


@compiled
def limit_posture(t: CaptureTick) -> None:
    """Set a feed-forward that caps what the posture's PD law asks for.

    A push leaves the trunk turning at some rad/s. To stop that at once would cost CoM
    acceleration, L̇ = (p − c) × f, which no foothold makes good.
    """
    s, g, own, error = t.state, t.gains, t.reference_out, t.vector
    p = t.on_both.posture
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
    most = g.swing_accel if t.memory.swinging else g.root_accel
    scale = min(1.0, most / max(np.sqrt(total), 1e-9)) - 1.0
    for a in range(3):
        own.root_acc[a] *= scale
