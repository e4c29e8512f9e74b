"""A robot: a floating-base biped, compiled from its description for everything built on it."""

import hashlib
import shlex
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np

from poise.configs.errors import ConfigError, PoiseWarning, below, naming
from poise.configs.files import resolve
from poise.configs.schema import build, read_yaml
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.maths.pendulum import Units
from poise.envs.terrain.building import build_terrain
from poise.envs.terrain.flat import Flat
from poise.envs.terrain.terrain import Terrain

from .actuators import install_motors, set_passive
from .description import RobotDescription
from .floors import add_paired_ground, check_ground, check_scenery, install_ground
from .ground import (
    CONTACT_SENSOR,
    EDGE_SENSOR,
    add_contact_sensors,
    install_daylight,
    set_options,
    switch_on,
)
from .guess import MODELS, guess
from .menagerie import model_file, ros_file
from .model_check import check_bodies, check_numbers
from .models.humanoid import humanoid_spec
from .models.mjcf import pointing_to_scenes, read_mjcf
from .models.mjcf_bounds import bound_cache
from .models.urdf import read_urdf
from .soles import Sole, find_sole_plane, sole_frame, sole_geoms, sole_pose
from .standing import Stance, described_qpos

BUILDERS = {"humanoid": humanoid_spec}
TOUCH = 1e-9  # [m] by which the soles stand below z = 0, so that rounding loses no contact
DYNAMICS = (  # arrays of the model that its motion depends on
    *("body_parentid", "body_pos", "body_quat", "body_mass", "body_inertia", "body_ipos"),
    *("body_iquat", "jnt_type", "jnt_bodyid", "jnt_pos", "jnt_axis", "jnt_limited", "jnt_range"),
    *("jnt_stiffness", "qpos_spring", "dof_damping", "dof_armature", "dof_frictionloss"),
    *("geom_type", "geom_bodyid", "geom_contype", "geom_conaffinity", "geom_condim", "geom_pos"),
    *("geom_quat", "geom_size", "geom_friction", "geom_margin", "geom_solref", "geom_solimp"),
    *("geom_priority", "body_gravcomp", "actuator_trnid", "actuator_ctrlrange"),
)
CONTACTS = (  # the same of contacts that a model lists one by one, or rules out
    *("pair_geom1", "pair_geom2", "pair_dim", "pair_friction", "pair_margin", "pair_gap"),
    *("pair_solref", "pair_solreffriction", "pair_solimp", "exclude_signature"),
)


@dataclass(frozen=True, eq=False)
class Robot(Copyable):
    """A biped and what does not change while it moves.

    Every actuator of ``model`` is a torque motor on one joint: ``data.ctrl`` is the joint torque in
    N·m. The free joint has the first seven entries of qpos and the first six of qvel.

    Attributes:
        name: the robot's name.
        description: what it was built from.
        model: the compiled MuJoCo model.
        mass: total mass [kg].
        height_com: height of the centre of mass above the ground in the standing posture [m].
        com_ahead: how far the centre of mass then is ahead of the middle of the soles [m].
        root_body_id: the floating body.
        ground_geom_id: the ground plane, z = 0, or the floor below a terrain.
        soles: one per foot, in the description's order.
        standing_qpos: (nq,) standing posture: soles flat on the ground, the mean of their
            reference points at (0, 0), facing +x.
        joint_names: (nv - 6) names of the hinge and slide joints in the order of the dofs.
        joint_range: (nv - 6, 2) limits [rad] or [m], infinite where there are none.
        motor_dofs: (nu,) dof that each motor drives, ascending.
        torque_limit: (nu,) largest torque of each motor [N·m].
        sensor_adr: address in ``data.sensordata`` of the number of contacts with the ground, by
            foot name; ``"ground"`` counts all contacts with it. What the feet leave of it is
            contact of other bodies.
        fingerprint: hash of all that the dynamics depend on, but for the terrain.
        keyframes: name → (nq,) qpos of the keyframes that the model came with.
        source: the file of the description.
        terrain: what it stands on.
        edge_adr: address of the directions of contacts, by foot name; on level ground none.
        notes: changes to the model that made it simulable, a sentence each.
    """

    name: str
    description: RobotDescription
    model: mujoco.MjModel
    mass: float
    height_com: float
    com_ahead: float
    root_body_id: int
    ground_geom_id: int
    soles: tuple[Sole, ...]
    standing_qpos: np.ndarray
    joint_names: tuple[str, ...]
    joint_range: np.ndarray
    motor_dofs: np.ndarray
    torque_limit: np.ndarray
    sensor_adr: dict[str, int]
    fingerprint: str
    keyframes: dict[str, np.ndarray]
    source: str
    terrain: Terrain
    edge_adr: dict[str, int]
    notes: tuple[str, ...] = ()

    @property
    def motor_names(self) -> tuple[str, ...]:
        """The names of the motors, in the order of `motor_dofs` (nu,)."""
        return tuple(self.model.actuator(i).name for i in range(self.model.nu))

    @property
    def units(self) -> Units:
        """The robot's mass, gravity and standing height, and what follows from them."""
        return Units(self.mass, -float(self.model.opt.gravity[2]), self.height_com)

    @property
    def omega(self) -> float:
        """ω = √(g/h) of the standing robot [1/s]."""
        return self.units.omega


