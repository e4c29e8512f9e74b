"""The standard MuJoCo humanoid with ankles, built from Gymnasium's own ``humanoid.xml``."""

from pathlib import Path

import gymnasium
import mujoco

ANKLE_TORQUE = 20.0  # [N·m]
FOOT_POS = (0.0, 0.0, -0.39)  # in the shin frame [m]
SOLE_HALF_SIZE = (0.13, 0.04, 0.015)  # [m]
SOLE_POS = (0.035, 0.0, -0.012)  # centre in the foot frame [m]: the sole plane is 27 mm below it
FOOT_MASS = 1.16  # [kg]: that of the standard humanoid's two-capsule foot
# name, position, axis, stiffness [N·m/rad]: all other ankle parameters are common
ANKLE_JOINTS = (
    ("ankle_y", (0.0, 0.0, 0.08), (0.0, 1.0, 0.0), 6.0),
    ("ankle_x", (0.0, 0.0, 0.04), (1.0, 0.0, 0.5), 3.0),
)


def humanoid_path() -> Path:
    """The ``humanoid.xml`` that is installed with Gymnasium."""
    return Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "humanoid.xml"


def humanoid_spec() -> mujoco.MjSpec:
    """Gymnasium's humanoid with box soles on two-axis ankles; 27 dofs, 21 motors, 40.9 kg.

    The sphere feet (no support polygon, no centre of pressure) give way to flat boxes of
    0.26 m × 0.08 m, driven by ankle motors of ±20 N·m. Fixed tendons, which carry no force here,
    are removed. All geoms touch with three contact dimensions and without a margin.
    """
    spec = mujoco.MjSpec.from_file(str(humanoid_path()))
    for tendon in list(spec.tendons):
        spec.delete(tendon)
    for side in ("right", "left"):
        _replace_foot(spec, side)
    for geom in spec.geoms:
        geom.condim = 3
        geom.margin = 0.0  # with a margin the soles would stand a millimetre above the floor
    return spec


def _replace_foot(spec: mujoco.MjSpec, side: str) -> None:
    foot = spec.body(f"{side}_foot")
    spec.delete(spec.geom(f"{side}_foot"))
    foot.pos = FOOT_POS
    mirror = 1.0 if side == "right" else -1.0
    for name, pos, axis, stiffness in ANKLE_JOINTS:
        sign = mirror if name == "ankle_x" else 1.0  # the same angle tilts both soles alike
        foot.add_joint(
            name=f"{side}_{name}",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            pos=pos,
            axis=[sign * axis[0], axis[1], sign * axis[2]],
            range=[-50.0, 50.0],  # [degree], the unit of humanoid.xml
            limited=True,
            damping=0.2,
            armature=0.01,
            stiffness=stiffness,
        )
        motor = spec.add_actuator(
            name=f"{side}_{name}",
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            target=f"{side}_{name}",
            ctrllimited=True,
            ctrlrange=[-ANKLE_TORQUE, ANKLE_TORQUE],
        )
        motor.set_to_motor()
    foot.add_geom(  # for the eye only: joins the shin to the sole
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[0.0, 0.0, 0.08, 0.0, 0.0, 0.0],
        size=[0.03, 0.0, 0.0],
        mass=0.0,
        contype=0,
        conaffinity=0,
    )
    foot.add_geom(
        name=f"{side}_sole",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=SOLE_HALF_SIZE,
        pos=SOLE_POS,
        mass=FOOT_MASS,
    )
