"""The joints between a body that stays and bodies that are to be moved, and their kinematics."""

from collections.abc import Iterable, Mapping

import mujoco
import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.envs.compiled.copies import Copyable
from poise.envs.robots.description import match_names
from poise.envs.robots.robot import Robot


class Chain(Copyable):
    """Hinges and slides on the ways of a robot's tree from a base body to end bodies.

    Places and Jacobians are in the axes of the base, so the root need not be its end: with a foot
    for the base, the legs' joints move the trunk. The free joint of the root is never one of them.
    The joints on the ways to bodies `along` are part of it, too, though these are no ends.

    Attributes:
        names: of the n joints, from the base outwards, one end after the other.
        qpos: (n,) their addresses in qpos.
        dofs: (n,) their degrees of freedom.
        low, high: (n,) their limits [rad or m], infinite where there are none.
        mobility: (n,) shares in (0, 1] of a joint's part in a step.
        moves: (n, ends) whether a joint is on the way to an end.
        signs: (n,) -1 for a joint on the way from the base up to the common ancestor: it turns
            the base and not the end.
    """

    def __init__(
        self,
        robot: Robot,
        base: str,
        ends: Iterable[str],
        mobility: Mapping[str, float] | None = None,
        along: Iterable[str] = (),
    ):
        self.robot, self.model = robot, robot.model
        self.data = mujoco.MjData(robot.model)
        self.base = self._body(base)
        self.ends = tuple(self._body(end) for end in ends)
        shares = self._shares(mobility or {})
        ways = [self._way(end) for end in (*self.ends, *(self._body(body) for body in along))]
        found = dict.fromkeys(j for way in ways for j in way)
        joints = [j for j in found if shares[j] > 0.0]
        if not joints:
            raise ConfigError(f"no joint between {base!r} and its ends can move",
                              source=robot.name, field="mobility")  # fmt: skip
        self.joints = np.array(joints)
        self.names = tuple(self.model.joint(j).name for j in joints)
        self.qpos, self.dofs = self.model.jnt_qposadr[joints], self.model.jnt_dofadr[joints]
        self.low, self.high = robot.joint_range[self.joints - 1].T
        self.mobility = np.array([shares[j] for j in joints])
        self.moves = np.array([[j in way for way in ways[: len(self.ends)]] for j in joints])
        self.signs = np.array([next(way[j] for way in ways if j in way) for j in joints])
        self.slides = self.model.jnt_type[joints] == int(mujoco.mjtJoint.mjJNT_SLIDE)
        self.place(robot.standing_qpos)

    def place(self, qpos: np.ndarray) -> None:
        """Put the whole robot into a posture (nq,)."""
        self.data.qpos[:] = qpos
        self._update()

    def move(self, q: np.ndarray) -> None:
        """Put the chain's joints at positions (n,); the other joints stay."""
        self.data.qpos[self.qpos] = q
        self._update()

    def _update(self) -> None:
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    @property
    def q(self) -> np.ndarray:
        """(n,) positions of the chain's joints."""
        return self.data.qpos[self.qpos]

    @property
    def free(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest positions (n,) with finite ones, half a turn, for absent limits."""
        around = self.robot.standing_qpos[self.qpos]
        low = np.where(np.isfinite(self.low), self.low, around - np.pi)
        return low, np.where(np.isfinite(self.high), self.high, around + np.pi)

    def clipped(self, q: np.ndarray) -> np.ndarray:
        """The nearest positions (n,) within the limits."""
        return np.clip(q, self.low, self.high)

    def frame(self) -> tuple[np.ndarray, np.ndarray]:
        """Place (3,) and axes (3, 3) of the base in the world."""
        return self.data.xpos[self.base], self.data.xmat[self.base].reshape(3, 3)

    def end_pose(self, end: int, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Place (3,) of a point of the end with that number and the end's axes (3, 3), in the
        axes of the base; the point (3,) in those of the end [m]."""
        place, axes = self.frame()
        body = self.ends[end]
        own = self.data.xmat[body].reshape(3, 3)
        return axes.T @ (self.data.xpos[body] + own @ point - place), axes.T @ own

    def jacobians(self, end: int, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """∂/∂q (3, n) of `end_pose`: of the place, and the angular velocity in the base's axes.

        The difference of the Jacobians of end and base at one point of the world, so that the
        columns of what moves both vanish.
        """
        body, (_, axes) = self.ends[end], self.frame()
        at = self.data.xpos[body] + self.data.xmat[body].reshape(3, 3) @ point
        rows = np.zeros((2, 2, 3, self.model.nv))
        for i, each in enumerate((body, self.base)):
            mujoco.mj_jac(self.model, self.data, rows[i, 0], rows[i, 1], at, each)
        moved = axes.T @ (rows[0] - rows[1])[:, :, self.dofs]
        return moved[0], moved[1]

    def lines(self) -> tuple[np.ndarray, np.ndarray]:
        """Anchors (n, 3) and unit axes (n, 3) of the joints in the axes of the base; about an axis,
        or along it, a joint moves the end, its sign included."""
        place, axes = self.frame()
        anchors = (self.data.xanchor[self.joints] - place) @ axes
        return anchors, self.signs[:, None] * (self.data.xaxis[self.joints] @ axes)

    def whole(self, q: np.ndarray, start: np.ndarray) -> np.ndarray:
        """(nq,) the posture `start` (nq,) with the chain's joints at `q`, its base where it was."""
        self.place(start)
        before = _pose(*self.frame())
        self.move(q)
        qpos = self.data.qpos.copy()
        if self.base != self.robot.root_body_id:
            root = _pose(qpos[:3], self.data.xmat[self.robot.root_body_id].reshape(3, 3))
            moved = before @ np.linalg.inv(_pose(*self.frame())) @ root
            qpos[:3] = moved[:3, 3]
            mujoco.mju_mat2Quat(qpos[3:7], moved[:3, :3].ravel())
        return qpos

    def _body(self, name: str) -> int:
        bodies = [self.model.body(i).name for i in range(1, self.model.nbody)]
        if name not in bodies:
            raise ConfigError(f"the model has no body {shown(name)}", source=self.robot.name,
                              field="body", choices=bodies)  # fmt: skip
        return bodies.index(name) + 1

    def _shares(self, mobility: Mapping[str, float]) -> np.ndarray:
        """(njnt,) shares of all joints; raises ConfigError for a strange name or share."""
        names = list(self.robot.joint_names)
        for name, share in mobility.items():
            if not 0.0 <= share <= 1.0:
                raise ConfigError(f"must be from 0 to 1, not {shown(share)}",
                                  field=f"mobility.{name}")  # fmt: skip
        shares = np.ones(self.model.njnt)
        matched = match_names(dict(mobility), names, self.robot.name, "mobility")
        for name, share in matched.items():
            shares[names.index(name) + 1] = share
        return shares

    def _way(self, end: int) -> dict[int, float]:
        """Joint → sign, of the joints from the base to an end in this order."""
        up, down = self._ancestors(self.base), self._ancestors(end)
        shared = set(up) & set(down)
        before = [j for body in up if body not in shared for j in reversed(self._of(body))]
        after = [j for body in reversed(down) if body not in shared for j in self._of(body)]
        return {**dict.fromkeys(before, -1.0), **dict.fromkeys(after, 1.0)}

    def _ancestors(self, body: int) -> list[int]:
        """A body, its parent, and so on, the world last."""
        found = [body]
        while found[-1]:
            found.append(int(self.model.body_parentid[found[-1]]))
        return found

    def _of(self, body: int) -> list[int]:
        """The joints of a body but for the free one."""
        first, count = int(self.model.body_jntadr[body]), int(self.model.body_jntnum[body])
        return [j for j in range(first, first + count) if j]


def _pose(place: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """(4, 4) the homogeneous matrix of a place (3,) and axes (3, 3)."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = axes, place
    return pose
