"""What the QPs are asked for in a step and after; kernels on a `CaptureTick`."""

import numpy as np

from poise.envs.compiled.jit import compiled
from poise.envs.maths.polygons import find_nearest
from poise.envs.maths.vectors import copy, rotation_error

from .feedback import HEIGHT as FEEDBACK_HEIGHT
from .offsets import COM, COP, HEIGHT, LEAN
from .recentring import LEANING, PRESSING, press


@compiled
def copy_targets(t):
    """Targets of our own: those given, but upright at rest along the heading."""
    given, own, level, error = t.given, t.guided, t.memory.level, t.error
    copy(given.q_ref, own.q_ref)
    copy(given.v_ref, own.v_ref)
    copy(given.angular_momentum, own.angular_momentum)
    x, y = t.shift[LEAN], t.shift[LEAN + 1]
    angle = np.sqrt(x * x + y * y)
    c, s = np.cos(angle), np.sin(angle)
    if angle > 0.0:
        x, y = x / angle, y / angle
    for a in range(3):  # Rodrigues' formula on each standing axis, then the heading
        for b in range(3):
            error[b] = t.robot.root_standing[b, a]
        along = (1.0 - c) * (x * error[0] + y * error[1])
        u = c * error[0] + s * y * error[2] + along * x
        v = c * error[1] - s * x * error[2] + along * y
        own.root_axes[0, a] = level[0, 0] * u + level[0, 1] * v
        own.root_axes[1, a] = level[1, 0] * u + level[1, 1] * v
        own.root_axes[2, a] = c * error[2] + s * (x * error[1] - y * error[0])
        own.root_vel[a] = 0.0


@compiled
def guide(t, region, hips, ground, way_x, way_y):
    """c̈_ref = ω² (c − p) in the plane; a height that legs reach with the feet `way` apart."""
    s, g, own, shift, p = t.state, t.gains, t.guided, t.shift, t.pair
    cos, sin = t.memory.level[0, 0], t.memory.level[1, 0]
    rest_x, rest_y, n = 0.0, 0.0, region.shape[0]
    for i in range(n):
        rest_x += region[i, 0] / n
        rest_y += region[i, 1] / n
    if t.home.stage[0] == LEANING:
        rest_x, rest_y = t.home.rest[0], t.home.rest[1]
    rest_x += cos * shift[COM] - sin * shift[COM + 1]
    rest_y += sin * shift[COM] + cos * shift[COM + 1]
    wanted = t.error
    wanted[0] = s.capture_point[0] + g.gain * (s.capture_point[0] - rest_x)
    wanted[1] = s.capture_point[1] + g.gain * (s.capture_point[1] - rest_y)
    if t.home.stage[0] == PRESSING:
        press(t, rest_x, rest_y, wanted)
    find_nearest(region, wanted, p)
    over_x, over_y = wanted[0] - p[0], wanted[1] - p[1]
    share = min(1.0, hips / max(np.sqrt(over_x * over_x + over_y * over_y), 1e-9))
    p[0] += over_x * share + cos * shift[COP] - sin * shift[COP + 1]
    p[1] += over_y * share + sin * shift[COP] + cos * shift[COP + 1]
    for a in range(2):
        own.com[a], own.com_vel[a], own.cop[a] = s.com[a], s.com_vel[a], p[a]
        own.com_acc[a] = s.omega[0] * s.omega[0] * (s.com[a] - p[a])
    reach = np.sqrt(max(g.leg * g.leg - 0.25 * (way_x * way_x + way_y * way_y), 0.0))
    own.com[2] = ground + min(t.robot.height_com, reach) + shift[HEIGHT]
    if t.memory.swinging[0]:
        own.com[2] += t.search.feedback.added[FEEDBACK_HEIGHT] - g.sink
    own.com_vel[2] = own.com_acc[2] = 0.0
    limit_posture(t)


@compiled
def limit_posture(t):
    """Feed-forward that caps what the posture's PD law asks for.

    A push leaves the trunk turning at some rad/s. To stop that at once would cost CoM
    acceleration, L̇ = (p − c) × f, which no foothold makes good.
    """
    s, g, own, p, error = t.state, t.gains, t.guided, t.both.problem.parameters, t.error
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
    share = min(1.0, most / max(np.sqrt(total), 1e-9)) - 1.0
    for a in range(3):
        own.root_acc[a] *= share
