"""A description guessed from a model alone: root, feet, forward, posture, armature, roles."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from poise.configs.errors import ConfigError, naming

from .actuators import SIMPLE_JOINTS, model_torque_limits, proposed_armature
from .description import (
    FootDescription,
    OptionDescription,
    PostureDescription,
    RobotDescription,
    SourceDescription,
)
from .floors import check_ground, install_ground
from .ground import can_touch
from .model_check import check_root
from .models.mjcf import pointing_to_scenes, read_mjcf
from .models.tree import lineage
from .models.urdf import read_urdf
from .soles import find_sole_plane, sole_geoms
from .standing import Stance, described_qpos

MODELS = (".xml", ".mjcf", ".urdf")  # suffixes of models that can be named in a description's place
HIGHER = 0.1  # of the robot's height: by which all other limbs end above the feet
ALIKE = 0.02  # of the robot's height: between the heights of the feet
ALONG = 0.7  # |cos| between an axis and a direction from which it is of that direction
BENDS = (20.0, 12.0, 5.0)  # [deg] of hip and ankle, half the knee's, tried one after the other
DEEP = 0.005  # [m] that bodies may be in each other
STRAIGHT = 10.0  # [deg] a knee that is bent less is bent
SIDE = re.compile(
    r"(left|right)|(?:^|[_.\- ])([lr])(?:[_.\- ]|$)|^([lr])(?=[A-Z_])|(?<=[a-z])([LR])$"
)
FIRM = OptionDescription(cone="elliptic", impratio=100.0)  # feet that press apart do not creep
ROLES = ("hips_pitch", "knees", "ankles_pitch")


def guess(path: Path) -> RobotDescription:
    """The description of the biped in an MJCF or URDF file, where it is sure.

    The root is the body that floats. The feet are the two limbs that end lowest, equally high and
    far below all others. Forward is square to the line between them, by the names of their sides,
    or where they reach further. The posture is the first of these that stands: the model's
    keyframes; its zero posture with the knees bent; its zero posture; each with the CoM over the
    middle of the soles.

    Raises:
        ConfigError: the file cannot be read, or one of these is not sure; the text says which, and
            that a description names it.
    """
    urdf = path.suffix.lower() == ".urdf"
    with naming(path):
        spec = read_urdf(path) if urdf else read_mjcf(path, ())
        for i, joint in enumerate(spec.joints):
            joint.name = joint.name or f"joint{i}"
        try:
            model = spec.compile()
            keyframes = {model.key(i).name: model.key_qpos[i].copy() for i in range(model.nkey)}
            ground, _ = install_ground(spec, model, None)
            model = spec.compile()
        except ValueError as error:
            raise ConfigError(f"the model does not compile: {error}", field="source") from None
        check_ground(model, model.geom(ground).id)
        with pointing_to_scenes(path, "pair"):
            found = _Guess(model, model.geom(ground).id, keyframes)
        return found.description(path, urdf)


def robot_name(path: Path) -> str:
    """The name of a model's file, or of its folder where the file is called as many are."""
    own = path.absolute()
    name = own.parent.name if own.stem.lower() in ("model", "robot", "scene") else own.stem
    return re.sub(r"[^\w.-]+", "-", name) or "robot"


