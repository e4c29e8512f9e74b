"""Faults of a robot that will keep it from standing or walking, and their remedies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .dynamics import LIGHT, Dynamics, JointDynamics
from .standing.pushed import SHARE, Pushed
from .standing.rest import CONTROLLER, DURATION
from .uses import STEPPING

if TYPE_CHECKING:
    from .check import RobotCheck

SHOWN = 4  # joints that a fault names
ALIKE = 0.05  # between coefficients of friction that are the same
SLIPPERY = 0.3  # a coefficient of friction below
PAIRS = 3  # of bodies that a fault names
POINTS = 3  # at which a sole must touch the ground to stand flat
NEAR = 0.15  # of the support in a direction and its opposite: a CoM closer to an edge
STRAIGHT = 10.0  # [deg] a knee that is bent less
CHATTER = 20.0  # [1/s] of a robot at rest: torques that hum
DRIFT, LEAN = 0.01, 3.0  # [m] of a foot and [°] of the root within `DURATION`
UNSOLVED = 0.01  # of the ticks


@dataclass(frozen=True)
class Fault:
    """A fault of a robot description.

    Attributes:
        kind: what it is, in a word or two.
        text: what is wrong and what helps, one line.
        stepping: whether it matters only where feet move.
    """

    kind: str
    text: str
    stepping: bool = False


def find_faults(check: RobotCheck) -> Iterator[Fault]:
    """The faults that figures of a check show: of the model, as it stands, on its legs, at rest."""
    yield from _motors(check)
    for note in check.notes:
        yield Fault("changed", note)
    yield from _light_joints(check.dynamics)
    yield from _friction(check.dynamics)
    yield from _world(check.dynamics)
    yield from _self_contacts(check)
    yield from _soles(check)
    yield from _support(check)
    yield from _both_feet(check)
    yield from _knees(check)
    yield from _ankles(check)
    yield from _one_foot(check)
    yield from _slow_legs(check)
    yield from _unrest(check)
    yield from _pushed(check.pushed)


def _first(texts: Sequence[str], most: int) -> str:
    more = f" and {len(texts) - most} more" if len(texts) > most else ""
    return ", ".join(texts[:most]) + more


def _motors(check: RobotCheck) -> Iterator[Fault]:
    left, right = (leg.joints for leg in check.legs)
    if len(left) != len(right):
        return
    bare = set(check.without_motor)
    pairs = [*zip(left, right, strict=True), *zip(right, left, strict=True)]
    if missing := [f"{a} (its twin {b} has one)" for a, b in pairs if a in bare and b not in bare]:
        yield Fault(
            "no motor",
            f"{_first(missing, SHOWN)}: give the model an actuator, or the joint a limit in "
            "torque_limits",
        )


def _light_joints(model: Dynamics) -> Iterator[Fault]:
    light = {name: each for name, each in model.joints.items() if each.jump > LIGHT}
    bare = {name: each for name, each in model.joints.items() if each.armature == 0.0}
    if light:
        worst = dict(sorted(light.items(), key=lambda item: -item[1].jump))
        jumps = _first([f"{name} ({each.jump:.2f} rad)" for name, each in worst.items()], SHOWN)
        shown = dict(list(worst.items())[:SHOWN])
        yield Fault(
            "light joints",
            f"at full torque these turn by more than {LIGHT:g} rad within a physics step of "
            f"{1000.0 * model.timestep:g} ms: {jumps}; give them the inertia of their rotors, such "
            f"as armature: {_proposed(shown)} [kg·m²]",
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


def _world(model: Dynamics) -> Iterator[Fault]:
    if model.disabled:
        yield Fault("flags", f"the model's flags disable {', '.join(model.disabled)}: the robot is "
                             "simulated without")  # fmt: skip
    if model.scenery:
        yield Fault("scenery", "the robot may run into other parts of the world: "
                               f"{_first(model.scenery, SHOWN)}; contacts with them do not count "
                               "as ground")  # fmt: skip


def _self_contacts(check: RobotCheck) -> Iterator[Fault]:
    for kind, meshes in (("self-collision", False), ("overlapping meshes", True)):
        touching = [each for each in check.self_contacts if each.meshes == meshes]
        if touching:
            pairs = [f"{c.bodies[0]} and {c.bodies[1]} ({1000 * c.depth:.1f} mm)" for c in touching]
            why = "convex hulls of meshes are what collides; " if meshes else ""
            yield Fault(
                kind,
                f"standing, these are inside each other: {_first(pairs, PAIRS)}; {why}change the "
                "posture, the shapes, or exclude the pairs in the model (contact, exclude)",
            )


def _soles(check: RobotCheck) -> Iterator[Fault]:
    few = {foot: count for foot, count in check.sole_contacts.items() if count < POINTS}
    if few:
        counts = ", ".join(f"{foot} at {count}" for foot, count in few.items())
        yield Fault(
            "few contacts",
            f"standing, soles touch the ground at fewer than {POINTS} points ({counts}) and rock: "
            "of a mesh a few of its lowest points touch; make soles of boxes, capsules or spheres",
        )


def _support(check: RobotCheck) -> Iterator[Fault]:
    worst = min(check.directions, key=lambda each: each.margin)
    opposite = (worst.direction + 180.0) % 360.0
    across = worst.margin + sum(d.margin for d in check.directions if d.direction == opposite)
    if worst.margin == 0.0:
        yield Fault("CoM", "standing, the CoM is not above the soles: change the posture, or say "
                           "posture.com: middle")  # fmt: skip
    elif worst.margin < NEAR * across:
        yield Fault(
            "CoM near an edge",
            f"standing, the CoM is {1000.0 * worst.margin:.0f} mm from the edge of the soles at "
            f"{worst.direction:g}° from ahead, of {1000.0 * across:.0f} mm across: change the "
            "posture, or say posture.com: middle",
        )


def _both_feet(check: RobotCheck) -> Iterator[Fault]:
    holding = check.both_feet
    if holding.torque_fraction is None:
        yield Fault("torque", "no forces of the ground hold the standing posture at rest")
    elif not holding.possible:
        yield Fault(
            "torque",
            f"the standing posture asks {holding.torque_fraction:.0%} of the torque limit of "
            f"{holding.joint}: change the posture or torque_limits",
        )


def _knees(check: RobotCheck) -> Iterator[Fault]:
    bends = {leg.knee: leg.knee_bend for leg in check.legs if leg.knee_bend is not None}
    straight = [f"{knee} ({bend:.0f}°)" for knee, bend in bends.items() if bend < STRAIGHT]
    if straight:
        yield Fault(
            "straight knees",
            f"{', '.join(straight)}: a straight leg neither lengthens nor lifts its foot at once; "
            "bend knees by 20° or more in posture.joints",
            stepping=True,
        )


def _ankles(check: RobotCheck) -> Iterator[Fault]:
    for what, axis, found in (
        ("pitch", "fore and aft", [leg.foot for leg in check.legs if not leg.ankle_pitch]),
        ("roll", "sideways", [leg.foot for leg in check.legs if not leg.ankle_roll]),
    ):
        if found:
            yield Fault(
                f"no ankle {what}",
                f"no joint of the ankle turns the foot {', '.join(found)} in {what}: on one foot "
                f"the CoP moves {axis} only as the whole leg tilts",
                stepping=True,
            )


def _one_foot(check: RobotCheck) -> Iterator[Fault]:
    if far := [foot for foot, holding in check.one_foot.items() if holding is None]:
        yield Fault(
            "one foot",
            f"no posture was found with the CoM over the foot {', '.join(far)} alone: single "
            "support is a fall to the other side, and steps must be quick",
            stepping=True,
        )
    for foot, holding in check.one_foot.items():
        if holding is not None and not holding.possible:
            fraction = holding.torque_fraction
            asks = "more than the ground gives" if fraction is None else (
                f"{fraction:.0%} of the torque limit of {holding.joint}"
            )  # fmt: skip
            yield Fault("one foot", f"to stand on {foot} alone asks {asks}", stepping=True)


def _slow_legs(check: RobotCheck) -> Iterator[Fault]:
    if names := check.controllers[STEPPING].never_step:
        yield Fault(
            "slow legs",
            "against the damping of their joints the motors do not lift a foot and set it down in "
            f"the longest step of {', '.join(names)}: feet stay fixed with these",
            stepping=True,
        )


def _unrest(check: RobotCheck) -> Iterator[Fault]:
    rest, joints = check.rest, check.dynamics.joints.values()
    if rest.refused:
        return
    light = any(each.jump > LIGHT or each.armature == 0.0 for each in joints)
    why = "give its joints armature" if light else "change the posture, see the other figures"
    if rest.fallen:
        yield Fault("falls", f"unpushed, it falls {rest.duration:.2f} s after the start with "
                             f"{CONTROLLER}: {why}")  # fmt: skip
        return
    if rest.chatter > CHATTER:
        yield Fault("chatter", f"at rest its torques change by {rest.chatter:.0f} times their "
                               f"limits in a second: {why}")  # fmt: skip
    if rest.foot_drift > DRIFT or rest.lean > LEAN:
        holds = "options.cone: elliptic with options.impratio: 100 holds feet better"
        if check.self_contacts:
            holds = "bodies that are inside each other push it"
        elif rest.foot_drift <= DRIFT:
            holds = why
        yield Fault("drift", f"at rest a foot drifts by {1000.0 * rest.foot_drift:.1f} mm and the "
                             f"root leans {rest.lean:.1f}° within {DURATION:g} s; "
                             f"{holds}")  # fmt: skip
    if rest.unsolved > UNSOLVED * rest.ticks:
        yield Fault("unsolved", f"at rest the QP of {CONTROLLER} was not solved at {rest.unsolved} "
                                f"of {rest.ticks} ticks: {why}")  # fmt: skip


def _pushed(pushed: Pushed) -> Iterator[Fault]:
    if pushed.falls:
        shown = _first([f"{angle:g}°" for angle in pushed.falls], SHOWN)
        yield Fault(
            "pushed",
            f"pushed by {SHARE:g} of its ankle limit it falls in {len(pushed.falls)} of "
            f"{pushed.trials} directions ({shown}): {pushed.cause}; see the figures of torques, "
            "joints and posture before any controller or gain is blamed",
        )
