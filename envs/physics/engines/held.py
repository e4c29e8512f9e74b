"""What Drake cannot hold of a robot, by name."""

from collections.abc import Iterator

import mujoco
import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot
from poise.envs.terrain.terrain import Terrain

SIMPLE = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
OBJECT = mujoco.mjtObj


def check_held(robot: Robot, terrain: Terrain | None = None) -> None:
    """Raise ConfigError that names the first element of a robot or of its ground which is not held.

    Held are one tree of rigid bodies on a free joint, hinges and slides with armature, damping, dry
    friction, springs and limits, and level ground. `terrain` takes the place of the robot's.
    """
    for element in _refused(robot, terrain or robot.terrain):
        raise ConfigError(f"drake does not hold {element}", source=robot.name, field="physics")


def _refused(robot: Robot, terrain: Terrain) -> Iterator[str]:
    model = robot.model
    if not terrain.flat:
        yield f"terrain ({type(terrain).__name__.lower()}): it has level ground alone"
    for i in range(model.neq):
        yield f"the equality constraint {_name(model, OBJECT.mjOBJ_EQUALITY, i)}"
    for i in range(model.ntendon):
        yield f"the tendon {_name(model, OBJECT.mjOBJ_TENDON, i)}"
    for i in range(1, model.njnt):
        if model.jnt_type[i] not in SIMPLE:
            kind = mujoco.mjtJoint(int(model.jnt_type[i])).name.removeprefix("mjJNT_").lower()
            yield f"the {kind} joint {_name(model, OBJECT.mjOBJ_JOINT, i)}"
    if np.any(model.dof_armature[:6]):
        yield f"armature of the free joint {_name(model, OBJECT.mjOBJ_JOINT, 0)}"
    if np.any(model.dof_frictionloss[:6]):
        yield f"friction of the free joint {_name(model, OBJECT.mjOBJ_JOINT, 0)}"
    for i in range(model.ngeom):
        fixed = model.body_weldid[model.geom_bodyid[i]] == 0
        solid = model.geom_contype[i] or model.geom_conaffinity[i]
        if fixed and solid and i != robot.ground_geom_id:
            yield f"the geom {_name(model, OBJECT.mjOBJ_GEOM, i)}, which does not move"


def _name(model: mujoco.MjModel, kind: mujoco.mjtObj, index: int) -> str:
    return repr(mujoco.mj_id2name(model, kind, index) or str(index))
