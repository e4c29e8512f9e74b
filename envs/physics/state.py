"""The state of a robot at one tick, as controllers and users read it."""

import numpy as np

from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.maths.polygons import ray_to_edge

from .arrays import RobotArrays
from .kinematics import StateArrays, support_distance, update_support


class RobotState(Copyable):
    """Every kinematic and centroidal quantity of one tick; read-only views, world axes.

    The arrays are those of a running `Simulation` and change when it moves on; `copy()` keeps
    them. Sizes: nv degrees of freedom, nc soles. Symbols as in docs/notation.md.
    """

    def __init__(self, robot: RobotArrays, arrays: StateArrays, time: float = 0.0):
        self.robot, self.arrays, self.time = robot, arrays, time

    def copy(self) -> "RobotState":
        """A snapshot that no simulation writes to."""
        arrays = StateArrays(*(array.copy() for array in self.arrays.members()))
        return RobotState(self.robot, arrays, self.time)

    @property
    def qpos(self) -> np.ndarray:
        """(nq,) MuJoCo's generalised position: root position, quaternion wxyz, joints."""
        return _frozen(self.arrays.qpos)

    @property
    def qvel(self) -> np.ndarray:
        """(nv,) v: root velocity (linear world, angular body axes), joint velocities."""
        return _frozen(self.arrays.qvel)

    @property
    def mass(self) -> float:
        """m [kg]."""
        return self.robot.mass

    @property
    def q(self) -> np.ndarray:
        """(nv−6,) joint positions [rad]."""
        return self.qpos[7:]

    @property
    def motor_q(self) -> np.ndarray:
        """(nv−6,) joint positions as the motors' own encoders read them now, never late [rad]."""
        return _frozen(self.arrays.motor_q)

    @property
    def motor_dq(self) -> np.ndarray:
        """(nv−6,) joint velocities likewise [rad/s]."""
        return _frozen(self.arrays.motor_dq)

    @property
    def M(self) -> np.ndarray:
        """(nv, nv) joint-space inertia."""
        return _frozen(self.arrays.M)

    @property
    def h(self) -> np.ndarray:
        """(nv,) bias minus passive force: M v̇ + h = Sᵀτ + Jᵀw."""
        return _frozen(self.arrays.h)

    @property
    def root_axes(self) -> np.ndarray:
        """(3, 3) the root body's axes as columns."""
        return _frozen(self.arrays.root_axes)

    @property
    def com(self) -> np.ndarray:
        """(3,) c, centre of mass [m]."""
        return _frozen(self.arrays.com)

    @property
    def com_vel(self) -> np.ndarray:
        """(3,) ċ [m/s]."""
        return _frozen(self.arrays.com_vel)

    @property
    def linear_momentum(self) -> np.ndarray:
        """(3,) P = A_P v [N·s]."""
        return _frozen(self.arrays.momentum[:3])

    @property
    def angular_momentum(self) -> np.ndarray:
        """(3,) L = A_L v about the centre of mass [N·m·s]."""
        return _frozen(self.arrays.momentum[3:])

    @property
    def A(self) -> np.ndarray:
        """(6, nv) centroidal momentum matrix, [P; L] = A v [Orin08]."""
        return _frozen(self.arrays.A)

    @property
    def A_bias(self) -> np.ndarray:
        """(6,) such that A v̇ + A_bias is the ground's wrench about c: [Ṗ − m g; L̇]."""
        return _frozen(self.arrays.A_bias)

    @property
    def load(self) -> np.ndarray:
        """(3,) force f_z [N] and moments n_x, n_y about the known CoM [N·m] that are believed to
        last, beside gravity and ground; h, A_bias and the CoM have them in already."""
        return _frozen(self.arrays.load)

    @property
    def friction(self) -> float:
        """Friction of the ground that is believed, over that of the model: cones are so narrow."""
        return float(self.arrays.friction[0])

    @property
    def Adot_v(self) -> np.ndarray:
        """(6,) Ȧ v, the part of [Ṗ; L̇] that does not come from accelerations."""
        bias = self.arrays.A_bias.copy()
        bias[2] -= self.robot.mass * self.robot.gravity - self.arrays.load[0]
        return bias

    @property
    def J(self) -> np.ndarray:
        """(6 nc, nv) sole Jacobians: linear velocity of the reference point, then angular."""
        return _frozen(self.arrays.J)

    @property
    def J_v(self) -> np.ndarray:
        """(6 nc,) sole velocities J v."""
        return _frozen(self.arrays.J_v)

    @property
    def Jdot_v(self) -> np.ndarray:
        """(6 nc,) J̇ v."""
        return _frozen(self.arrays.Jdot_v)

    @property
    def sole_points(self) -> np.ndarray:
        """(nc, 3) sole reference points [m]."""
        return _frozen(self.arrays.sole_point)

    @property
    def sole_axes(self) -> np.ndarray:
        """(nc, 3, 3) sole axes as columns: forward, left, up when standing."""
        return _frozen(self.arrays.sole_axes)

    @property
    def origin(self) -> np.ndarray:
        """(3,) origin of the heading frame: mean of the sole reference points [m].

        On a terrain it is as high as the soles that touch the ground are in the mean.
        """
        return _frozen(self.arrays.origin)

    @property
    def heading(self) -> np.ndarray:
        """(2,) cosine and sine of the heading frame's yaw."""
        return _frozen(self.arrays.heading)

    @property
    def heading_yaw(self) -> float:
        """Yaw of the heading frame [rad]: mean forward axis of the soles on the ground."""
        return float(np.arctan2(self.arrays.heading[1], self.arrays.heading[0]))

    @property
    def contact_wrench(self) -> np.ndarray:
        """(6,) force [N] and moment about the world origin [N·m] of the ground, last step."""
        return _frozen(self.arrays.contact_wrench)

    @property
    def ground(self) -> np.ndarray:
        """(nc,) height of the ground below each sole's reference point [m]."""
        return _frozen(self.arrays.ground)

    @property
    def support_height(self) -> float:
        """Height of the plane in which the CoP lies [m]: 0, on a terrain that of `origin`."""
        return float(self.arrays.origin[2]) if len(self.robot.surfaces) else 0.0

    @property
    def cop(self) -> np.ndarray:
        """(2,) p, centre of pressure on the ground [m]; on a terrain at the height of `origin`."""
        return _frozen(self.arrays.cop)

    @property
    def capture_point(self) -> np.ndarray:
        """(2,) ξ = c + ċ/ω on the ground [m]."""
        return _frozen(self.arrays.capture_point)

    @property
    def omega(self) -> float:
        """ω = √(g/z_c) [1/s]."""
        return float(self.arrays.omega[0])

    @property
    def contacts(self) -> np.ndarray:
        """(nc,) 1 where the foot touches the ground, else 0."""
        return _frozen(self.arrays.contacts)

    @property
    def other_contact(self) -> bool:
        """True where anything but the feet touches the ground."""
        return bool(self.arrays.other_contacts[0] > 0.5)

    @property
    def support_polygon(self) -> np.ndarray:
        """(k, 2) counter-clockwise hull of the soles that are not in the air [m]."""
        update_support(self.robot, self.arrays)
        return self.arrays.support[: self.arrays.support_size[0]].copy()

    def support_distance(self, point: np.ndarray) -> float:
        """Signed distance [m] from a ground point (2,) to the polygon's edge, > 0 inside."""
        update_support(self.robot, self.arrays)
        return float(support_distance(self.arrays, point[0], point[1]))

    def support_margin(self, direction: float) -> float:
        """δ(θ) [m]: from the CoM's ground projection to the polygon's edge along `direction`.

        `direction` in degrees counter-clockwise from forward, heading frame. Zero where the
        projection is outside.
        """
        angle = np.radians(direction) + self.heading_yaw
        ray = np.array([np.cos(angle), np.sin(angle)])
        return ray_to_edge(self.support_polygon, self.com[:2], ray)


def _frozen(array: np.ndarray) -> np.ndarray:
    view = array.view()
    view.flags.writeable = False
    return view
