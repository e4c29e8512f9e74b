"""The check of a robot for people: tables in the terminal."""

from collections.abc import Iterator

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from poise.envs.physics.legs import Leg
from poise.envs.robots.robot import Robot
from poise.training.running.tables import fact_table, text_table

from .check import RobotCheck
from .standing.holding import Holding
from .standing.posture import Difference
from .standing.pushed import SHARE, Pushed
from .standing.rest import CONTROLLER, Rest

EVERY = 2  # of the directions, in the table


def summary(robot: Robot) -> str:
    """Return a line that needs no compiled code: what was read, and what follows."""
    soles = ", ".join(sole.name for sole in robot.soles)
    return (f"{robot.name}: {robot.mass:.2f} kg, {len(robot.joint_names)} joints, "
            f"{len(robot.motor_names)} motors, soles {soles}; checked on both feet, on one, at "
            "rest and pushed")  # fmt: skip


def print_robot_check(check: RobotCheck, console: Console) -> None:
    """The robot, its directions, who can use it, what will go wrong."""
    console.print(fact_table(check.name, _rows(check)))
    console.print(_directions(check))
    for family, uses in check.controllers.items():
        takes = ", ".join(uses.takes) or "none"
        console.print(f"controllers {family}: {takes}", markup=False, highlight=False)
        for name, reason in uses.refused.items():
            console.print(f"  not {name}: {reason}", markup=False, highlight=False)
    for fault in check.faults:
        where = " (stepping)" if fault.stepping else ""
        console.print(f"[yellow]warning[/yellow]: {fault.kind}{where}: {escape(fault.text)}",
                      highlight=False)  # fmt: skip
    if not check.faults:
        console.print("no warnings")


def _rows(check: RobotCheck) -> Iterator[tuple[str, str]]:
    ahead, left = (1000.0 * x for x in check.posture.com)
    yield "mass", f"{check.mass:.2f} kg"
    yield "CoM", (f"{check.height_com:.3f} m high, {ahead:+.0f} mm ahead and {left:+.0f} mm to the "
                  "left of the middle of the soles")  # fmt: skip
    yield "joints", f"{check.joints}, without a motor: {', '.join(check.without_motor) or 'none'}"
    yield "torque limits", _limits(check.torque_limits)
    for sole in check.soles:
        yield (
            f"sole {sole.name}",
            (
                f"{1000 * sole.length:.0f} × {1000 * sole.width:.0f} mm, {len(sole.corners)} "
                f"corners, {check.sole_contacts[sole.name]} contacts, on {sole.body}"
            ),
        )
    for leg in check.legs:
        yield f"leg {leg.foot}", _leg(leg)
    posture = check.posture
    yield "posture", (f"from {posture.keyframe or 'the zero posture of the model'}, legs adjusted "
                      f"by {_difference(posture.levelling)}")  # fmt: skip
    for name, difference in posture.differences.items():
        yield f"against {name}", f"at most {_difference(difference)}"
    yield "keyframes", ", ".join(posture.keyframes) or "none"
    yield "to stand", _holding(check.both_feet)
    for foot, holding in check.one_foot.items():
        text = "no posture found" if holding is None else _holding(holding)
        yield f"on {foot} alone", text
    yield "at rest", _rest(check.rest)
    if check.pushed.trials:
        yield f"pushed, {SHARE:g} of the ankle limit", _pushed(check.pushed)
    model = check.dynamics
    yield "physics", (f"steps of {1000 * model.timestep:g} ms; friction of soles and ground "
                      f"{model.friction:g}")  # fmt: skip
    depth = max((each.depth for each in check.self_contacts), default=0.0)
    pairs = len(check.self_contacts)
    yield "self-contacts", f"{pairs}, up to {1000 * depth:.1f} mm deep" if pairs else "none"
    yield "licence", check.licence or "not said"


def _pushed(pushed: Pushed) -> str:
    if not pushed.falls:
        return f"recovers in {pushed.trials} of {pushed.trials} directions with {CONTROLLER}"
    where = ", ".join(f"{angle:g}°" for angle in pushed.falls)
    return f"falls in {len(pushed.falls)} of {pushed.trials} directions: {where}; {pushed.cause}"


def _rest(rest: Rest) -> str:
    if rest.refused:
        return f"not simulated: {rest.refused}"
    end = f"falls after {rest.duration:.2f} s" if rest.fallen else f"stands {rest.duration:.1f} s"
    return (f"{end} with {CONTROLLER}; torques change by {rest.chatter:.1f} limits/s, feet drift "
            f"{1000 * rest.foot_drift:.1f} mm, the CoM {1000 * rest.com_drift:.1f} mm, the root "
            f"leans {rest.lean:.1f}°, {rest.unsolved} of {rest.ticks} ticks unsolved")  # fmt: skip


def _leg(leg: Leg) -> str:
    axes = {"pitch": leg.ankle_pitch, "roll": leg.ankle_roll}
    knee = "none found" if leg.knee_bend is None else f"{leg.knee}, bent {leg.knee_bend:.0f}°"
    turns = " and ".join(name for name, there in axes.items() if there) or "nothing"
    return f"{len(leg.joints)} joints; knee: {knee}; ankle: {turns}"


def _limits(limits: dict[str, float]) -> str:
    least, most = min(limits, key=limits.__getitem__), max(limits, key=limits.__getitem__)
    return f"{limits[least]:g} N·m ({least}) to {limits[most]:g} N·m ({most})"


def _difference(difference: Difference) -> str:
    return f"{difference.amount:.1f}° ({difference.joint})"


def _holding(holding: Holding) -> str:
    if holding.torque_fraction is None:
        return "no forces of the ground hold it"
    return f"{holding.torque_fraction:.0%} of the torque limit of {holding.joint}"


def _directions(check: RobotCheck) -> Table:
    """Return every other direction, and the mean over all."""
    headings = ("direction", "CoM to edge [mm]", "CoP by ankles [mm]", "in place [N·s]",
                "in place [N·s/kg]", "one step ≤ [N·s]", "one step ≤ [N·s/kg]")  # fmt: skip
    rows = (
        (f"{each.direction:g}°", f"{1000 * each.margin:.0f}", f"{1000 * each.reach:.0f}",
         *_impulses(each.in_place, each.one_step, check.mass))
        for each in check.directions[::EVERY]
    )  # fmt: skip
    table = text_table("push of 0.1 s", (), headings, rows)
    table.add_section()
    table.add_row("mean", "", "", *_impulses(check.in_place, check.one_step, check.mass))
    return table


def _impulses(in_place: float, one_step: float, mass: float) -> tuple[str, str, str, str]:
    """Both of them [N·s], each followed by what it is over the mass [N·s/kg]."""
    per_mass = in_place / mass, one_step / mass
    return f"{in_place:.1f}", f"{per_mass[0]:.2f}", f"{one_step:.1f}", f"{per_mass[1]:.2f}"
