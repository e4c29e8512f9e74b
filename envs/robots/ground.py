"""Contacts with the ground: pairs, friction, contact sensors; options."""

from collections.abc import Iterable

import mujoco

from .description import OptionDescription, RobotDescription

OVERRIDE = int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)
#: flags of a model without which no robot stands, or is seen to
NEEDED = {name: int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name.upper()}")) for name in (
    "constraint", "contact", "gravity", "clampctrl", "actuation", "sensor")}  # fmt: skip
CONTACT_SENSOR = "contact_"  # prefix of the sensors' names
EDGE_SENSOR = "edges_"  # prefix of the sensors of contacts' directions
SLOTS = 16  # contacts of a foot that such a sensor shows
FOUND, NORMAL = 1, 32  # bits of what a contact sensor gives


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
    between equals the larger coefficient counts. A model may override all of these.
    """
    if model.opt.enableflags & OVERRIDE:
        return float(model.opt.o_friction[0])
    return min(pair_friction(model, geom, ground) for geom in geoms)


def pair_friction(model: mujoco.MjModel, geom: int, other: int) -> float:
    """The sliding friction that MuJoCo gives two geoms, but for a model that overrides it."""
    for i in range(model.npair):
        if {int(model.pair_geom1[i]), int(model.pair_geom2[i])} == {geom, other}:
            return float(model.pair_friction[i, 0])
    friction, priority = model.geom_friction[:, 0], model.geom_priority
    if priority[geom] != priority[other]:
        return float(friction[geom if priority[geom] > priority[other] else other])
    return float(max(friction[geom], friction[other]))


def add_contact_sensors(
    spec: mujoco.MjSpec, description: RobotDescription, ground: str | None
) -> None:
    """Sensors of the number of contacts with the ground: of all bodies, and of each foot.

    The ground is the plane of this name; None: all that does not move, a terrain, of whose contacts
    with a foot a further sensor has the directions.
    """
    geom, world = mujoco.mjtObj.mjOBJ_GEOM, mujoco.mjtObj.mjOBJ_BODY
    kind, name = (world, "world") if ground is None else (geom, ground)
    sensor = mujoco.mjtSensor.mjSENS_CONTACT
    counted = [FOUND, 0, 1]  # data; no reduction; one slot
    all_bodies = f"{CONTACT_SENSOR}ground"
    spec.add_sensor(name=all_bodies, type=sensor, objtype=kind, objname=name, intprm=counted)
    for foot in description.feet:  # its whole subtree
        between = {"objtype": mujoco.mjtObj.mjOBJ_XBODY, "objname": foot.body,
                   "reftype": kind, "refname": name}  # fmt: skip
        spec.add_sensor(name=CONTACT_SENSOR + foot.name, type=sensor, intprm=counted, **between)
        if ground is None:
            shown = [FOUND | NORMAL, 0, SLOTS]
            spec.add_sensor(name=EDGE_SENSOR + foot.name, type=sensor, intprm=shown, **between)


def set_options(spec: mujoco.MjSpec, options: OptionDescription) -> None:
    """Set time step, integrator, solver and friction; make room for rendered frames.

    What the description leaves out stays as the model has it.
    """
    spec.option.timestep = options.timestep
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{options.integrator.upper()}")
    spec.option.solver = getattr(mujoco.mjtSolver, f"mjSOL_{options.solver.upper()}")
    if options.cone is not None:
        spec.option.cone = getattr(mujoco.mjtCone, f"mjCONE_{options.cone.upper()}")
    if options.impratio is not None:
        spec.option.impratio = options.impratio
    if options.friction is not None:
        for geom in spec.geoms:
            geom.friction[0] = options.friction
        for pair in spec.pairs:
            pair.friction[:2] = options.friction
    picture = spec.visual.global_
    picture.offwidth, picture.offheight = max(picture.offwidth, 1280), max(picture.offheight, 960)


def switch_on(spec: mujoco.MjSpec) -> list[str]:
    """Turn on what a model's flags switch off and no robot stands without; what was changed.

    Files for inverse kinematics and for identification have such flags.
    """
    option = spec.option
    off = [name for name, bit in NEEDED.items() if option.disableflags & bit]
    notes = [f"the model's flags disable {', '.join(off)}: turned on"] if off else []
    for name in off:
        option.disableflags &= ~NEEDED[name]
    if option.disableactuator:
        notes.append("the model's option actuatorgroupdisable is left out: all motors work")
        option.disableactuator = 0
    if option.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP:
        notes.append("the model's flag sleep is left out: bodies at rest would not be simulated")
        option.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    return notes


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
