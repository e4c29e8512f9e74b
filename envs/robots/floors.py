"""The floor of a robot's world: of whatever a model has, one level plane, z = 0."""

import mujoco
import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.envs.terrain.building import ALIKE

from .models.missing import paired_geoms

GROUND = "ground"  # name of a plane that has none
FLOOR = 0.5  # [m] half of the least side of a box that is taken for a floor
TOUCHED = 1e-6  # [m] between bodies that touch
PLANE, BOX = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_BOX
FLAT = {BOX: 2, mujoco.mjtGeom.mjGEOM_CYLINDER: 1}  # kind of a floor → its size that is upwards
ALL_BITS = 0x7FFFFFFF  # of contype and conaffinity: touches everything that collides


def install_ground(
    spec: mujoco.MjSpec, model: mujoco.MjModel, name: str | None
) -> tuple[str, list[str]]:
    """The name of the ground plane, and what was changed for it.

    A model without a floor gets a plane. A level box or cylinder gives way to a plane at its upper
    side; a floor at another height than 0 is moved there, with all else that does not move.

    Args:
        spec: changed in place.
        model: the spec compiled.
        name: a floor of the model, or how to call a new one; None takes the model's first plane
            that collides with anything, else the level box below the origin.

    Raises:
        ConfigError: the model has floors but none with this name.
    """
    floors = _floors(spec, model)
    planes = [geom for geom in floors if geom.type == PLANE]
    below = [geom for geom in floors if _covers(model, geom.id)]
    chosen = [geom for geom in floors if geom.name == name] if name else planes or below[:1]
    if not chosen and name is not None and (planes or below):
        problem = f"the model has no plane and no level box {shown(name)}"
        raise ConfigError(problem, field="ground", choices=[geom.name for geom in floors])
    if not chosen:
        _add_ground(spec, name or GROUND)
        return name or GROUND, []
    floor, notes = chosen[0], []
    floor.name = floor.name or GROUND
    height = _top(model, floor.id)
    if height != 0.0:
        notes.append(f"the floor {floor.name!r} is at z = {height:g} m: it is moved to 0, and "
                     "with it all that does not move")  # fmt: skip
        _lower(spec, model, height)
    ground = floor
    if floor.type != PLANE or floor.parent.name != "world":
        notes.append(f"the floor {floor.name!r} is no plane of the world ({_kind(model, floor.id)} "
                     f"of the body {floor.parent.name!r}): an endless plane takes its place, with "
                     "its friction")  # fmt: skip
        ground = _replace(spec, floor)
    for other in planes:
        if other.name != floor.name and _top(model, other.id) == height:
            notes.append(f"the plane {other.name!r} is as high as {floor.name!r}: it collides no "
                         "more")  # fmt: skip
            other.contype = other.conaffinity = 0
    return ground.name, notes


def add_paired_ground(spec: mujoco.MjSpec, name: str | None) -> None:
    """Add the plane of this name where only contact pairs of the model name it."""
    if name in paired_geoms(spec) and name not in {geom.name for geom in spec.geoms}:
        _add_ground(spec, str(name))


def _replace(spec: mujoco.MjSpec, floor: mujoco.MjsGeom) -> mujoco.MjsGeom:
    """A plane z = 0 that is like a floor, which itself collides no more."""
    plane = spec.worldbody.add_geom(name=f"{floor.name}_plane", type=PLANE, size=[0.0, 0.0, 0.05])
    for attribute in (*ALIKE, "material", "rgba"):
        setattr(plane, attribute, getattr(floor, attribute))
    for pair in spec.pairs:
        if pair.geomname1 == floor.name:
            pair.geomname1 = plane.name
        if pair.geomname2 == floor.name:
            pair.geomname2 = plane.name
    floor.contype = floor.conaffinity = 0
    return plane


def _floors(spec: mujoco.MjSpec, model: mujoco.MjModel) -> list[mujoco.MjsGeom]:
    """Planes, level boxes and cylinders that do not move and collide with anything."""
    paired = paired_geoms(spec)
    return [
        geom
        for geom in spec.geoms
        if geom.type in (PLANE, *FLAT)
        and model.body_weldid[model.geom_bodyid[geom.id]] == 0
        and (geom.contype or geom.conaffinity or geom.name in paired)
        and ((geom.type == PLANE and geom.parent.name == "world") or _level(model, geom.id))
    ]


def _placed(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return data


def _level(model: mujoco.MjModel, geom: int) -> bool:
    return bool(_placed(model).geom_xmat[geom, 8] > 1.0 - 1e-9)


def _top(model: mujoco.MjModel, geom: int) -> float:
    """The height of a level plane, or of the upper side of a box or a cylinder [m]."""
    column = FLAT.get(mujoco.mjtGeom(int(model.geom_type[geom])))
    thickness = 0.0 if column is None else model.geom_size[geom, column]
    return float(np.round(_placed(model).geom_xpos[geom, 2] + thickness, 12))


def _covers(model: mujoco.MjModel, geom: int) -> bool:
    """Whether a box or a cylinder is as large as a floor, and below the origin."""
    if mujoco.mjtGeom(int(model.geom_type[geom])) not in FLAT:
        return False
    half = model.geom_size[geom, [0, 1 if model.geom_type[geom] == BOX else 0]]
    return bool(np.all(half >= FLOOR) and np.all(np.abs(_placed(model).geom_xpos[geom, :2]) < half))


def _lower(spec: mujoco.MjSpec, model: mujoco.MjModel, height: float) -> None:
    for geom in spec.worldbody.geoms:
        geom.pos[2] -= height
    for body in spec.worldbody.bodies:
        if model.body_weldid[body.id] == 0:
            body.pos[2] -= height


def check_ground(model: mujoco.MjModel, ground: int) -> None:
    """Raise ConfigError unless the ground is a level plane."""
    if not _level(model, ground):
        raise ConfigError(
            f"the plane {model.geom(ground).name!r} must be z = 0, level: it slopes; name another "
            "floor, or leave it out of the model",
            field="ground",
        )


def check_scenery(model: mujoco.MjModel, data: mujoco.MjData, ground: int) -> None:
    """Raise ConfigError if the robot, where it is to stand, touches another part of the world than
    the ground: its contacts would count for nothing, or throw it."""
    mujoco.mj_collision(model, data)
    for contact in data.contact[: data.ncon]:
        fixed = [g for g in contact.geom if model.body_weldid[model.geom_bodyid[g]] == 0]
        if fixed and fixed[0] != ground and contact.dist < TOUCHED:
            geom, kind = model.geom(fixed[0]), mujoco.mjtGeom(int(model.geom_type[fixed[0]]))
            floor = kind == PLANE or kind in FLAT
            advice = "name that one as the ground if it is level" if floor else (
                "take a scene with a plane"
            )  # fmt: skip
            raise ConfigError(
                f"standing on {model.geom(ground).name!r}, the robot touches "
                f"{geom.name or 'a geom without a name'!r} ({_kind(model, fixed[0])}), "
                f"{-1000.0 * contact.dist:.0f} mm deep: {advice}, or name the robot's own file "
                "instead of a scene",
                field="ground",
            )


def _kind(model: mujoco.MjModel, geom: int) -> str:
    return mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()


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
