"""A humanoid whose right hand is on a wall in front of it."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

import mujoco
import numpy as np
import yaml

from poise.configs.files import packaged_folder
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.models.humanoid import humanoid_spec
from poise.envs.robots.robot import Robot, load_robot
from tests.support.shared import robot

ARM = {
    "right_shoulder1": 0.15,
    "right_shoulder2": 0.5,
    "right_elbow": -1.39,
}  # [rad] straight ahead
HAND = (0.18, 0.18, 0.18)  # of the geom right_hand in right_lower_arm [m]
RADIUS, HALF = 0.04, 0.05  # [m] of the hand; half of the wall's thickness


def contact_described(**changes):
    """The hand's contact in a configuration."""
    contact = {"kind": "point", "body": "right_lower_arm", "point": list(HAND), "force": 0.06}
    return {**contact, "normal": [-1.0, 0.0, 0.0], **changes}


def reaching(body: Robot) -> np.ndarray:
    """(nq,) standing, the right arm straight ahead."""
    qpos = body.standing_qpos.copy()
    for name, angle in ARM.items():
        qpos[7 + body.joint_names.index(name)] = angle
    return qpos


@functools.cache
def robot_at_a_wall() -> Robot:
    """The humanoid, and a wall across x that its hand touches in the posture `reaching`."""
    data = mujoco.MjData(robot().model)
    data.qpos[:] = reaching(robot())
    mujoco.mj_kinematics(robot().model, data)
    spec = humanoid_spec()
    x = data.geom("right_hand").xpos[0] + RADIUS + HALF
    spec.worldbody.add_geom(
        name="wall", type=mujoco.mjtGeom.mjGEOM_BOX, pos=[x, 0.0, 1.0], size=[HALF, 1.0, 1.0],
        friction=[0.8, 0.005, 0.0001],
    )  # fmt: skip
    spec.compile()
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "wall.xml").write_text(spec.to_xml())
        described = yaml.safe_load((packaged_folder("robots") / "humanoid.yaml").read_text())
        described["source"] = {"mjcf": "wall.xml"}
        path = Path(folder) / "wall.yaml"
        path.write_text(yaml.safe_dump(described))
        return load_robot(path)


def wall_force(simulation: Simulation) -> np.ndarray:
    """(3,) force of the wall on the robot at this very instant [N], world axes."""
    model, total = simulation.model, np.zeros(3)
    data = mujoco.MjData(model)
    mujoco.mj_copyData(data, model, simulation.data)
    mujoco.mj_forward(model, data)
    wall = model.geom("wall").id
    for i, contact in enumerate(data.contact):
        if wall in contact.geom:
            wrench = np.zeros(6)
            mujoco.mj_contactForce(model, data, i, wrench)
            sign = -1.0 if contact.geom2 == wall else 1.0
            total += sign * contact.frame.reshape(3, 3).T @ wrench[:3]
    return total