def load_robot(name_or_path: str | Path = "humanoid") -> Robot:
    """Build a robot from a packaged description (``humanoid``) or a path to a ``.yaml`` file.

    An MJCF or URDF file does as well where `guess` is sure of all that a description says.

    Raises:
        ConfigError: no such robot; the description or its MJCF is not valid, or does not fit the
            other. The text names the file, the field and the valid choices.
    """
    return _load(resolve("robots", name_or_path), Flat())


def on_terrain(robot: Robot, terrain: Terrain) -> Robot:
    """The same robot on another terrain; itself, where it is on that one.

    Masses, friction and time step that differ from the described ones stay.

    Raises ConfigError as `load_robot` does: the robot's file is read again.
    """
    if terrain == robot.terrain or (terrain.flat and robot.terrain.flat):
        return robot
    moved = _load(Path(robot.source), terrain, robot.description)
    _keep_variation(robot.model, moved.model)
    kept = ("name", "mass", "fingerprint")
    return replace(moved, **{name: getattr(robot, name) for name in kept})


def in_physics_of(robot: Robot, description: RobotDescription) -> Robot:
    """The same robot with the simulation options of a description.

    Raises ConfigError as `load_robot` does: the robot's file is read again.
    """
    described = replace(robot.description, options=description.options)
    return _load(Path(robot.source), robot.terrain, described)


def _keep_variation(old: mujoco.MjModel, new: mujoco.MjModel) -> None:
    """Let a model be like another one of the same bodies in what variants change."""
    new.opt.timestep = old.opt.timestep
    first, of_old = new.body_geomnum[0], old.body_geomnum[0]
    new.geom_friction[first:] = old.geom_friction[of_old:]
    new.geom_friction[:first] = old.geom_friction[0]
    if not np.array_equal(new.body_mass, old.body_mass):
        new.body_mass[:], new.body_inertia[:] = old.body_mass, old.body_inertia
        mujoco.mj_setConst(new, mujoco.MjData(new))


def read_description(path: Path) -> RobotDescription:
    """The description in a ``.yaml`` file, or what is guessed from a model; a warning says that."""
    if path.suffix.lower() not in MODELS:
        return build(RobotDescription, read_yaml(path), str(path))
    description = guess(path)
    feet = " and ".join(repr(foot.body) for foot in description.feet)
    posture = description.posture
    start = f"keyframe {posture.keyframe!r}" if posture.keyframe else "the zero posture"
    bent = " with bent legs" if posture.joints else ""
    warnings.warn(
        f"{path}: without a description; guessed: root {description.root!r}, feet {feet}, "
        f"posture {start}{bent}; poise robot {shlex.quote(str(path))} writes the description",
        PoiseWarning,
        stacklevel=4,
    )
    return description


def _load(path: Path, terrain: Terrain, description: RobotDescription | None = None) -> Robot:
    with naming(path):
        description = description or read_description(path)
        file = model_file(description.source, path)
        spec, keyframes, ground_name, notes = _prepare(description, path, file, terrain)
        model = _compile(spec, file)
        ground = model.geom(ground_name).id
        data, soles = _stand(model, description, keyframes, ground, file)
        if terrain.flat:
            check_scenery(model, data, ground)
    root = model.body(description.root).id
    limited = model.jnt_limited[1:, None].astype(bool)
    standing_qpos = data.qpos.copy()
    robot = Robot(
        name=description.name,
        description=description,
        model=model,
        mass=float(model.body_subtreemass[root]),
        height_com=float(data.subtree_com[root, 2]),
        com_ahead=float(data.subtree_com[root, 0]),
        root_body_id=root,
        ground_geom_id=ground,
        soles=soles,
        standing_qpos=standing_qpos,
        joint_names=tuple(model.joint(i).name for i in range(1, model.njnt)),
        joint_range=np.where(limited, model.jnt_range[1:], [-np.inf, np.inf]),
        motor_dofs=model.jnt_dofadr[model.actuator_trnid[:, 0]].copy(),
        torque_limit=model.actuator_ctrlrange[:, 1].copy(),
        sensor_adr={
            name: int(model.sensor(CONTACT_SENSOR + name).adr[0])
            for name in ("ground", *(foot.name for foot in description.feet))
        },
        fingerprint=fingerprint(model, standing_qpos),
        keyframes=keyframes,
        source=str(path),
        terrain=terrain,
        edge_adr={
            foot.name: int(model.sensor(EDGE_SENSOR + foot.name).adr[0])
            for foot in description.feet
            if not terrain.flat
        },
        notes=tuple(notes),
    )
    constant = (standing_qpos, robot.joint_range, robot.motor_dofs, robot.torque_limit)
    for array in (*keyframes.values(), *constant):
        array.setflags(write=False)
    return robot


