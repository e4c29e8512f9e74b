"""The ground plane of a robot's world, and the sensors that count contacts with it."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco
import numpy as np

from poise.configs.errors import ConfigError, shown

from .description import OptionDescription, RobotDescription

GROUND = "ground"  # name of a plane that has none
CONTACT_SENSOR = "contact_"  # prefix of the sensors' names
ALL_BITS = 0x7FFFFFFF  # of contype and conaffinity: touches everything that collides
INTEGRATORS = {
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
}
CONES = {
    "pyramidal": mujoco.mjtCone.mjCONE_PYRAMIDAL,
    "elliptic": mujoco.mjtCone.mjCONE_ELLIPTIC,
}
SOLVERS = {
    "Newton": mujoco.mjtSolver.mjSOL_NEWTON,
    "CG": mujoco.mjtSolver.mjSOL_CG,
    "PGS": mujoco.mjtSolver.mjSOL_PGS,
}


def install_ground(spec: mujoco.MjSpec, name: str | None, source: str) -> str:
    """The name of the ground plane, which is added where the model has no plane.

    Args:
        spec: changed in place.
        name: a plane of the model, or how to call a new one; None takes the model's first plane
            that collides with anything.
        source: the description file, for errors.

    Raises:
        ConfigError: the model has planes but none with this name.
    """
    paired = {name for pair in spec.pairs for name in (pair.geomname1, pair.geomname2)}
    planes = [
        geom
        for geom in spec.worldbody.geoms
        if geom.type == mujoco.mjtGeom.mjGEOM_PLANE
        and (geom.contype or geom.conaffinity or geom.name in paired)
    ]
    if not planes:
        _add_ground(spec, name or GROUND)
        return name or GROUND
    names = [geom.name for geom in planes]
    if name is not None and name not in names:
        raise ConfigError(
            f"the model has no plane {shown(name)}", source=source, field="ground", choices=names
        )
    ground = planes[0 if name is None else names.index(name)]
    ground.name = ground.name or GROUND
    return ground.name


def check_ground(model: mujoco.MjModel, ground: int, floor: float, source: str) -> None:
    """Raise ConfigError unless the ground was the plane z = 0, now lowered to the `floor` [m]."""
    normal = np.zeros(3)
    mujoco.mju_rotVecQuat(normal, np.array([0.0, 0.0, 1.0]), model.geom_quat[ground])
    if model.geom_pos[ground, 2] != floor or normal[2] < 1.0 - 1e-9:
        raise ConfigError(
            f"the plane {model.geom(ground).name!r} must be z = 0", source=source, field="ground"
        )


def can_touch(model: mujoco.MjModel, geom: int, other: int) -> bool:
    """Return whether two geoms of a model may collide.

    They do by their contype and conaffinity, or as an explicit pair.
    """
    return bool(
        model.geom_contype[geom] & model.geom_conaffinity[other]
        or model.geom_contype[other] & model.geom_conaffinity[geom]
        or {geom, other} in [set(p) for p in zip(model.pair_geom1, model.pair_geom2, strict=True)]
    )


def contact_friction(model: mujoco.MjModel, ground: int, geoms: Iterable[int]) -> float:
    """The least sliding friction that MuJoCo gives the ground's contacts with any of `geoms`.

    An explicit contact pair has its own; otherwise the geom of higher priority decides, and
    between equals the larger coefficient counts.
    """
    return min(_pair_friction(model, geom, ground) for geom in geoms)


def _pair_friction(model: mujoco.MjModel, geom: int, other: int) -> float:
    for i in range(model.npair):
        if {int(model.pair_geom1[i]), int(model.pair_geom2[i])} == {geom, other}:
            return float(model.pair_friction[i, 0])
    friction, priority = model.geom_friction[:, 0], model.geom_priority
    if priority[geom] != priority[other]:
        return float(friction[geom if priority[geom] > priority[other] else other])
    return float(max(friction[geom], friction[other]))


def add_contact_sensors(spec: mujoco.MjSpec, description: RobotDescription, ground: str) -> None:
    """Sensors of the number of contacts with the ground: of all bodies, and of each foot."""
    found = [1, 0, 1]  # data: "found"; no reduction; one slot
    spec.add_sensor(
        name=f"{CONTACT_SENSOR}ground",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_GEOM,
        objname=ground,
        intprm=found,
    )
    for foot in description.feet:
        spec.add_sensor(
            name=CONTACT_SENSOR + foot.name,
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_XBODY,  # the foot's whole subtree
            objname=foot.body,
            reftype=mujoco.mjtObj.mjOBJ_GEOM,
            refname=ground,
            intprm=found,
        )


def set_options(spec: mujoco.MjSpec, options: OptionDescription) -> None:
    """Set time step, integrator, solver and friction; make room for rendered frames.

    What the description leaves out stays as the model has it.
    """
    spec.option.timestep = options.timestep
    spec.option.integrator = INTEGRATORS[options.integrator]
    spec.option.solver = SOLVERS[options.solver]
    if options.cone is not None:
        spec.option.cone = CONES[options.cone]
    if options.impratio is not None:
        spec.option.impratio = options.impratio
    if options.friction is not None:
        for geom in spec.geoms:
            geom.friction[0] = options.friction
        for pair in spec.pairs:
            pair.friction[:2] = options.friction
    picture = spec.visual.global_
    picture.offwidth, picture.offheight = max(picture.offwidth, 1280), max(picture.offheight, 960)


def install_daylight(spec: mujoco.MjSpec) -> None:
    """A sky and a lamp where the model has none, so that it can be seen; physics know neither."""
    if not any(t.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX for t in spec.textures):
        spec.add_texture(
            name="poise_sky",
            type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
            builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
            rgb1=[0.8, 0.87, 0.95],
            rgb2=[1.0, 1.0, 1.0],
            width=64,
            height=384,
        )
    if not spec.lights:
        spec.worldbody.add_light(name="poise_lamp", pos=[0.0, 0.0, 4.0], dir=[0.0, 0.0, -1.0])


def _add_ground(spec: mujoco.MjSpec, name: str) -> None:
    spec.add_texture(
        name="poise_ground",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.86, 0.86, 0.86],
        rgb2=[0.76, 0.76, 0.76],
        width=256,
        height=256,
    )
    material = spec.add_material(name="poise_ground", texrepeat=[1, 1], texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "poise_ground"
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 0.05],
        contype=ALL_BITS,
        conaffinity=ALL_BITS,
        condim=3,
        material="poise_ground",
    )
