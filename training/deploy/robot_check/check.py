"""All checks of a robot description before a controller runs on it."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from poise.envs.physics.legs import Leg, find_legs
from poise.envs.robots.robot import Robot, load_robot
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.running.files import plain

from .dynamics import Dynamics, dynamics
from .faults import Fault, find_faults
from .standing.holding import Holding, holding
from .standing.one_leg import one_leg_qpos
from .standing.posture import PostureFigures, posture_figures
from .standing.pushed import Pushed, push_gently
from .standing.rest import Rest, stand_at_rest
from .standing.stability import DirectionFigures, by_direction
from .touching import SelfContact, self_contacts, sole_contacts
from .uses import Uses, controllers_for


@dataclass(frozen=True)
class SoleFigures:
    """A sole: its corners in its own axes, its length and its width [m]."""

    name: str
    body: str
    corners: tuple[tuple[float, float], ...]
    length: float
    width: float


@dataclass(frozen=True)
class RobotCheck:
    """The findings of `check_robot`.

    Attributes:
        name, fingerprint: of the robot.
        licence: of its model, as the description says.
        mass: [kg].
        height_com: of the CoM above the ground, standing [m].
        joints: hinges and slides.
        torque_limits: joint → largest torque of its motor [N·m].
        without_motor: joints that nothing drives.
        soles, legs, posture: see there.
        both_feet: the torques that standing needs.
        one_foot: foot → the same with the other foot lifted; None where no posture was found in
            which the CoM is over that foot.
        sole_contacts: foot → at how many points it touches the ground in MuJoCo.
        self_contacts: bodies that are inside each other while it stands.
        directions: margins, and pushes that a pendulum stops.
        dynamics: light joints, friction, flags.
        rest: two seconds at rest with momentum-qp; pushed: half of the ankle limit with it.
        notes: what was changed in the model so that it can be simulated.
        controllers: "in place" and "stepping" → which packaged ones take the robot.
    """

    name: str
    fingerprint: str
    licence: str
    mass: float
    height_com: float
    joints: int
    torque_limits: dict[str, float]
    without_motor: tuple[str, ...]
    soles: tuple[SoleFigures, ...]
    legs: tuple[Leg, ...]
    posture: PostureFigures
    both_feet: Holding
    one_foot: dict[str, Holding | None]
    sole_contacts: dict[str, int]
    self_contacts: tuple[SelfContact, ...]
    directions: tuple[DirectionFigures, ...]
    dynamics: Dynamics
    rest: Rest
    pushed: Pushed
    notes: tuple[str, ...]
    controllers: dict[str, Uses]

    @property
    def faults(self) -> tuple[Fault, ...]:
        """What will go wrong."""
        return tuple(find_faults(self))

    @property
    def in_place(self) -> float:
        """Mean over the directions of the ankle limit [N·s]."""
        return float(np.mean([each.in_place for each in self.directions]))

    @property
    def one_step(self) -> float:
        """Mean over the directions of the impulse that one step stops [N·s]."""
        return float(np.mean([each.one_step for each in self.directions]))

    def to_json(self) -> dict[str, Any]:
        """Plain lists and numbers, None for what is not finite."""
        means = {"in_place": self.in_place, "one_step": self.one_step}
        return plain(asdict(self) | {"faults": self.faults, **means})


def check_robot(robot: Robot | str | Path) -> RobotCheck:
    """Check a robot, by its name or description; raises ConfigError as `load_robot`."""
    robot = robot if isinstance(robot, Robot) else load_robot(robot)
    names = [robot.joint_names[dof - 6] for dof in robot.motor_dofs]
    return RobotCheck(
        name=robot.name,
        fingerprint=robot.fingerprint,
        licence=robot.description.source.licence,
        mass=robot.mass,
        height_com=robot.height_com,
        joints=len(robot.joint_names),
        torque_limits=dict(zip(names, robot.torque_limit.tolist(), strict=True)),
        without_motor=tuple(name for name in robot.joint_names if name not in names),
        soles=tuple(
            SoleFigures(
                sole.name,
                sole.body,
                tuple((float(x), float(y)) for x, y in sole.polygon),
                *np.ptp(sole.polygon, axis=0).tolist(),
            )
            for sole in robot.soles
        ),
        legs=find_legs(robot),
        posture=posture_figures(robot),
        both_feet=holding(robot, robot.standing_qpos, range(len(robot.soles))),
        one_foot={sole.name: _on_one_foot(robot, i) for i, sole in enumerate(robot.soles)},
        sole_contacts=sole_contacts(robot),
        self_contacts=self_contacts(robot),
        directions=by_direction(PushLimits(robot)),
        dynamics=dynamics(robot),
        rest=(rest := stand_at_rest(robot)),
        pushed=Pushed() if rest.fallen or rest.refused else push_gently(robot),
        notes=robot.notes,
        controllers=controllers_for(robot),
    )


def _on_one_foot(robot: Robot, sole: int) -> Holding | None:
    qpos = one_leg_qpos(robot, sole)
    return None if qpos is None else holding(robot, qpos, [sole])
