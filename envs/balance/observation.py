"""The observation: what balance is about, in the heading frame, divided by known scales."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays
from poise.envs.robots.mirror import SIDES, Mirror


@dataclass(frozen=True, eq=False)
class Scales(Block):
    """What the observation and the reward are measured in."""

    support_x: float  #: half length of the standing support polygon [m]
    support_y: float  #: half width [m]
    height: float  #: CoM height of the standing posture [m]
    velocity: float  #: 0.2 ω h [m/s]
    momentum: float  #: 0.1 m h² ω [N·m·s]
    omega: float  #: ω = √(g/h) [1/s]
    weight: float  #: m g [N]


def scales(robot: RobotArrays, support: np.ndarray) -> Scales:
    """Scales of a robot whose standing support polygon is `support` (k, 2), heading frame [m]."""
    omega = robot.units.omega
    half = 0.5 * (support.max(axis=0) - support.min(axis=0))
    return Scales(
        support_x=float(half[0]),
        support_y=float(half[1]),
        height=robot.height_com,
        velocity=0.2 * omega * robot.height_com,
        momentum=0.1 * robot.mass * robot.height_com**2 * omega,
        omega=omega,
        weight=robot.units.force,
    )


# fmt: off
Image = Literal[
    "vector", "turn", "root vector", "root turn", "number", "joints", "feet", "between feet",
    "actions",
]
# fmt: on


@dataclass(frozen=True)
class Term:
    """One named part of the observation vector.

    `image` is what it is to a mirror that exchanges left and right. Entries of a vector or a turn
    (an axial vector) end in x, y or z; those along the root's axes have all three.
    """

    name: str
    entries: tuple[str, ...]
    unit: str
    meaning: str
    image: Image

    @property
    def size(self) -> int:
        """How many numbers."""
        return len(self.entries)


def observation_terms(
    joints: Sequence[str], soles: Sequence[str], actions: Sequence[str]
) -> list[Term]:
    """The parts of the observation, in order; `observe` fills them."""
    ground, space = ("x", "y"), ("x", "y", "z")
    joints, soles, actions = tuple(joints), tuple(soles), tuple(actions)
    return [
        Term("com", ground, "half support", "CoM from the middle of the soles", "vector"),
        Term("com_height", ("z",), "0.1 h", "CoM height minus its standing value", "vector"),
        Term("capture_point", ground, "half support", "ξ from the middle of the soles", "vector"),
        Term("cop", ground, "half support", "CoP from the middle of the soles", "vector"),
        Term("com_vel", space, "0.2 ω h", "CoM velocity", "vector"),
        Term("angular_momentum", space, "0.1 m h² ω", "angular momentum about the CoM", "turn"),
        Term("gravity", space, "1", "direction of gravity, root axes", "root vector"),
        Term("root_rate", space, "ω", "angular velocity of the root, root axes", "root turn"),
        Term("load", ("z",), "m g", "vertical force of the ground minus the weight", "vector"),
        Term("joint_pos", joints, "rad", "joint position minus the reference", "joints"),
        Term("joint_vel", joints, "3 ω", "joint velocity minus the reference's", "joints"),
        Term("contacts", soles, "1", "1 where the foot touches the ground, else 0", "feet"),
        Term("last_action", actions, "1", "action of the step before", "actions"),
    ]


def observation_table(terms: Sequence[Term]) -> str:
    """The terms as a table for a docstring, one row per index."""
    rows = ["| index | term | entry | unit | meaning |", "| --- | --- | --- | --- | --- |"]
    for term in terms:
        for entry in term.entries:
            index = len(rows) - 2
            rows.append(f"| {index} | {term.name} | {entry} | {term.unit} | {term.meaning} |")
    return "\n".join(rows)


@compiled
def observe(
    robot: RobotArrays,
    s: StateArrays,
    scale: Scales,
    q_ref: np.ndarray,
    v_ref: np.ndarray,
    last_action: np.ndarray,
    out: np.ndarray,
):
    """Fill `out` with the terms of `observation_terms`, in that order, clipped to ±10."""
    cos, sin = s.heading[0], s.heading[1]
    ox, oy = s.origin[0], s.origin[1]
    k = 0
    for which in range(4):
        if which == 0:
            x, y = s.com[0] - ox, s.com[1] - oy
        elif which == 1:
            out[k] = (s.com[2] - s.origin[2] - scale.height) / (0.1 * scale.height)
            k += 1
            continue
        elif which == 2:
            x, y = s.capture_point[0] - ox, s.capture_point[1] - oy
        else:
            x, y = s.cop[0] - ox, s.cop[1] - oy
        out[k] = (cos * x + sin * y) / scale.support_x
        out[k + 1] = (cos * y - sin * x) / scale.support_y
        k += 2
    out[k] = (cos * s.com_vel[0] + sin * s.com_vel[1]) / scale.velocity
    out[k + 1] = (cos * s.com_vel[1] - sin * s.com_vel[0]) / scale.velocity
    out[k + 2] = s.com_vel[2] / scale.velocity
    out[k + 3] = (cos * s.momentum[3] + sin * s.momentum[4]) / scale.momentum
    out[k + 4] = (cos * s.momentum[4] - sin * s.momentum[3]) / scale.momentum
    out[k + 5] = s.momentum[5] / scale.momentum
    k += 6
    for a in range(3):
        out[k + a] = -s.root_axes[2, a]
        out[k + 3 + a] = s.qvel[3 + a] / scale.omega
    out[k + 6] = s.contact_wrench[2] / scale.weight - 1.0
    k += 7
    nj = q_ref.shape[0]
    for j in range(nj):
        out[k + j] = s.qpos[7 + j] - q_ref[j]
        out[k + nj + j] = (s.qvel[6 + j] - v_ref[j]) / (3.0 * scale.omega)
    k += 2 * nj
    for i in range(s.contacts.shape[0]):
        out[k + i] = s.contacts[i]
    k += s.contacts.shape[0]
    for a in range(last_action.shape[0]):
        out[k + a] = last_action[a]
    for i in range(out.shape[0]):
        out[i] = min(max(out[i], -10.0), 10.0)


def mirror_terms(terms: Sequence[Term], parts: Mapping[str, Mirror]) -> Mirror:
    """How values of these `terms` look in the mirror; `parts` by what their `image` names."""
    order, sign, first = [], [], 0
    for term in terms:
        part = parts[term.image] if term.image in parts else _plain(term)
        order.append(first + part.order)
        sign.append(part.sign)
        first += term.size
    return Mirror(np.concatenate(order), np.concatenate(sign))


def _plain(term: Term) -> Mirror:
    """Of numbers and vectors, which keep their places, and of feet, which change them."""
    places = np.arange(term.size)
    if term.image == "feet":
        return Mirror(places[::-1].copy(), np.ones(term.size))
    signs = {"number": np.ones(3), "vector": SIDES, "turn": -SIDES, "between feet": -SIDES}
    axes = [0 if term.image == "number" else "xyz".index(entry[-1]) for entry in term.entries]
    return Mirror(places, signs[term.image][axes])
