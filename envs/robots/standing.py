"""The standing posture: both soles exactly flat on the ground, the robot facing along +x."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from poise.configs.errors import ConfigError, shown

from .actuators import SIMPLE_JOINTS
from .description import RobotDescription, match_names
from .soles import SolePlane, sole_frame

HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
MAX_CORRECTION = np.deg2rad(3.0)  # [rad] that levelling may change a joint
MAX_SHIFT = np.deg2rad(40.0)  # [rad] that a joint may turn so that the CoM is over the middle
STEP = np.deg2rad(3.0)  # [rad] of a joint in one iteration
CUT_OFF = 1e-4  # of singular values, over the largest: straight legs do not lengthen
CENTRED = 3e-3  # [m] from the middle: legs without roll cannot go sideways
TOLERANCE = 1e-10  # [rad] and [m]


def described_qpos(
    model: mujoco.MjModel, description: RobotDescription, keyframes: dict[str, np.ndarray]
) -> np.ndarray:
    """(nq,) the posture as described, not yet levelled.

    Joints that the description leaves out stay within their range. `keyframes` are those of the
    source model: name → qpos.

    Raises:
        ConfigError: an unknown keyframe or joint, or an angle out of the joint's range.
    """
    posture = description.posture
    qpos = model.qpos0.copy()
    if posture.keyframe is not None:
        if posture.keyframe not in keyframes:
            raise ConfigError(
                f"no keyframe is called {shown(posture.keyframe)}",
                field="posture.keyframe",
                choices=keyframes,
            )
        qpos = keyframes[posture.keyframe].copy()
    simple = [i for i in range(model.njnt) if model.jnt_type[i] in SIMPLE_JOINTS]
    names = [model.joint(i).name for i in simple]
    given = match_names(posture.joints, names, None, "posture.joints")
    for i, name in zip(simple, names, strict=True):
        low, high = model.jnt_range[i] if model.jnt_limited[i] else (-np.inf, np.inf)
        value = qpos[model.jnt_qposadr[i]]
        if name in given:
            degrees = posture.unit == "degree" and model.jnt_type[i] == HINGE
            value = np.deg2rad(given[name]) if degrees else given[name]
            if not low <= value <= high:
                unit = 180.0 / np.pi if degrees else 1.0
                raise ConfigError(
                    f"{given[name]:g} is outside the range of the joint {name!r}, "
                    f"{low * unit:g} to {high * unit:g}",
                    field="posture.joints",
                )
        qpos[model.jnt_qposadr[i]] = np.clip(value, low, high)
    return qpos


@dataclass(frozen=True, eq=False)
class Stance:
    """A robot whose `data.qpos` is changed until it stands; after each change its kinematics are
    up to date."""

    model: mujoco.MjModel
    data: mujoco.MjData
    root: int  # id of the root body
    feet: Sequence[int]  # ids of the two foot bodies
    planes: Sequence[SolePlane]  # where each foot rests

    def level_soles(self) -> None:
        """Turn the leg joints a little so that both soles are level and equally high.

        Gauss–Newton with the smallest joint change, over the joints that move just one foot; the
        root keeps its orientation.

        Raises:
            ConfigError: the legs cannot do it within 3° per joint.
        """
        start = self.data.qpos.copy()
        for _ in range(50):
            self._update()
            residual, jacobian = self._levelness()
            if np.abs(residual).max() < TOLERANCE:
                break
            self._turn(-np.linalg.pinv(jacobian, rcond=CUT_OFF) @ residual)
        change = np.abs(self.data.qpos - start)[7:]
        if np.abs(residual).max() >= TOLERANCE or change.max() > MAX_CORRECTION:
            self.data.qpos[:] = start
            mujoco.mj_kinematics(self.model, self.data)
            first, _ = self._levelness()
            tilts = np.degrees(np.hypot(first[[0, 2]], first[[1, 3]]))
            names = " and ".join(f"{self.model.body(body).name!r} by {tilt:.1f}°"
                                 for body, tilt in zip(self.feet, tilts, strict=True))  # fmt: skip
            raise ConfigError(
                "the soles cannot be made flat and equally high by turning leg joints by "
                f"{np.degrees(MAX_CORRECTION):.0f}° at most: as described, they are tilted, "
                f"{names}, and one is {1000.0 * abs(first[4]):.1f} mm higher; correct the standing "
                "posture",
                field="posture",
            )

    def centre_com(self) -> None:
        """Turn the leg joints so that the CoM is over the middle of the level soles.

        Gauss–Newton as in `level_soles`; in the null space of level soles the CoM goes to the
        middle, and the feet keep their places and their yaw relative to each other. The root keeps
        its orientation, joints stay in their range.

        Raises:
            ConfigError: the legs do not bring it there.
        """
        model, data = self.model, self.data
        start = data.qpos.copy()
        simple = [i for i in range(model.njnt) if model.jnt_type[i] in SIMPLE_JOINTS]
        limited = [i for i in simple if model.jnt_limited[i]]
        places = model.jnt_qposadr[limited]
        stance, _ = self._com_and_feet()
        goal = np.array([0.0, 0.0, *stance[2:]])
        for _ in range(100):
            self._update()
            level, rows = self._levelness()
            values, jacobian = self._com_and_feet()
            if max(np.abs(level).max(), np.abs(values - goal).max()) < TOLERANCE:
                break
            jacobian = np.where(np.any(rows != 0.0, axis=0), jacobian, 0.0)  # the dofs of one leg
            inverse = np.linalg.pinv(rows, rcond=CUT_OFF)
            change = -inverse @ level
            free = np.eye(model.nv) - inverse @ rows
            wish = goal - values - jacobian @ change
            change += free @ np.linalg.pinv(jacobian @ free, rcond=CUT_OFF) @ wish
            self._turn(change)
            data.qpos[places] = np.clip(data.qpos[places], *model.jnt_range[limited].T)
        left = float(np.hypot(*values[:2]))
        turned = float(np.abs(data.qpos - start)[7:].max())
        if np.abs(level).max() >= TOLERANCE or left > CENTRED or turned > MAX_SHIFT:
            raise ConfigError(
                f"the legs do not bring the CoM over the middle of the soles: it is "
                f"{1000.0 * np.hypot(*stance[:2]):.0f} mm away, and would be {1000.0 * left:.0f} "
                f"mm away with a joint turned by {np.degrees(turned):.0f}° (at most "
                f"{np.degrees(MAX_SHIFT):.0f}°): give a posture nearer to it",
                field="posture.com",
            )

    def turn_forward(self, forward: tuple[float, float, float]) -> None:
        """Turn the robot about the vertical until `forward`, in the root's frame, points along +x.

        Raises:
            ConfigError: this axis is steeper than 60° in the standing posture.
        """
        data = self.data
        axis = data.xmat[self.root].reshape(3, 3) @ np.asarray(forward)
        if np.hypot(axis[0], axis[1]) < 0.5 * np.linalg.norm(axis):
            raise ConfigError(
                "this axis of the root body is not level in the standing posture", field="forward"
            )
        half = -0.5 * np.arctan2(axis[1], axis[0])
        turn = np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
        mujoco.mju_mulQuat(data.qpos[3:7], turn, data.qpos[3:7].copy())
        mujoco.mj_kinematics(self.model, data)

    def _update(self) -> None:
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def _turn(self, change: np.ndarray) -> None:
        """Move the joints by (nv,), no joint by more than `STEP`."""
        shorter = min(1.0, STEP / max(float(np.abs(change).max()), 1e-12))
        mujoco.mj_integratePos(self.model, self.data.qpos, shorter * change, 1.0)

    def _jacobians(self, body: int, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(3, nv) of a point of a body [m], and of the body's turning."""
        place, turn = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, place, turn, point, body)
        return place, turn

    def _com_and_feet(self) -> tuple[np.ndarray, np.ndarray]:
        """(5,) the CoM's place from the middle of the soles, one sole's from the other, the
        difference of their yaw; and its (5, nv) Jacobian."""
        data = self.data
        points, place_rows, turn_rows, yaws = [], [], [], []
        for body, plane in zip(self.feet, self.planes, strict=True):
            rotation = data.xmat[body].reshape(3, 3)
            position, _, _ = sole_frame(plane, data.xmat[body])
            points.append(data.xpos[body] + rotation @ position)
            place, turn = self._jacobians(body, points[-1])
            place_rows.append(place[:2])
            turn_rows.append(turn[2])
            axis = rotation[:, int(np.argmax(np.hypot(rotation[0], rotation[1])))]
            yaws.append(np.arctan2(axis[1], axis[0]))
        com = np.zeros((3, self.model.nv))
        mujoco.mj_jacSubtreeCom(self.model, data, com, self.root)
        middle = 0.5 * (points[0] + points[1])
        apart = (points[0] - points[1])[:2]
        values = [*(data.subtree_com[self.root] - middle)[:2], *apart, yaws[0] - yaws[1]]
        rows = [com[:2] - 0.5 * (place_rows[0] + place_rows[1]), place_rows[0] - place_rows[1],
                (turn_rows[0] - turn_rows[1])[None]]  # fmt: skip
        return np.array(values), np.vstack(rows)

    def _levelness(self) -> tuple[np.ndarray, np.ndarray]:
        """(5,) tilt of both sole normals and height difference, and its (5, nv) Jacobian."""
        tilts, heights, tilt_rows, height_rows = [], [], [], []
        for body, plane in zip(self.feet, self.planes, strict=True):
            rotation = self.data.xmat[body].reshape(3, 3)
            normal = rotation @ plane.normal
            point = self.data.xpos[body] + rotation @ plane.points.mean(0)
            jac_pos, jac_rot = self._jacobians(body, point)
            tilts.append(normal[:2])
            tilt_rows.append(np.cross(jac_rot.T, normal).T[:2])  # ṅ = ω × n
            heights.append(point[2])
            height_rows.append(jac_pos[2])
        moved = [np.any(rows != 0, axis=0) for rows in tilt_rows]
        one_leg = moved[0] ^ moved[1]
        residual = np.concatenate([*tilts, [heights[0] - heights[1]]])
        jacobian = np.vstack([*tilt_rows, height_rows[0] - height_rows[1]])
        return residual, np.where(one_leg, jacobian, 0.0)
