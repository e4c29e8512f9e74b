"""The world: robots, state, pushes and Gymnasium environments."""

if __name__ == "envs":
    raise ImportError("this folder is the package poise.envs: write `import poise.envs`")

from typing import TYPE_CHECKING

from poise.envs.viewing.gl import load_osmesa_alone
from poise.lazy import lazy

__all__ = [
    "BalanceEnv",
    "BalanceVectorEnv",
    "Camera",
    "EnvBatch",
    "EnvConfig",
    "EstimatedState",
    "EstimatorConfig",
    "FallLimits",
    "Kick",
    "PlainInfo",
    "PositionBalanceEnv",
    "Push",
    "PushSampler",
    "Realism",
    "RewardWeights",
    "Robot",
    "RobotState",
    "SceneRenderer",
    "ServoConfig",
    "Simulation",
    "StateSource",
    "Terrain",
    "TorqueBalanceEnv",
    "choose_gl_backend",
    "load_robot",
    "make_terrain",
    "observation_table",
    "on_terrain",
    "parse_pushes",
    "replicate",
]

load_osmesa_alone()  # before anything of ours loads MuJoCo

if TYPE_CHECKING:
    from poise.envs.balance.base import BalanceEnv
    from poise.envs.balance.config import EnvConfig
    from poise.envs.balance.observation import observation_table
    from poise.envs.balance.position import PositionBalanceEnv
    from poise.envs.balance.reward import RewardWeights
    from poise.envs.balance.servos import ServoConfig
    from poise.envs.balance.termination import FallLimits
    from poise.envs.balance.torque import TorqueBalanceEnv
    from poise.envs.physics.simulation import Simulation
    from poise.envs.physics.state import RobotState
    from poise.envs.plain_info import PlainInfo
    from poise.envs.pushes.options import parse_pushes
    from poise.envs.pushes.push import Kick, Push
    from poise.envs.pushes.sampler import PushSampler
    from poise.envs.robots.robot import Robot, load_robot, on_terrain
    from poise.envs.sensing.estimator import EstimatedState, EstimatorConfig
    from poise.envs.sensing.realism import Realism
    from poise.envs.sensing.source import StateSource
    from poise.envs.terrain.terrain import Terrain, make_terrain
    from poise.envs.vector.batch import EnvBatch, replicate
    from poise.envs.vector.vector_env import BalanceVectorEnv
    from poise.envs.viewing.camera import Camera
    from poise.envs.viewing.gl import choose_gl_backend
    from poise.envs.viewing.renderer import SceneRenderer
else:
    __getattr__, __dir__ = lazy(
        __name__,
        {
            "balance.base": ("BalanceEnv",),
            "balance.config": ("EnvConfig",),
            "balance.observation": ("observation_table",),
            "balance.position": ("PositionBalanceEnv",),
            "balance.reward": ("RewardWeights",),
            "balance.servos": ("ServoConfig",),
            "balance.termination": ("FallLimits",),
            "balance.torque": ("TorqueBalanceEnv",),
            "physics.simulation": ("Simulation",),
            "physics.state": ("RobotState",),
            "plain_info": ("PlainInfo",),
            "pushes.options": ("parse_pushes",),
            "pushes.push": ("Kick", "Push"),
            "pushes.sampler": ("PushSampler",),
            "robots.robot": ("Robot", "load_robot", "on_terrain"),
            "sensing.estimator": ("EstimatedState", "EstimatorConfig"),
            "sensing.realism": ("Realism",),
            "sensing.source": ("StateSource",),
            "terrain.terrain": ("Terrain", "make_terrain"),
            "vector.batch": ("EnvBatch", "replicate"),
            "vector.vector_env": ("BalanceVectorEnv",),
            "viewing.camera": ("Camera",),
            "viewing.gl": ("choose_gl_backend",),
            "viewing.renderer": ("SceneRenderer",),
        },
    )
