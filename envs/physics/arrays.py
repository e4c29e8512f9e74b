"""The blocks of arrays of a robot and one simulation, for compiled code.

`RobotArrays` is constant and shared. `SimViews` holds views into one `MjData` and keeps it alive,
so a kernel reads and writes the simulation itself.
"""

from dataclasses import dataclass, fields

import mujoco
import numpy as np
from numpy.lib.stride_tricks import as_strided

from poise.envs.compiled.block import Block
from poise.envs.compiled.copies import portable
from poise.envs.compiled.maths.pendulum import Units
from poise.envs.robots.robot import Robot
from poise.envs.robots.soles import MAX_VERTICES
from poise.envs.terrain.arrays import surface_arrays


@dataclass(frozen=True, eq=False)
class RobotArrays(Block):
    """Constants of one robot (nv degrees of freedom, nu motors, nc soles)."""

    timestep: float  #: physics step [s]
    gravity: float  #: magnitude, along −z [m/s²]
    mass: float  #: [kg]
    height_com: float  #: CoM above the ground in the standing posture [m]
    root_body: int
    tree_body: int  #: body whose subtree CoM is the reference point of `cdof`
    root_standing: np.ndarray  #: (3, 3) root orientation relative to the heading, standing
    q_standing: np.ndarray  #: (nv−6,) standing joint positions [rad]
    q_min: np.ndarray  #: (nv−6,)
    q_max: np.ndarray  #: (nv−6,)
    motor_dofs: np.ndarray  #: (nu,) degree of freedom of each motor
    torque_limit: np.ndarray  #: (nu,) [N·m]
    sole_body: np.ndarray  #: (nc,)
    sole_position: np.ndarray  #: (nc, 3) reference point in the foot's frame [m]
    sole_rotation: np.ndarray  #: (nc, 3, 3) sole axes in the foot's frame
    sole_vertices: np.ndarray  #: (nc,) how many rows of `sole_polygon` count
    sole_polygon: np.ndarray  #: (nc, 8, 2) counter-clockwise, sole frame [m]
    chain: np.ndarray  #: (nc, nv) dofs that move the sole, in order
    chain_length: np.ndarray  #: (nc,)
    M_rownnz: np.ndarray  #: sparse inertia matrix, lower rows (MuJoCo's CSR)
    M_rowadr: np.ndarray
    M_colind: np.ndarray
    ground_sensor: int  #: address in `sensordata`: contacts of anything with the ground
    sole_sensor: np.ndarray  #: (nc,) addresses: contacts of that foot with the ground
    surfaces: np.ndarray  #: (n,) of the terrain, see `surface_arrays`; none on level ground
    floor: float  #: height of the ground where there is no surface [m]
    edge_sensor: np.ndarray  #: (nc,) addresses: directions of that foot's contacts, on a terrain

    @property
    def units(self) -> Units:
        """The units of the robot, see `Robot`."""
        return Units(self.mass, self.gravity, self.height_com)


@dataclass(frozen=True, eq=False)
class SimViews(Block):
    """Views into one `MjData` and its model; two addresses for the C functions."""

    model_address: int
    data_address: int
    qpos: np.ndarray
    qvel: np.ndarray
    ctrl: np.ndarray
    xfrc_applied: np.ndarray
    qfrc_applied: np.ndarray
    xpos: np.ndarray
    xmat: np.ndarray
    xipos: np.ndarray
    subtree_com: np.ndarray
    cdof: np.ndarray
    cdof_dot: np.ndarray
    qfrc_bias: np.ndarray
    qfrc_passive: np.ndarray
    qfrc_constraint: np.ndarray
    M: np.ndarray
    sensordata: np.ndarray
    geom_friction: np.ndarray  # (ngeom, 3) of its model; the ground's come first
    warnings: np.ndarray  # (13,) int: each second one counts a kind of `mujoco.mjtWarning`

    def __reduce__(self) -> tuple[object, ...]:
        data = self.data  # type: ignore[attr-defined]
        return sim_views, (portable(data.model), portable(data))

    def __copy__(self) -> "SimViews":
        return self  # views can be of this data only


def robot_arrays(robot: Robot) -> RobotArrays:
    """Constants of `robot` for compiled code."""
    model, soles = robot.model, robot.soles
    nv, nc = model.nv, len(soles)
    polygons = np.zeros((nc, MAX_VERTICES, 2))
    chain, chain_length = np.zeros((nc, nv), dtype=np.int64), np.zeros(nc, dtype=np.int64)
    for i, sole in enumerate(soles):
        polygons[i, : len(sole.polygon)] = sole.polygon
        dofs = dof_chain(model, sole.body_id)
        chain[i, : len(dofs)], chain_length[i] = dofs, len(dofs)
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, robot.standing_qpos[3:7])
    return RobotArrays(
        timestep=float(model.opt.timestep),
        gravity=robot.units.gravity,
        mass=float(robot.mass),
        height_com=float(robot.height_com),
        root_body=int(robot.root_body_id),
        tree_body=int(model.body_rootid[robot.root_body_id]),
        root_standing=rotation.reshape(3, 3),
        q_standing=robot.standing_qpos[7:].copy(),
        q_min=robot.joint_range[:, 0].copy(),
        q_max=robot.joint_range[:, 1].copy(),
        motor_dofs=np.array(robot.motor_dofs, dtype=np.int64),
        torque_limit=np.array(robot.torque_limit, dtype=float),
        sole_body=np.array([sole.body_id for sole in soles], dtype=np.int64),
        sole_position=np.array([sole.position for sole in soles], dtype=float),
        sole_rotation=np.array([sole.rotation for sole in soles], dtype=float),
        sole_vertices=np.array([len(sole.polygon) for sole in soles], dtype=np.int64),
        sole_polygon=polygons,
        chain=chain,
        chain_length=chain_length,
        M_rownnz=model.M_rownnz.astype(np.int64),
        M_rowadr=model.M_rowadr.astype(np.int64),
        M_colind=model.M_colind.astype(np.int64),
        ground_sensor=int(robot.sensor_adr["ground"]),
        sole_sensor=np.array([robot.sensor_adr[sole.name] for sole in soles], dtype=np.int64),
        surfaces=surface_arrays(robot.terrain.surfaces()),
        floor=0.0 if robot.terrain.flat else robot.terrain.floor(),
        edge_sensor=np.array([robot.edge_adr.get(sole.name, 0) for sole in soles], dtype=np.int64),
    )


def sim_views(model: mujoco.MjModel, data: mujoco.MjData) -> SimViews:
    """Views into `data` under their MuJoCo names."""
    named = {field.name: getattr(data, field.name) for field in fields(SimViews)[2:-2]}
    named["geom_friction"] = model.geom_friction
    counts = data.warning.number  # with something else between any two
    every = as_strided(counts, (2 * len(counts) - 1,), (counts.strides[0] // 2,))
    views = SimViews(model._address, data._address, **named, warnings=every)
    object.__setattr__(views, "data", data)
    return views


def sole_chains(robot: RobotArrays) -> list[np.ndarray]:
    """The degrees of freedom that move each sole, in order."""
    return [chain[:n] for chain, n in zip(robot.chain, robot.chain_length, strict=True)]


def dof_chain(model: mujoco.MjModel, body: int) -> list[int]:
    """Degrees of freedom between the world and `body`, from the root outwards."""
    while model.body_dofnum[body] == 0:
        body = model.body_parentid[body]
    dof = model.body_dofadr[body] + model.body_dofnum[body] - 1
    dofs = []
    while dof >= 0:
        dofs.append(int(dof))
        dof = model.dof_parentid[dof]
    return dofs[::-1]
