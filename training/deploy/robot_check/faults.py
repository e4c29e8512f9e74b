"""Faults of a robot that will keep it from standing or walking, and their remedies."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from poise.envs.physics.legs import Leg

from .standing.holding import Holding
from .standing.stability import DirectionFigures
from .touching import SelfContact

STRAIGHT = 10.0  # [deg] a knee that is bent less
POINTS = 3  # at which a sole must touch the ground to stand flat
SHOWN = 3  # pairs of bodies that a fault names
NEAR = 0.15  # of the support in a direction and its opposite: a CoM closer to an edge


@dataclass(frozen=True)
class Fault:
    """Something of a robot that will go wrong.

    Attributes:
        kind: what it is, in a word or two.
        text: what is wrong and what helps, one line.
        stepping: whether it matters only where feet move.
    """

    kind: str
    text: str
    stepping: bool = False


def find_faults(
    legs: Sequence[Leg],
    touching: Sequence[SelfContact],
    contacts: Mapping[str, int],
    both_feet: Holding,
    one_foot: Mapping[str, Holding | None],
    directions: Sequence[DirectionFigures],
    never_step: Sequence[str] = (),
) -> tuple[Fault, ...]:
    """The faults that figures of `RobotCheck` show, the worst kinds first."""
    return (
        *_touching([each for each in touching if not each.meshes], "self-collision"),
        *_touching([each for each in touching if each.meshes], "overlapping meshes"),
        *_soles(contacts),
        *_support(directions),
        *_both_feet(both_feet),
        *_knees(legs),
        *_ankles(legs),
        *_one_foot(one_foot),
        *_slow_legs(never_step),
    )


def _touching(touching: Sequence[SelfContact], kind: str) -> Iterator[Fault]:
    if not touching:
        return
    pairs = [f"{a} and {b} ({1000 * c.depth:.1f} mm)" for c in touching for a, b in [c.bodies]]
    more = f" and {len(pairs) - SHOWN} more" if len(pairs) > SHOWN else ""
    why = "convex hulls of meshes are what collides; " if touching[0].meshes else ""
    yield Fault(
        kind,
        f"standing, these are inside each other: {', '.join(pairs[:SHOWN])}{more}; {why}"
        "change the posture, the shapes, or exclude the pairs in the model (contact, exclude)",
    )


def _soles(contacts: Mapping[str, int]) -> Iterator[Fault]:
    few = {foot: count for foot, count in contacts.items() if count < POINTS}
    if few:
        counts = ", ".join(f"{foot} at {count}" for foot, count in few.items())
        yield Fault(
            "few contacts",
            f"standing, soles touch the ground at fewer than {POINTS} points ({counts}) and rock: "
            "of a mesh a few of its lowest points touch; make soles of boxes, capsules or spheres",
        )


def _support(directions: Sequence[DirectionFigures]) -> Iterator[Fault]:
    worst = min(directions, key=lambda each: each.margin)
    opposite = (worst.direction + 180.0) % 360.0
    across = worst.margin + sum(d.margin for d in directions if d.direction == opposite)
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


def _both_feet(holding: Holding) -> Iterator[Fault]:
    if holding.torque_fraction is None:
        yield Fault("torque", "no forces of the ground hold the standing posture at rest")
    elif not holding.possible:
        yield Fault(
            "torque",
            f"the standing posture asks {holding.torque_fraction:.0%} of the torque limit of "
            f"{holding.joint}: change the posture or torque_limits",
        )


def _knees(legs: Sequence[Leg]) -> Iterator[Fault]:
    straight = [leg for leg in legs if leg.knee_bend is not None and leg.knee_bend < STRAIGHT]
    if straight:
        knees = ", ".join(f"{leg.knee} ({leg.knee_bend:.0f}°)" for leg in straight)
        yield Fault(
            "straight knees",
            f"{knees}: a straight leg neither lengthens nor lifts its foot at once; bend knees "
            "by 20° or more in posture.joints",
            stepping=True,
        )


def _ankles(legs: Sequence[Leg]) -> Iterator[Fault]:
    for what, found in (
        ("pitch", [leg.foot for leg in legs if not leg.ankle_pitch]),
        ("roll", [leg.foot for leg in legs if not leg.ankle_roll]),
    ):
        if found:
            axis = "fore and aft" if what == "pitch" else "sideways"
            yield Fault(
                f"no ankle {what}",
                f"no joint of the ankle turns the foot {', '.join(found)} in {what}: on one foot "
                f"the CoP moves {axis} only as the whole leg tilts",
                stepping=True,
            )


def _one_foot(one_foot: Mapping[str, Holding | None]) -> Iterator[Fault]:
    if far := [foot for foot, holding in one_foot.items() if holding is None]:
        yield Fault(
            "one foot",
            f"no posture was found with the CoM over the foot {', '.join(far)} alone: single "
            "support is a fall to the other side, and steps must be quick",
            stepping=True,
        )
    for foot, holding in one_foot.items():
        if holding is not None and not holding.possible:
            fraction = holding.torque_fraction
            asks = "more than the ground gives" if fraction is None else (
                f"{fraction:.0%} of the torque limit of {holding.joint}"
            )  # fmt: skip
            yield Fault("one foot", f"to stand on {foot} alone asks {asks}", stepping=True)


def _slow_legs(never_step: Sequence[str]) -> Iterator[Fault]:
    if never_step:
        yield Fault(
            "slow legs",
            "against the damping of their joints the motors do not lift a foot and set it down in "
            f"the longest step of {', '.join(never_step)}: feet stay in place with these",
            stepping=True,
        )
