"""Faults that physics show: what is not as a model's file says, and what does not rest."""

from collections.abc import Iterator, Mapping, Sequence

from .dynamics import LIGHT, Dynamics, JointDynamics
from .faults import Fault
from .standing.rest import CONTROLLER, DURATION, Rest

SHOWN = 4  # joints that a fault names
ALIKE = 0.05  # between coefficients of friction that are the same
SLIPPERY = 0.3  # a coefficient of friction below
CHATTER = 20.0  # [1/s] of a robot at rest: torques that hum
DRIFT, LEAN = 0.01, 3.0  # [m] of a foot and [°] of the root within `DURATION`
UNSOLVED = 0.01  # of the ticks


def unlike_the_file(notes: Sequence[str], model: Dynamics) -> Iterator[Fault]:
    """Faults of what was changed, of joints, friction, flags and the world."""
    for note in notes:
        yield Fault("changed", note)
    yield from _light_joints(model)
    yield from _friction(model)
    if model.disabled:
        yield Fault("flags", f"the model's flags disable {', '.join(model.disabled)}: the robot is "
                             "simulated without")  # fmt: skip
    if model.scenery:
        names = ", ".join(model.scenery[:SHOWN])
        more = f" and {len(model.scenery) - SHOWN} more" if len(model.scenery) > SHOWN else ""
        yield Fault("scenery", f"the robot may run into other parts of the world: {names}{more}; "
                               "contacts with them do not count as ground")  # fmt: skip


def _light_joints(model: Dynamics) -> Iterator[Fault]:
    light = {name: each for name, each in model.joints.items() if each.jump > LIGHT}
    bare = {name: each for name, each in model.joints.items() if each.armature == 0.0}
    if light:
        worst = dict(sorted(light.items(), key=lambda item: -item[1].jump)[:SHOWN])
        jumps = ", ".join(f"{name} ({each.jump:.2f} rad)" for name, each in worst.items())
        more = f" and {len(light) - SHOWN} more" if len(light) > SHOWN else ""
        yield Fault(
            "light joints",
            f"at full torque these turn by more than {LIGHT:g} rad within a physics step of "
            f"{1000.0 * model.timestep:g} ms: {jumps}{more}; give them the inertia of their "
            f"rotors, such as armature: {_proposed(worst)} [kg·m²]",
        )
    elif bare:
        yield Fault(
            "no armature",
            f"{len(bare)} of {len(model.joints)} motors have no rotor inertia, as a URDF file "
            f"cannot say it: give it by joint or pattern, such as armature: {_proposed(bare)} "
            "[kg·m²]",
        )


def _proposed(joints: Mapping[str, JointDynamics]) -> str:
    shown = [f"{name}: {each.proposed:g}" for name, each in list(joints.items())[:SHOWN]]
    return "{" + ", ".join(shown) + (", …}" if len(joints) > SHOWN else "}")


def _friction(model: Dynamics) -> Iterator[Fault]:
    says = {"the ground": model.friction_ground, **{
        f"the sole {name}": value for name, value in model.friction_soles.items()}}  # fmt: skip
    other = {name: value for name, value in says.items() if abs(value - model.friction) > ALIKE}
    if other:
        texts = ", ".join(f"{name} has {value:g}" for name, value in other.items())
        yield Fault(
            "friction",
            f"the soles stand on the ground with a friction of {model.friction:g}, though {texts}: "
            "MuJoCo takes the larger one, that of higher priority, of a pair or an override; "
            "options.friction sets all",
        )
    if model.friction < SLIPPERY:
        yield Fault("slippery", f"a friction of {model.friction:g} between soles and ground")


def unrest(rest: Rest, model: Dynamics) -> Iterator[Fault]:
    """Faults of a robot that does not stand still."""
    if rest.refused:
        return
    why = _why(model)
    if rest.fallen:
        yield Fault("falls", f"unpushed, it falls {rest.duration:.2f} s after the start with "
                             f"{CONTROLLER}{why}")  # fmt: skip
        return
    if rest.chatter > CHATTER:
        yield Fault("chatter", f"at rest its torques change by {rest.chatter:.0f} times their "
                               f"limits in a second{why}")  # fmt: skip
    if rest.foot_drift > DRIFT or rest.lean > LEAN:
        yield Fault("drift", f"at rest a foot drifts by {1000.0 * rest.foot_drift:.1f} mm and the "
                             f"root leans {rest.lean:.1f}° within {DURATION:g} s; options.cone: "
                             "elliptic with options.impratio: 100 holds feet better")  # fmt: skip
    if rest.unsolved > UNSOLVED * rest.ticks:
        yield Fault("unsolved", f"at rest the QP of {CONTROLLER} was not solved at {rest.unsolved} "
                                f"of {rest.ticks} ticks{why}")  # fmt: skip


def _why(model: Dynamics) -> str:
    light = any(each.jump > LIGHT or each.armature == 0.0 for each in model.joints.values())
    return ": give its joints armature" if light else ": change the posture, see the other figures"
