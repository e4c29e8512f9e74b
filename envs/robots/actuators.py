"""Actuators of any kind become plain torque motors: the control is the joint torque in N·m."""

import mujoco
import numpy as np

from poise.configs.errors import ConfigError

from .description import RobotDescription, match_names

# plain ints: a NumPy integer does not equal MuJoCo's enumerations
JOINT_TRANSMISSIONS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
SIMPLE_JOINTS = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))


def model_torque_limits(model: mujoco.MjModel) -> dict[str, float]:
    """Joint name → the largest torque [N·m] that the model's own limits let its actuators make.

    The smallest of the bounds that apply: ``actuatorfrcrange`` of the joint; ``forcerange`` of an
    actuator, and ``ctrlrange`` × gain of a plain motor, each times the gear. An uneven range counts
    with its smaller side. Infinite where nothing bounds it. Of several actuators on one joint (a
    position and a velocity servo, say) the strongest counts. A model without actuators, such as
    that of a URDF file, has one on each joint with ``actuatorfrcrange``.

    Raises:
        ConfigError: an actuator drives something else than a hinge or slide joint.
    """
    limits: dict[str, float] = {}
    for i in range(model.nu):
        joint = model.actuator_trnid[i, 0]
        if (
            model.actuator_trntype[i] not in JOINT_TRANSMISSIONS
            or model.jnt_type[joint] not in SIMPLE_JOINTS
        ):
            raise ConfigError(
                f"actuator {model.actuator(i).name!r} drives no hinge or slide joint",
                field="source",
            )
        name = model.joint(joint).name
        limits[name] = max(limits.get(name, 0.0), _actuator_limit(model, i))
    if model.nu == 0:
        ranged = np.flatnonzero(model.jnt_actfrclimited)
        limits = {model.joint(i).name: np.inf for i in ranged if model.jnt_type[i] in SIMPLE_JOINTS}
    for name in limits:
        joint = model.joint(name).id
        if model.jnt_actfrclimited[joint]:
            limits[name] = min(limits[name], _half_width(model.jnt_actfrcrange[joint]))
    return limits


def install_motors(spec: mujoco.MjSpec, model: mujoco.MjModel, overrides: dict[str, float]) -> None:
    """Replace all actuators by one motor of gear 1 per driven joint, in the order of the joints.

    The spec is changed in place; `model` is the spec compiled, all joints named. `overrides`, joint
    name or pattern → limit [N·m], win over the model's limits.

    Raises:
        ConfigError: nothing bounds the torque of a joint, or no joint is driven.
    """
    joints = [model.joint(i).name for i in range(model.njnt) if model.jnt_type[i] in SIMPLE_JOINTS]
    limits = model_torque_limits(model) | match_names(overrides, joints, None, "torque_limits")
    unlimited = [name for name, limit in limits.items() if not 0 < limit < np.inf]
    if unlimited:
        raise ConfigError(
            f"no torque limit in the model for {', '.join(unlimited)}; give one in N·m",
            field="torque_limits",
        )
    if not limits:
        raise ConfigError(
            "the model has no actuators; give torque limits in N·m",
            field="torque_limits",
            choices=joints,
        )
    _keep_rotor_inertia(spec, model)
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    for name in joints:
        joint = spec.joint(name)
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE  # ctrlrange is the only bound
        if name in limits:
            motor = spec.add_actuator(
                name=name,
                trntype=mujoco.mjtTrn.mjTRN_JOINT,
                target=name,
                ctrllimited=mujoco.mjtLimited.mjLIMITED_TRUE,
                ctrlrange=[-limits[name], limits[name]],
            )
            motor.set_to_motor()


def proposed_armature(limit: float, mass: float) -> float:
    """The inertia [kg·m²] of a rotor behind its gears that a motor of this strength may have.

    Motors of robots have some 3e-4 s² times their largest torque `limit` [N·m]; large torques on a
    light robot come of gears, not of rotors that heavy: at most 5e-4 m² times the robot's `mass`
    [kg]. Rounded to two digits.
    """
    return float(f"{min(3e-4 * limit, 5e-4 * mass):.1e}")


def set_passive(spec: mujoco.MjSpec, description: RobotDescription) -> None:
    """Give joints the armature, damping and friction of the description, which win.

    Raises:
        ConfigError: a pattern matches no hinge or slide joint.
    """
    joints = [joint.name for joint in spec.joints if joint.type in SIMPLE_JOINTS]
    for name, value in match_names(description.armature, joints, None, "armature").items():
        spec.joint(name).armature = value
    for name, value in match_names(description.damping, joints, None, "damping").items():
        spec.joint(name).damping[0] = value
    for name, value in match_names(description.frictionloss, joints, None, "frictionloss").items():
        spec.joint(name).frictionloss = value


def _actuator_limit(model: mujoco.MjModel, i: int) -> float:
    gear = abs(model.actuator_gear[i, 0])
    limit = np.inf
    if model.actuator_forcelimited[i]:
        limit = _half_width(model.actuator_forcerange[i]) * gear
    is_motor = (
        model.actuator_gaintype[i] == int(mujoco.mjtGain.mjGAIN_FIXED)
        and model.actuator_biastype[i] == int(mujoco.mjtBias.mjBIAS_NONE)
        and model.actuator_dyntype[i] == int(mujoco.mjtDyn.mjDYN_NONE)
    )
    if is_motor and model.actuator_ctrllimited[i]:
        gain = abs(model.actuator_gainprm[i, 0])
        limit = min(limit, _half_width(model.actuator_ctrlrange[i]) * gain * gear)
    return limit


def _half_width(limits: np.ndarray) -> float:
    return float(max(0.0, min(-limits[0], limits[1])))


def _keep_rotor_inertia(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Rotor inertia and damping that newer MuJoCo models carry in the actuator go to the joint."""
    for i in range(model.nu):
        joint = spec.joint(model.joint(model.actuator_trnid[i, 0]).name)
        gear = model.actuator_gear[i, 0]
        if hasattr(model, "actuator_armature"):
            joint.armature += gear**2 * float(model.actuator_armature[i])
        if hasattr(model, "actuator_damping"):
            joint.damping[0] += gear**2 * float(model.actuator_damping[i])
