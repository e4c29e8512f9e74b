"""The state of a robot at one tick, as controllers and users read it."""

import numpy as np

from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.maths.polygons import ray_to_edge

from .arrays import RobotArrays
from .kinematics import StateArrays, support_distance, update_support


class ArrayView:
    """A read-only view of an array of a state, by default of the one of its own name."""

    def __init__(self, name: str = "", part: slice = slice(None)):
        self.name, self.part = name, part

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = self.name or name

    def __get__(self, state: "RobotState | None", owner: type) -> np.ndarray:
        if state is None:  # asked of the class
            return self  # type: ignore[return-value]
        view: np.ndarray = getattr(state.arrays, self.name)[self.part]
        view.flags.writeable = False
        return view

    def __set__(self, state: "RobotState", value: object) -> None:
        raise AttributeError(f"{self.name} of a state is read-only")


class RobotState(Copyable):
    """Every kinematic and centroidal quantity of one tick; read-only views, world axes.

    The arrays are those of a running `Simulation` and change when it moves on; `copy()` keeps
    them. Sizes: nv degrees of freedom, nc soles. Symbols as in docs/notation.md.
    """

    qpos = ArrayView()
    """(nq,) MuJoCo's generalised position: root position, quaternion wxyz, joints."""
    qvel = ArrayView()
    """(nv,) v: root velocity (linear world, angular body axes), joint velocities."""
    motor_q = ArrayView()
    """(nv−6,) joint positions as the motors' own encoders read them now, never late [rad]."""
    motor_dq = ArrayView()
    """(nv−6,) joint velocities, also as the encoders read them now [rad/s]."""
    M = ArrayView()
    """(nv, nv) joint-space inertia."""
    h = ArrayView()
    """(nv,) bias minus passive force: M v̇ + h = Sᵀτ + Jᵀw."""
    root_axes = ArrayView()
    """(3, 3) the root body's axes as columns."""
    com = ArrayView()
    """(3,) c, centre of mass [m]."""
    com_vel = ArrayView()
    """(3,) ċ [m/s]."""
    linear_momentum = ArrayView("momentum", slice(3))
    """(3,) P = A_P v [N·s]."""
    angular_momentum = ArrayView("momentum", slice(3, None))
    """(3,) L = A_L v about the centre of mass [N·m·s]."""
    A = ArrayView()
    """(6, nv) centroidal momentum matrix, [P; L] = A v [Orin08]."""
    A_bias = ArrayView()
    """(6,) such that A v̇ + A_bias is the ground's wrench about c: [Ṗ − m g; L̇]."""
    load = ArrayView()
    """(3,) estimated sustained load, beside gravity and ground: force f_z [N] and moments n_x, n_y
    about the known CoM [N·m]; h, A_bias and the CoM include it."""
    J = ArrayView()
    """(6 nc, nv) sole Jacobians: linear velocity of the reference point, then angular."""
    J_v = ArrayView()
    """(6 nc,) sole velocities J v."""
    Jdot_v = ArrayView()
    """(6 nc,) J̇ v."""
    sole_points = ArrayView("sole_point")
    """(nc, 3) sole reference points [m]."""
    sole_axes = ArrayView()
    """(nc, 3, 3) sole axes as columns: forward, left, up when standing."""
    origin = ArrayView()
    """(3,) origin of the heading frame: mean of the sole reference points [m].

    On a terrain it is as high as the soles that touch the ground are in the mean.
    """
    heading = ArrayView()
    """(2,) cosine and sine of the heading frame's yaw."""
    contact_wrench = ArrayView()
    """(6,) force [N] and moment about the world origin [N·m] of the ground, last step."""
    ground = ArrayView()
    """(nc,) height of the ground below each sole's reference point [m]."""
    cop = ArrayView()
    """(2,) p, centre of pressure on the ground [m]; on a terrain at the height of `origin`."""
    capture_point = ArrayView()
    """(2,) ξ = c + ċ/ω on the ground [m]."""
    contacts = ArrayView()
    """(nc,) 1 where the foot touches the ground, else 0."""

    def __init__(self, robot: RobotArrays, arrays: StateArrays, time: float = 0.0):
        self.robot, self.arrays, self.time = robot, arrays, time

    def copy(self) -> "RobotState":
        """A snapshot that no simulation writes to."""
        arrays = StateArrays(*(array.copy() for array in self.arrays.members()))
        return RobotState(self.robot, arrays, self.time)

    @property
    def mass(self) -> float:
        """m [kg]."""
        return self.robot.mass

    @property
    def q(self) -> np.ndarray:
        """(nv−6,) joint positions [rad]."""
        return self.qpos[7:]

    @property
    def friction(self) -> float:
        """Estimated friction of the ground, over that of the model; it scales the cones."""
        return self.arrays.friction

    @property
    def Adot_v(self) -> np.ndarray:
        """(6,) Ȧ v, the part of [Ṗ; L̇] that does not come from accelerations."""
        bias = self.arrays.A_bias.copy()
        bias[2] -= self.robot.mass * self.robot.gravity - self.arrays.load[0]
        return bias

    @property
    def heading_yaw(self) -> float:
        """Yaw of the heading frame [rad]: mean forward axis of the soles on the ground."""
        return float(np.arctan2(self.arrays.heading[1], self.arrays.heading[0]))

    @property
    def support_height(self) -> float:
        """Height of the plane in which the CoP lies [m]: 0, on a terrain that of `origin`."""
        return float(self.arrays.origin[2]) if len(self.robot.surfaces) else 0.0

    @property
    def omega(self) -> float:
        """ω = √(g/z_c) [1/s]."""
        return self.arrays.omega

    @property
    def other_contact(self) -> bool:
        """True where anything but the feet touches the ground."""
        return bool(self.arrays.other_contacts > 0.5)

    @property
    def support_polygon(self) -> np.ndarray:
        """(k, 2) counter-clockwise hull of all soles but swing feet [m]."""
        update_support(self.robot, self.arrays)
        return self.arrays.support[: self.arrays.support_size].copy()

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
