"""The packaged clips: `python -m poise.training.motion.recording [FOLDER]` makes them again.

They are keyframes of the default humanoid, in configs/motions and configs/clips/keyframes. So no
file of anybody else is needed to try retargeting, motion graphs and scripts.
"""

import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from poise.baselines.balance.references.motion import (
    MotionDescription,
    load_steps,
    make_motion,
    motions_with_steps,
)
from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.balance.references.robot_clip import RATE
from poise.baselines.motion.clips.bvh import write_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.rotations import from_scipy
from poise.baselines.motion.clips.skeleton import SIDES, Skeleton
from poise.configs.files import packaged_folder
from poise.configs.schema import build, read_yaml
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import Robot, load_robot

from .tracking.reference import ReferenceBodies, SolePlaces

LICENCE = "Apache-2.0"
TOE = 0.8  # of the way to the front of the sole
END = 0.05  # [m] from the last joints to their ends, ahead
#: joint → the one above, the body that turns with it, and the hinge or the geom where its place is
BONES = {
    "Hips": ("", "pelvis", ""),
    "Spine": ("Hips", "lwaist", "abdomen_x"),
    "Chest": ("Spine", "torso", "abdomen_z"),
    "Head": ("Chest", "torso", "head"),
    **{
        f"{side}{name}": (above.format(side), body.format(side.lower()), hinge.format(side.lower()))
        for side in ("Left", "Right")
        for name, above, body, hinge in (
            ("Arm", "Chest", "{}_upper_arm", "{}_shoulder1"),
            ("ForeArm", "{}Arm", "{}_lower_arm", "{}_elbow"),
            ("Hand", "{}ForeArm", "{}_lower_arm", "{}_hand"),
            ("UpLeg", "Hips", "{}_thigh", "{}_hip_x"),
            ("Leg", "{}UpLeg", "{}_shin", "{}_knee"),
            ("Ankle", "{}Leg", "{}_foot", "{}_ankle_y"),
            ("Foot", "{}Ankle", "{}_foot", "{}_ankle_x"),
            ("ToeBase", "{}Foot", "{}_foot", ""),
        )
    },
}


def record_clips() -> list[Clip]:
    """Return all packaged clips, of the default humanoid, in the order of their names."""
    robot = load_robot("humanoid")
    made = {path.stem: clip_of(robot, _postures(robot, path), RATE, path.stem) for path in _files()}
    return [replace(made[name], name=f"humanoid_{name}") for name in sorted(made)]


def _files() -> list[Path]:
    motions = packaged_folder("motions")
    recorded = [motions / f"{name}.yaml" for name in motions_with_steps()]
    return [*recorded, *(packaged_folder("clips") / "keyframes").glob("*.yaml")]


def _postures(robot: Robot, path: Path) -> np.ndarray:
    """Return the postures (F, nq) of a file of keyframes, in which joints are roles too."""
    own = {name: {name: 1.0} for name in robot.joint_names}
    roles = {**robot.description.roles, **own}
    free = replace(robot, description=replace(robot.description, roles=roles))
    description = build(MotionDescription, read_yaml(path), str(path))
    if description.steps:
        return load_steps(path, free).qpos
    return postures_of(make_motion(description, free, path.stem, str(path)), robot)


def postures_of(motion: ReferenceMotion, robot: Robot) -> np.ndarray:
    """Return the postures (F, nq) of a motion whose soles stay, `RATE` apart."""
    bodies, stance = ReferenceBodies(motion, robot), SolePlaces.of(Simulation(robot).state)
    found = []
    for time in np.arange(0.0, motion.duration + 0.5 * RATE, RATE):
        bodies.at(time, stance)
        found.append(bodies.posture)
    return np.array(found)


def clip_of(robot: Robot, qpos: np.ndarray, dt: float, name: str) -> Clip:
    """Postures (F, nq) of the default humanoid as a clip of a skeleton with the usual names."""
    data = mujoco.MjData(robot.model)
    data.qpos[3] = 1.0
    rest, rest_axes = _bones(robot, data)
    names, parents = list(BONES), [list(BONES).index(a) if a else -1 for a, *_ in BONES.values()]
    ends = [i for i in range(len(names)) if i not in parents]
    offsets = np.tile([END, 0.0, 0.0], (len(ends), 1))
    between = np.array([rest[i] - rest[max(p, 0)] for i, p in enumerate(parents)])
    skeleton = Skeleton(tuple(names), np.array(parents), between, np.array(ends),
                        offsets, ("ZYX",) * len(names))  # fmt: skip
    root, turns = np.empty((len(qpos), 3)), np.empty((len(qpos), len(names), 3, 3))
    for frame, posture in enumerate(qpos):
        data.qpos[:] = posture
        places, axes = _bones(robot, data)
        world = axes @ rest_axes.transpose(0, 2, 1)  # in the rest pose all axes are the world's
        root[frame] = places[0]
        above = np.array([world[p].T if p >= 0 else np.eye(3) for p in parents])
        turns[frame] = above @ world
    flat = Rotation.from_matrix(turns.reshape(-1, 3, 3))
    return Clip(name, skeleton, dt, root, from_scipy(flat, turns.shape[:2]), LICENCE)


def _bones(robot: Robot, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
    """Places (J, 3) and axes (J, 3, 3) of the joints of `BONES`, of the posture in `data`."""
    model = robot.model
    mujoco.mj_kinematics(model, data)
    places, axes = np.empty((len(BONES), 3)), np.empty((len(BONES), 3, 3))
    soles = {sole.body_id: sole for sole in robot.soles}
    for i, (name, (_, body, where)) in enumerate(BONES.items()):
        axes[i] = data.body(body).xmat.reshape(3, 3)
        if name == "Hips":
            places[i] = np.mean([data.joint(f"{s}_hip_x").xanchor for s in SIDES], axis=0)
        elif name.endswith("ToeBase"):
            sole = soles[model.body(body).id]
            front = sole.rotation @ [TOE * sole.polygon[:, 0].max(), 0.0, 0.0]
            places[i] = data.body(body).xpos + axes[i] @ (sole.position + front)
        elif name == "Head" or name.endswith("Hand"):
            places[i] = data.geom(where).xpos
        else:
            places[i] = data.joint(where).xanchor
        if name.endswith("Ankle"):  # what is above the second hinge of the foot, which is lower
            roll = data.joint(f"{body[:-5]}_ankle_x")
            axes[i] = Rotation.from_rotvec(-roll.qpos * roll.xaxis).as_matrix() @ axes[i]
    return places, axes


def main(folder: str | Path | None = None) -> None:
    """Write the clips to `folder`; that of the packaged ones if not given."""
    out = Path(folder) if folder else packaged_folder("clips")
    for clip in record_clips():
        write_bvh(clip, out / f"{clip.name}.bvh")
        print(out / f"{clip.name}.bvh")


if __name__ == "__main__":
    main(*sys.argv[1:2])
