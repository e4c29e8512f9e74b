"""Drake as the engine of a simulation."""

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from poise.envs.compiled.callbacks import Callback, CallbackAddress
from poise.envs.robots.robot import Robot

from .config import Physics
from .engine import Engine
from .geometry import rotation_of
from .held import check_held
from .limits import JointLimits

if TYPE_CHECKING:
    from .drake_plant import DrakePlant

#: of a model, what a plant is made of
MADE_OF = (
    *("body_mass", "body_inertia", "body_ipos", "body_iquat", "dof_damping", "dof_armature"),
    *("geom_friction", "geom_solref", "pair_friction", "pair_solref"),
    *("jnt_limited", "jnt_range", "jnt_margin", "jnt_solref", "jnt_solimp", "dof_invweight0"),
)
HIGH = 0.15  # [m] above the ground, standing: a geom whose points are left out while it is high
REACH = 0.05  # [m] by which a geom may come down in a step
DIVERGED = int(mujoco.mjtWarning.mjWARN_BADQACC)


class DrakeEngine(Engine):
    """Drake: dynamics, damping and contact; see `DrakePlant`. Joint limits are those of the model,
    by MuJoCo's law (`JointLimits`).

    Torques and pushes, springs and gravity compensation enter as generalised forces, constant in a
    physics step. Dry friction of joints, which Drake's plant does not have, is a torque that is new
    in each of Drake's steps:

        τ_f = −clip(c I q̇/Δt, ± f)

    It stops the joint, or is f. I = 1/(M⁻¹)_jj is the joint's inertia in the standing posture when
    all others are free; c ≤ 1 keeps joints that stop together from overshooting. The softness of a
    realism level, the time constant of MuJoCo's contacts, scales stiffness by its inverse square.

    Raises ConfigError for a robot, or ground, that it cannot hold; the text names the element.
    """

    def __init__(self, robot: Robot, data: mujoco.MjData, physics: Physics):
        super().__init__(robot, data)
        check_held(robot)
        self.physics = physics
        self._solref = np.array(robot.model.geom_solref[:, 0])
        self._stop = _stopping_inertia(robot)
        self._feet = _feet(robot)
        self._callback = Callback(self._step)
        self._made: tuple[bytes, ...] = ()
        self._plants: dict[bool, DrakePlant] = {}  # with the points of high geoms, and without
        self._plant: DrakePlant | None = None  # of the last step
        self._high = _high(robot)
        self.begin()

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), "_plants": {}, "_plant": None, "_made": ()}

    @property
    def stepper(self) -> CallbackAddress:
        return self._callback.address

    def check(self) -> None:
        self._callback.check()

    def begin(self) -> None:
        self._callback.check()
        plant, d = self._current(), self.data
        plant.write(d.qpos, d.qvel)
        given = plant.to_drake(rotation_of(d.qpos[3:7]), self._forces() + self._friction(d.qvel))
        plant.step(given, self._limits.beyond(d.qpos, d.qvel))
        wrench, bodies = plant.contacts()
        self._tell(wrench, bodies, d.qpos)

    def _current(self) -> "DrakePlant":
        """The plant of the model as it is now."""
        model = self.robot.model
        arrays = *(getattr(model, name) for name in MADE_OF), model.opt.gravity
        made = tuple(array.tobytes() for array in arrays)
        if not self._plants or made != self._made:
            self._plants, self._made = {}, made
            self._limits = JointLimits(self.robot)
        return self._near()

    def _near(self) -> "DrakePlant":
        """The plant with the points that can reach the ground in this step."""
        from .drake_plant import DrakePlant

        model, high = self.robot.model, self._high
        low = bool((self.data.geom_xpos[high, 2] < model.geom_rbound[high] + REACH).any())
        if low not in self._plants:
            # a negative number is a stiffness of the model's own
            soft = np.where(self._solref > 0.0, model.geom_solref[:, 0] / self._solref, 1.0)
            apart = () if low else high.tolist()
            self._plants[low] = DrakePlant(self.robot, self.physics, soft, apart)
        self._plant = self._plants[low]
        return self._plant

    def _step(self) -> None:
        """Take a physics step, see `Engine`."""
        plant, d = self._near() if self._plants else self._current(), self.data
        forces, start = self._forces(), np.array(d.qpos)
        wrench, count = np.zeros(6), self.physics.substeps
        bodies: list[int] = []
        for _ in range(count):
            if not np.isfinite([*d.qpos, *d.qvel, *forces]).all():
                d.warning[DIVERGED].number += 1
                return
            plant.write(d.qpos, d.qvel)
            given = plant.to_drake(rotation_of(d.qpos[3:7]), forces + self._friction(d.qvel))
            try:
                values = plant.step(given, self._limits.beyond(d.qpos, d.qvel))
            except RuntimeError as error:  # numbers so large that its solver finds no solution
                if not any(word in str(error) for word in ("converge", "NaN")):
                    raise
                d.warning[DIVERGED].number += 1
                return
            part, bodies = plant.contacts()
            wrench += part / count
            plant.read(values, d.qpos, d.qvel)
        d.time += self.robot.model.opt.timestep
        self._tell(wrench, bodies, start)

    def _forces(self) -> np.ndarray:
        """(nv,) generalised forces but for gravity, damping of joints and dry friction."""
        model, d = self.robot.model, self.data
        forces = d.qfrc_applied + d.qfrc_passive
        forces[6:] += model.dof_damping[6:] * d.qvel[6:]  # implicit, in the plant
        limit = self.robot.torque_limit
        forces[self.robot.motor_dofs] += np.clip(d.ctrl, -limit, limit)
        for body in np.flatnonzero(d.xfrc_applied.any(axis=1)):
            push = d.xfrc_applied[body]
            mujoco.mj_applyFT(model, d, push[:3], push[3:], d.xipos[body], body, forces)
        return forces

    def _friction(self, qvel: np.ndarray) -> np.ndarray:
        most = self.robot.model.dof_frictionloss
        if not most.any():
            return most
        timestep = self.robot.model.opt.timestep / self.physics.substeps
        return -np.clip(self._stop * qvel / timestep, -most, most)

    def _tell(self, wrench: np.ndarray, bodies: list[int], qpos: np.ndarray) -> None:
        """Write the ground's wrench about the world's origin, and the contacts, of a step from a
        pose (nq,)."""
        d, root = self.data, qpos[:3]
        d.qfrc_constraint[:3] = wrench[:3]
        x, y, z, (a, b, c) = *root, wrench[:3]
        moment = wrench[3:] - np.array([y * c - z * b, z * a - x * c, x * b - y * a])
        d.qfrc_constraint[3:6] = rotation_of(qpos[3:7]).T @ moment
        for name, own in self._feet.items():
            d.sensordata[self.robot.sensor_adr[name]] = sum(body in own for body in bodies)
        d.sensordata[self.robot.sensor_adr["ground"]] = len(bodies)