def _stand(
    model: mujoco.MjModel,
    description: RobotDescription,
    keyframes: dict[str, np.ndarray],
    ground: int,
    file: Path | None,
) -> tuple[mujoco.MjData, tuple[Sole, ...]]:
    """The standing posture, and the soles in it; `file` is the model's, for what errors advise."""
    data, root = mujoco.MjData(model), model.body(description.root).id
    bodies = [model.body(foot.body).id for foot in description.feet]
    with pointing_to_scenes(file, "key"):
        data.qpos[:] = described_qpos(model, description, keyframes)
    mujoco.mj_kinematics(model, data)
    check_ground(model, ground)
    geoms, planes = [], []
    for i, foot in enumerate(description.feet):
        with below(f"feet[{i}]"):
            with pointing_to_scenes(file, "pair"):
                geoms.append(sole_geoms(model, bodies[i], foot.geoms, ground))
            planes.append(find_sole_plane(model, data, bodies[i], geoms[i]))
    stance = Stance(model, data, root, bodies, planes)
    stance.level_soles()
    if description.posture.com == "middle":
        stance.centre_com()
    stance.turn_forward(description.forward)
    soles = tuple(
        Sole(
            foot.name, foot.body, bodies[i], geoms[i], *sole_frame(planes[i], data.xmat[bodies[i]])
        )
        for i, foot in enumerate(description.feet)
    )
    data.qpos[:3] -= np.mean([sole_pose(data, sole)[0] for sole in soles], axis=0)
    data.qpos[2] -= TOUCH
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    height = data.subtree_com[root, 2]
    if not 0.0 < height < np.inf:
        raise ConfigError(
            f"the centre of mass would be at {height:g} m, not above the ground", field="posture"
        )
    return data, soles


def fingerprint(model: mujoco.MjModel, standing_qpos: np.ndarray) -> str:
    """SHA-256 (hexadecimal) of the dynamics and the standing posture, rounded to six digits.

    Looks, names and the versions of libraries do not enter.
    """
    digest = hashlib.sha256()
    names = DYNAMICS + CONTACTS if model.npair or model.nexclude else DYNAMICS
    for array in [*(getattr(model, name) for name in names), standing_qpos]:
        rounded = np.round(np.asarray(array, dtype=float), 6) + 0.0  # + 0.0: no negative zeros
        digest.update(repr(rounded.tolist()).encode())
    options = ("timestep", "integrator", "solver", "cone", "gravity", "disableflags")
    for name in options if model.opt.impratio == 1.0 else (*options, "impratio"):
        digest.update(repr(np.asarray(getattr(model.opt, name), dtype=float).tolist()).encode())
    return digest.hexdigest()


def _prepare(
    description: RobotDescription, path: Path, file: Path | None, terrain: Terrain
) -> tuple[mujoco.MjSpec, dict[str, np.ndarray], str, list[str]]:
    """The model with motors, ground, sensors and options; its keyframes; the ground's name; what
    was changed."""
    bound_cache()
    spec = _read(description, path, file)
    for i, joint in enumerate(spec.joints):
        joint.name = joint.name or f"joint{i}"
    add_paired_ground(spec, description.ground)
    model = _compile(spec, file)
    check_numbers(model, DYNAMICS + CONTACTS)
    check_bodies(model, description)
    ground, notes = install_ground(spec, model, description.ground)
    install_daylight(spec)
    keyframes = {model.key(i).name: model.key_qpos[i].copy() for i in range(model.nkey)}
    for element in [*spec.keys, *spec.sensors]:  # they need not fit the new actuators
        spec.delete(element)
    install_motors(spec, model, description.torque_limits)
    set_passive(spec, description)
    notes += switch_on(spec)
    if not terrain.flat:
        build_terrain(spec, terrain, ground)
    add_contact_sensors(spec, description, ground if terrain.flat else None)
    set_options(spec, description.options)
    for note in notes:
        warnings.warn(f"{path}: {note}", PoiseWarning, stacklevel=4)
    return spec, keyframes, ground, notes


def _read(description: RobotDescription, path: Path, file: Path | None) -> mujoco.MjSpec:
    """The model as it comes from its file, or from its builder."""
    origin = description.source
    if file is None:
        return BUILDERS[str(origin.builder)]()
    if origin.urdf is not None:
        srdf = None if origin.srdf is None else ros_file(origin.srdf, path, "source.srdf")
        return read_urdf(file, srdf)
    return read_mjcf(file, tuple(foot.body for foot in description.feet))


def _compile(spec: mujoco.MjSpec, file: Path | None) -> mujoco.MjModel:
    try:
        return spec.compile()
    except Exception as error:  # whatever MuJoCo has
        model = f"the model {file}" if file else "the model"  # MuJoCo names a line of that file
        raise ConfigError(f"{model} does not compile: {error}", field="source") from None
