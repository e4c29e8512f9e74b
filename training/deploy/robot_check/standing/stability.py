"""The reach of the CoP from a standing robot's CoM, and the push that it stops."""

from dataclasses import dataclass

from poise.envs.physics.pushes.sampler import LIMIT_DURATION
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.step_limits import NStepLimit

DIRECTIONS = tuple(22.5 * i for i in range(16))  # [deg]


@dataclass(frozen=True)
class DirectionFigures:
    """A push's direction, and what a linear inverted pendulum says of it.

    Attributes:
        direction: counter-clockwise from forward [deg].
        margin: from the CoM to the edge of the support polygon [m].
        reach: as far as the CoP gets with the torques of the ankles [m].
        in_place: impulse of a push of 0.1 s that the ankles hold, `ankle_limit` [N·s]: the expected
            J50 of a controller whose feet stay.
        one_step: impulse that one step stops, `NStepLimit`: an upper bound [N·s].
    """

    direction: float
    margin: float
    reach: float
    in_place: float
    one_step: float


def by_direction(limits: PushLimits) -> tuple[DirectionFigures, ...]:
    """Return the figures of `DIRECTIONS`."""
    steps = NStepLimit(limits)
    return tuple(
        DirectionFigures(
            direction=angle,
            margin=limits.margin(angle),
            reach=steps.reach(angle),
            in_place=limits.ankle(angle, LIMIT_DURATION),
            one_step=steps(angle, LIMIT_DURATION, 1),
        )
        for angle in DIRECTIONS
    )
