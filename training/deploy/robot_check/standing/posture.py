"""The standing posture beside the described one and those of the model."""

from dataclasses import dataclass

import mujoco
import numpy as np

from poise.envs.physics.legs import standing_data
from poise.envs.robots.robot import Robot
from poise.envs.robots.standing import described_qpos

ZERO = "zero posture"  # of the model


@dataclass(frozen=True)
class Difference:
    """The joint that differs most between two postures, and by how much [deg] or, a slide, [mm]."""

    joint: str
    amount: float


@dataclass(frozen=True)
class PostureFigures:
    """The standing posture.

    Attributes:
        keyframes: of the model.
        keyframe: from which the description starts; None: from the model's zero posture.
        levelling: what was changed so that the soles lie flat.
        differences: of the standing posture from the model's zero posture and its keyframes.
        com: (2,) the CoM ahead and to the left of the middle between the soles [m].
    """

    keyframes: tuple[str, ...]
    keyframe: str | None
    levelling: Difference
    differences: dict[str, Difference]
    com: tuple[float, float]


def posture_figures(robot: Robot) -> PostureFigures:
    """Joint angles alone are compared; where the root is does not count."""
    described = described_qpos(robot.model, robot.description, robot.keyframes)
    postures = {ZERO: robot.model.qpos0, **robot.keyframes}
    com = standing_data(robot).subtree_com[robot.root_body_id]
    return PostureFigures(
        keyframes=tuple(robot.keyframes),
        keyframe=robot.description.posture.keyframe,
        levelling=_difference(robot, described),
        differences={name: _difference(robot, qpos) for name, qpos in postures.items()},
        com=(float(com[0]), float(com[1])),
    )


def _difference(robot: Robot, qpos: np.ndarray) -> Difference:
    slides = robot.model.jnt_type[1:] == mujoco.mjtJoint.mjJNT_SLIDE
    units = np.where(slides, 1000.0, 180.0 / np.pi)
    amounts = units * np.abs(robot.standing_qpos[7:] - qpos[7:])
    worst = int(np.argmax(amounts))
    return Difference(robot.joint_names[worst], float(amounts[worst]))
