"""Where a robot has hips, knees, ankles, shoulders, elbows and hands: read off its model."""

from typing import NamedTuple, Protocol

import mujoco
import numpy as np

from poise.envs.robots.robot import Robot

LATERAL = 0.03  # [m] from the middle: the end of an arm is further
ABOVE = 0.3  # [m] between the two points of a trunk without arms


class Placed(Protocol):
    """What has a place in a posture."""

    def place(self, data: mujoco.MjData) -> np.ndarray:
        """(3,) in the world [m]."""

    def jacobian(self, model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
        """(3, nv) of its velocity by the generalized velocity."""


class Point(NamedTuple):
    """The mean of points that are fixed to bodies: (body, place in its axes [m])."""

    parts: tuple[tuple[int, np.ndarray], ...]

    def place(self, data: mujoco.MjData) -> np.ndarray:
        """(3,) in the world [m], from MuJoCo's kinematics."""
        places = [data.xpos[b] + data.xmat[b].reshape(3, 3) @ x for b, x in self.parts]
        return np.mean(places, axis=0)

    def jacobian(self, model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
        """(3, nv) of its velocity by the generalized velocity."""
        total, part = np.zeros((3, model.nv)), np.empty((3, model.nv))
        for body, x in self.parts:
            place = data.xpos[body] + data.xmat[body].reshape(3, 3) @ x
            mujoco.mj_jac(model, data, part, None, place, body)
            total += part
        return total / len(self.parts)


class LimbVector(NamedTuple):
    """One point as seen from another, in the world's axes."""

    point: Placed
    origin: Placed

    def place(self, data: mujoco.MjData) -> np.ndarray:
        """(3,) [m]."""
        return self.point.place(data) - self.origin.place(data)

    def jacobian(self, model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
        """(3, nv)."""
        return self.point.jacobian(model, data) - self.origin.jacobian(model, data)


def sole_corners(robot: Robot, data: mujoco.MjData, foot: int) -> np.ndarray:
    """(k, 3) corners of a sole in the world [m]."""
    sole = robot.soles[foot]
    corners = np.pad(sole.polygon, ((0, 0), (0, 1))) @ sole.rotation.T + sole.position
    return data.xpos[sole.body_id] + corners @ data.xmat[sole.body_id].reshape(3, 3).T


class Limbs(NamedTuple):
    """Points of a robot by role, such as ``elbow_left``; those of arms only if it has arms."""

    points: dict[str, Point]
    standing: dict[str, np.ndarray]  # (3,) where they are in the standing posture [m]
    leg_length: float  # [m] thigh and shank, mean of both legs

    @property
    def has_arms(self) -> bool:
        """True if both shoulders, elbows and hands were found."""
        return "hand_left" in self.points and "hand_right" in self.points


def find_limbs(robot: Robot) -> Limbs:
    """The limbs of a robot from its tree of joints in the standing posture.

    A leg's joints are those between root and one foot that the other foot does not share: its first
    anchor is the hip, its last the ankle, and of the others the knee is the one whose nearer end is
    furthest. An arm is the longest chain that ends at a side and is no leg; shoulder and elbow are
    found in it in the same way, the hand at its geometry that is furthest from the shoulder.
    """
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(model, data)
    feet = sorted(robot.soles, key=lambda sole: -data.xpos[sole.body_id][1])
    chains = [joints_to(model, sole.body_id) for sole in feet]
    points: dict[str, Point] = {}
    for side, own, other in zip(("left", "right"), chains, chains[::-1], strict=True):
        leg = [joint for joint in own if joint not in other]
        knee = _middle(data, leg, *data.xanchor[[leg[0], leg[-1]]])
        joints = (("hip", leg[0]), ("knee", knee), ("ankle", leg[-1]))
        points |= {f"{role}_{side}": _anchor(model, joint) for role, joint in joints}
    points |= _arms(model, data, robot, {joint for chain in chains for joint in chain})
    points["pelvis"] = Point((*points["hip_left"].parts, *points["hip_right"].parts))
    points["feet"] = Point((*points["ankle_left"].parts, *points["ankle_right"].parts))
    points |= _trunk(robot, data, points)
    at = {role: point.place(data) for role, point in points.items()}
    lengths = [
        np.linalg.norm(at[f"knee_{side}"] - at[f"hip_{side}"])
        + np.linalg.norm(at[f"ankle_{side}"] - at[f"knee_{side}"])
        for side in ("left", "right")
    ]
    return Limbs(points, at, float(np.mean(lengths)))


def joints_to(model: mujoco.MjModel, body: int) -> list[int]:
    """The joints between the root and a body, from the root on; without the free joint."""
    found: list[int] = []
    while body:
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        found = [*range(first, first + count), *found] if count else found
        body = int(model.body_parentid[body])
    return [joint for joint in found if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_FREE]


def _anchor(model: mujoco.MjModel, joint: int) -> Point:
    return Point(((int(model.jnt_bodyid[joint]), model.jnt_pos[joint].copy()),))


def _middle(data: mujoco.MjData, joints: list[int], a: np.ndarray, b: np.ndarray) -> int:
    """Of a chain's joints the one whose nearer end is furthest; the ends (3,) are at a and b."""
    anchors = data.xanchor[joints]
    ends = [np.linalg.norm(anchors - end, axis=1) for end in (a, b)]
    return joints[int(np.argmax(np.minimum(*ends)))]


def _arms(
    model: mujoco.MjModel, data: mujoco.MjData, robot: Robot, legs: set[int]
) -> dict[str, Point]:
    """Shoulders, elbows and hands; empty without an arm of two joints on each side."""
    tips = {side: _arm(model, data, legs, sign) for side, sign in (("left", 1), ("right", -1))}
    points: dict[str, Point] = {}
    for side, other in (("left", "right"), ("right", "left")):
        shared = set(tips[other])
        own = [joint for joint in tips[side] if joint not in shared]
        if len(own) < 2:
            return {}
        hand = _hand(model, data, own)
        elbow = _middle(data, own, data.xanchor[own[0]], hand.place(data))
        points |= {f"shoulder_{side}": _anchor(model, own[0]),
                   f"elbow_{side}": _anchor(model, elbow), f"hand_{side}": hand}  # fmt: skip
    return points


def _arm(model: mujoco.MjModel, data: mujoco.MjData, legs: set[int], sign: int) -> list[int]:
    """The joints of the longest chain that ends on one side and is no leg's."""
    chains = [
        chain
        for joint in range(1, model.njnt)
        if joint not in legs and sign * data.xpos[model.jnt_bodyid[joint]][1] > LATERAL
        for chain in [joints_to(model, int(model.jnt_bodyid[joint]))]
        if not legs & set(chain[-2:])
    ]
    return max(chains, key=len, default=[])


def _hand(model: mujoco.MjModel, data: mujoco.MjData, chain: list[int]) -> Point:
    """The centre of the geometry of a chain's last body that is furthest from its first joint."""
    body = int(model.jnt_bodyid[chain[-1]])
    geoms = [g for g in range(model.ngeom) if model.body_weldid[model.geom_bodyid[g]] == body]
    mujoco.mj_kinematics(model, data)
    places = [data.geom_xpos[g] for g in geoms] or [data.xpos[body]]
    start = data.xanchor[chain[0]]
    place = max(places, key=lambda place: float(np.linalg.norm(place - start)))
    return Point(((body, data.xmat[body].reshape(3, 3).T @ (place - data.xpos[body])),))


def _trunk(robot: Robot, data: mujoco.MjData, points: dict[str, Point]) -> dict[str, Point]:
    """The middle of the shoulders as ``chest``; without arms a point above the pelvis."""
    if "hand_left" in points:
        parts = (*points["shoulder_left"].parts, *points["shoulder_right"].parts)
        return {"chest": Point(parts)}
    body = robot.root_body_id
    above = points["pelvis"].place(data) + np.array([0.0, 0.0, ABOVE]) - data.xpos[body]
    return {"chest": Point(((body, data.xmat[body].reshape(3, 3).T @ above),))}