def _stopping_inertia(robot: Robot) -> np.ndarray:
    """(nv,) c/(M⁻¹)_jj, c = 1/max(1, ρ) with ρ the largest eigenvalue of the scaled M⁻¹, standing;
    0 of the root."""
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(model, data)
    inverse = np.zeros((model.nv, model.nv))
    mujoco.mj_solveM(model, data, inverse, np.eye(model.nv))
    free = 1.0 / np.diag(inverse)
    scale = np.sqrt(free[6:])
    largest = np.linalg.eigvalsh(scale[:, None] * inverse[6:, 6:] * scale)[-1]
    stop = free / max(1.0, largest)
    stop[:6] = 0.0
    return np.asarray(stop)


def _high(robot: Robot) -> np.ndarray:
    """Geoms that are high above the ground when the robot stands; those of soles are not."""
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(model, data)
    moving = model.body_weldid[model.geom_bodyid] != 0
    soles = {geom for sole in robot.soles for geom in sole.geom_ids}
    high = moving & (data.geom_xpos[:, 2] > model.geom_rbound + HIGH)
    return np.array([geom for geom in np.flatnonzero(high) if geom not in soles], dtype=int)


def _feet(robot: Robot) -> dict[str, set[int]]:
    """Foot → the bodies of its subtree."""
    parents, found = robot.model.body_parentid, {}
    for sole in robot.soles:
        own = {sole.body_id}
        for body in range(sole.body_id + 1, robot.model.nbody):
            if int(parents[body]) in own:
                own.add(body)
        found[sole.name] = own
    return found
