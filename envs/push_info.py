"""What an environment's `info` says about a push."""

from typing import Any

from .pushes import Kick, Push
from .robot import Robot


def push_info(push: Push | Kick, robot: Robot) -> dict[str, Any]:
    """start, duration [s], (peak) force [N], body, direction [deg], J [N·s] and J/m [N·s/kg].

    A kick has no force and no duration; its J is the momentum that it gives the whole robot.
    """
    if isinstance(push, Kick):
        force, duration, impulse = 0.0, 0.0, push.delta_v * robot.mass
        body = robot.model.body(robot.root_body_id).name
    else:
        force, duration, impulse = push.peak_force, push.duration, push.impulse
        body = push.body
    return {
        "start": push.start,
        "force": force,
        "duration": duration,
        "body": body,
        "direction": push.direction,
        "impulse": impulse,
        "specific_impulse": impulse / robot.mass,
    }
