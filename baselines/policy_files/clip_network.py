"""The clip that some trackers have within their network: asked for it, frame by frame."""

from collections.abc import Sequence

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

from .motion.clips import FRAMES, ClipFrames, FrameClip, make_clip
from .motion.config import TIME_STEP
from .motion.track import USUAL_ANCHOR
from .networks import Network, OnnxNetwork

JOINTS = ("joint_pos", "joint_vel")
BODIES = ("body_pos_w", "body_quat_w")  # BeyondMimic, mjlab: of all tracked bodies, wxyz
ANCHOR = ("ref_pos_xyz", "ref_quat_xyzw")  # holosoma: of the anchor


def network_clip(
    network: Network, robot: Robot, joints: Sequence[str], anchor: str, period: float, source: str
) -> FrameClip:
    """The clip that a network gives for each `time_step`.

    The root is the first body that it gives, or it follows from where it has the anchor.

    Raises ConfigError for a network without such an input and outputs.
    """
    outputs = network.output_names if isinstance(network, OnnxNetwork) else ()
    inputs = network.input_names if isinstance(network, OnnxNetwork) else ()
    pose = next((each for each in (BODIES, ANCHOR) if set(each) <= set(outputs)), None)
    if TIME_STEP not in inputs or not set(JOINTS) <= set(outputs) or pose is None:
        raise ConfigError(
            "the network holds no clip: it has no input time_step, or does not give joint_pos, "
            "joint_vel and the pose of bodies; name the clip's file", source=source,
            field="motion.clip",
        )  # fmt: skip
    assert isinstance(network, OnnxNetwork)
    wanted = (*JOINTS, *pose)
    rows = [network.frame(step, wanted) for step in range(_length(network, wanted))]
    q, v, places, quats = (np.array([row[i] for row in rows]) for i in range(4))
    if q.shape[1] != len(joints):
        raise ConfigError(f"the network gives {q.shape[1]} joints, the policy has {len(joints)}",
                          source=source, field="motion.clip")  # fmt: skip
    places, quats = places[:, :3], quats[:, :4]
    if pose == ANCHOR:
        places, quats = _roots(robot, joints, anchor or USUAL_ANCHOR, q, places, quats)
    return make_clip(source, robot, joints, period, ClipFrames(1.0 / period, places, quats, q, v))


def _length(network: OnnxNetwork, wanted: Sequence[str]) -> int:
    """Frames of the clip: those before it no longer changes."""
    last = network.frame(FRAMES - 1, wanted)

    def over(step: int) -> bool:
        frame = network.frame(step, wanted)
        return all(np.array_equal(a, b) for a, b in zip(frame, last, strict=True))

    low, high = 0, FRAMES - 1
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if over(middle) else (middle + 1, high)
    return low + 1


def _roots(
    robot: Robot, joints: Sequence[str], anchor: str, q: np.ndarray, places: np.ndarray,
    quats: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Where the root is, (T, 3) and (T, 4) wxyz, whose anchor is there, quaternions xyzw."""
    model, data = robot.model, mujoco.MjData(robot.model)
    index = [7 + robot.joint_names.index(name) for name in joints]
    body = model.body(anchor).id
    turns = Rotation.from_quat(quats)
    roots, found = np.empty((len(q), 3)), np.empty((len(q), 4))
    for i, posture in enumerate(q):
        data.qpos[:3], data.qpos[3:7], data.qpos[index] = 0.0, (1.0, 0.0, 0.0, 0.0), posture
        mujoco.mj_kinematics(model, data)
        own = Rotation.from_matrix(data.xmat[body].reshape(3, 3))
        turn = turns[i] * own.inv()
        roots[i] = places[i] - turn.apply(data.xpos[body])
        found[i] = turn.as_quat()[[3, 0, 1, 2]]
    return roots, found
