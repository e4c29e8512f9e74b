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
    from poise.envs.balance.mdp.observation import observation_table
    from poise.envs.balance.mdp.reward import RewardWeights
    from poise.envs.balance.mdp.termination import FallLimits
    from poise.envs.balance.plain_info import PlainInfo
    from poise.envs.balance.position import PositionBalanceEnv
    from poise.envs.balance.servos import ServoConfig
    from poise.envs.balance.torque import TorqueBalanceEnv
    from poise.envs.balance.vector.batch import EnvBatch, replicate
    from poise.envs.balance.vector.vector_env import BalanceVectorEnv
    from poise.envs.physics.pushes.options import parse_pushes
    from poise.envs.physics.pushes.push import Kick, Push
    from poise.envs.physics.pushes.sampler import PushSampler
    from poise.envs.physics.simulation import Simulation
    from poise.envs.physics.state import RobotState
    from poise.envs.physics.state_source import StateSource
    from poise.envs.robots.robot import Robot, load_robot, on_terrain
    from poise.envs.sensing.config import EstimatorConfig
    from poise.envs.sensing.estimator import EstimatedState
    from poise.envs.sensing.realism import Realism
    from poise.envs.terrain.terrain import Terrain, make_terrain
    from poise.envs.viewing.camera import Camera
    from poise.envs.viewing.gl import choose_gl_backend
    from poise.envs.viewing.renderer import SceneRenderer
else:
    __getattr__, __dir__ = lazy(__name__, __file__)