class _Guess:
    """A model, and what is found of it in its zero posture."""

    def __init__(self, model: mujoco.MjModel, ground: int, keyframes: dict[str, np.ndarray]):
        self.model, self.ground, self.keyframes = model, ground, keyframes
        self.data = mujoco.MjData(model)
        mujoco.mj_forward(model, self.data)
        self.root = self._root()
        self.feet = self._feet()
        self.chains = self._chains()
        self.forward = self._forward()

    def description(self, path: Path, urdf: bool) -> RobotDescription:
        """The first posture that stands, without bodies in each other if there is one."""
        bent = self._bent_joints()
        plain = RobotDescription(
            name=robot_name(path),
            source=SourceDescription(urdf=path.name) if urdf else SourceDescription(mjcf=path.name),
            root=self.model.body(self.root).name,
            feet=tuple(FootDescription(name, self.model.body(body).name)
                       for name, body in zip(("left", "right"), self.feet, strict=True)),
            forward=self.forward,
            roles=dict(zip(ROLES, bent, strict=False)),
            armature=self._armature(),
            options=FIRM if urdf else OptionDescription(),
        )  # fmt: skip
        stand, reasons = [], []
        for posture in self._postures(bent):
            description = replace(plain, posture=posture)
            try:
                touching = self._touching(description)
            except ConfigError as error:
                reasons.append(error.message)
                continue
            if not touching:
                return description
            stand.append(description)
        if stand:
            return stand[0]
        raise _unsure("no posture stands with both soles flat and the CoM over their middle; the "
                      f"first that was tried: {reasons[0]}", "posture")  # fmt: skip

    def _root(self) -> int:
        model = self.model
        free = [int(model.jnt_bodyid[i]) for i in range(model.njnt)
                if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_FREE]  # fmt: skip
        if not free and model.nbody == 1:
            raise _unsure("the model has no body", "root")
        if not free:
            largest = int(np.bincount(model.body_rootid[1:], minlength=2).argmax())
            check_root(model, largest)  # which says what it hangs by instead
        return max(free, key=lambda body: np.count_nonzero(model.body_rootid == body))

    def _feet(self) -> tuple[int, int]:
        """The bodies of the two limbs that end lowest, the left one first."""
        model = self.model
        own = np.flatnonzero(model.body_rootid == self.root)
        heads = {int(model.body_weldid[body]) for body in own} - {self.root}
        inner = {int(model.body_weldid[model.body_parentid[body]]) for body in heads}
        lowest = sorted((self._lowest(body), body) for body in heads - inner)
        lowest = [(z, body) for z, body in lowest if np.isfinite(z)]
        height = np.ptp(self.data.xpos[own, 2])
        if len(lowest) < 2 or lowest[1][0] - lowest[0][0] > ALIKE * height:
            raise _unsure("no two limbs that collide with the ground end equally low", "feet")
        if len(lowest) > 2 and lowest[2][0] - lowest[0][0] < HIGHER * height:
            names = ", ".join(model.body(body).name for _, body in lowest[:6])
            raise _unsure(f"more than two limbs end low: {names}", "feet")
        first, second = lowest[0][1], lowest[1][1]
        sides = _side(model.body(first).name), _side(model.body(second).name)
        if sides == ("right", "left") or (
            set(sides) != {"left", "right"} and self.data.xpos[first, 1] < self.data.xpos[second, 1]
        ):
            first, second = second, first
        return first, second

    def _lowest(self, body: int) -> float:
        """The lowest point [m] of what of a body and of those fixed to it can touch the ground."""
        model, found = self.model, np.inf
        for geom in range(model.ngeom):
            fixed = model.body_weldid[model.geom_bodyid[geom]] == body
            if fixed and can_touch(model, geom, self.ground):
                centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
                turn = self.data.geom_xmat[geom].reshape(3, 3)[2]
                z = self.data.geom_xpos[geom, 2] + turn @ centre - np.abs(turn) @ half
                found = min(found, float(z))
        return found

    def _chains(self) -> list[list[int]]:
        """The joints of each leg, from the root on."""
        model, chains = self.model, []
        for foot in self.feet:
            line = lineage(model, foot)
            chains.append([j for j in range(model.njnt) if model.jnt_bodyid[j] in line])
        shared = set(chains[0]) & set(chains[1])
        return [[joint for joint in chain if joint not in shared] for chain in chains]

    def _forward(self) -> tuple[float, float, float]:
        """The axis of the root that is nearest to forward."""
        left, right = (self.data.xpos[foot] for foot in self.feet)
        across = np.cross(left - right, [0.0, 0.0, 1.0])
        if np.linalg.norm(across) < 1e-3:
            raise _unsure("the feet are not beside each other", "forward")
        sides = {_side(self.model.body(foot).name) for foot in self.feet}
        if sides != {"left", "right"} and self._toes() @ across < 0.0:
            across = -across
            self.feet = self.feet[::-1]
            self.chains.reverse()
        local = self.data.xmat[self.root].reshape(3, 3).T @ across
        axis = np.zeros(3)
        axis[int(np.argmax(np.abs(local)))] = np.sign(local[np.argmax(np.abs(local))])
        if axis @ local < 0.9 * np.linalg.norm(local):
            axis = np.round(local / np.linalg.norm(local), 3)
        return (float(axis[0]), float(axis[1]), float(axis[2]))

    def _toes(self) -> np.ndarray:
        """(3,) from the feet's last joints to the middle of their shapes."""
        model, data, found = self.model, self.data, np.zeros(3)
        for foot, chain in zip(self.feet, self.chains, strict=True):
            geoms = [g for g in range(model.ngeom)
                     if model.body_weldid[model.geom_bodyid[g]] == foot]  # fmt: skip
            found += np.mean(data.geom_xpos[geoms], axis=0) - data.xanchor[chain[-1]]
        return found

    def _bent_joints(self) -> list[dict[str, float]]:
        """Hip, knee and ankle: joint → the sign about the robot's left; none where unknown."""
        left = np.cross([0.0, 0.0, 1.0], self.data.xmat[self.root].reshape(3, 3) @ self.forward)
        found: list[dict[str, float]] = [{}, {}, {}]
        for chain in self.chains:
            pitch = [j for j in chain if abs(self.data.xaxis[j] @ left) > ALONG
                     and self.model.jnt_type[j] in SIMPLE_JOINTS]  # fmt: skip
            if len(pitch) < 3:
                return []
            for pairs, joint in zip(found, pitch[-3:], strict=True):
                name = self.model.joint(joint).name
                pairs[name] = float(np.sign(self.data.xaxis[joint] @ left))
        return found

    def _postures(self, bent: list[dict[str, float]]) -> Iterator[PostureDescription]:
        for name in self.keyframes:
            yield PostureDescription(keyframe=name, com="middle")
        bends = [sign * bend for sign in (1.0, -1.0) for bend in BENDS]  # some have birds' legs
        for bend in bends if bent and self._straight(bent[1]) else ():
            angles = dict(zip(ROLES, (-bend, 2.0 * bend, -bend), strict=True))
            joints = {
                joint: sign * angles[role] + self._zero(joint)
                for role, pairs in zip(ROLES, bent, strict=True)
                for joint, sign in pairs.items()
            }
            yield PostureDescription(joints=joints, com="middle")
        yield PostureDescription(com="middle")

    def _zero(self, joint: str) -> float:
        return float(np.degrees(self.model.qpos0[self.model.joint(joint).qposadr[0]]))

    def _straight(self, knees: dict[str, float]) -> bool:
        """Whether thigh and shank of the first leg are in line in the zero posture."""
        knee = self.model.joint(next(iter(knees))).id
        chain = self.chains[0]
        below = self.data.xanchor[chain[-1]] - self.data.xanchor[knee]
        above = self.data.xanchor[knee] - self.data.xanchor[chain[0]]
        cosine = below @ above / max(np.linalg.norm(below) * np.linalg.norm(above), 1e-9)
        return bool(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))) < 2.0 * STRAIGHT)

    def _armature(self) -> dict[str, float]:
        """What is proposed for the motors whose joints have none."""
        model = self.model
        mass = float(model.body_subtreemass[self.root])
        limits = model_torque_limits(model)
        return {name: proposed_armature(limit, mass) for name, limit in limits.items()
                if np.isfinite(limit) and limit > 0.0
                and model.dof_armature[model.joint(name).dofadr[0]] == 0.0}  # fmt: skip

    def _touching(self, description: RobotDescription) -> bool:
        """Whether bodies are in each other in the posture; ConfigError where it does not stand."""
        model, data = self.model, mujoco.MjData(self.model)
        data.qpos[:] = described_qpos(model, description, self.keyframes)
        mujoco.mj_kinematics(model, data)
        planes = []
        for foot in self.feet:
            geoms = sole_geoms(model, foot, (), self.ground)
            planes.append(find_sole_plane(model, data, foot, geoms))
        stance = Stance(model, data, self.root, self.feet, planes)
        stance.level_soles()
        stance.centre_com()
        mujoco.mj_collision(model, data)
        return any(
            contact.dist < -DEEP and all(model.geom_bodyid[geom] for geom in contact.geom)
            for contact in data.contact[: data.ncon]
        )


def _side(name: str) -> str:
    """``left``, ``right``, or nothing, as a body's name says."""
    found = SIDE.search(name) or SIDE.search(name.lower())
    word = "" if found is None else next(filter(None, found.groups())).lower()
    return {"l": "left", "r": "right"}.get(word, word)


def _unsure(problem: str, field: str) -> ConfigError:
    return ConfigError(
        f"{problem}: write a description (.yaml) that says it, see docs/robots.md", field=field
    )
