"""Training, evaluation, benchmark, report and the command line."""

if __name__ == "training":
    raise ImportError("this folder is the package poise.training: write `import poise.training`")

from typing import TYPE_CHECKING

from poise.lazy import lazy

__all__ = [
    "LowCmdBridge",
    "LowCmdRobot",
    "Measurement",
    "MirroredMeanStd",
    "MirroredPolicy",
    "MotorCommand",
    "Policy",
    "Readings",
    "SensedController",
    "StandaloneController",
    "ThreadedVecEnv",
    "TrainConfig",
    "benchmark",
    "compare",
    "evaluate",
    "export_policy",
    "frame_strip",
    "load_policy",
    "load_results",
    "load_standalone",
    "record",
    "replay",
    "slow_actor",
    "train",
    "train_config",
    "train_seeds",
    "tune",
    "write_dataset",
    "write_report",
]

if TYPE_CHECKING:
    from poise.training.benchmarking.evaluation.evaluate import benchmark, evaluate
    from poise.training.benchmarking.results.compare import compare
    from poise.training.benchmarking.results.read import load_results
    from poise.training.benchmarking.results.replay import replay
    from poise.training.deploy.export.dataset import write_dataset
    from poise.training.deploy.export.export import export_policy
    from poise.training.deploy.lowcmd.bridge import LowCmdBridge
    from poise.training.deploy.lowcmd.simulated import LowCmdRobot
    from poise.training.deploy.standalone.controller import StandaloneController, load_standalone
    from poise.training.deploy.standalone.readings import Measurement, Readings
    from poise.training.deploy.standalone.sensed import MotorCommand, SensedController
    from poise.training.learning.config import TrainConfig, train_config
    from poise.training.learning.policy import Policy, load_policy
    from poise.training.learning.seeds.train import train_seeds
    from poise.training.learning.symmetry import MirroredMeanStd, MirroredPolicy
    from poise.training.learning.train import slow_actor, train
    from poise.training.learning.tuning.search import tune
    from poise.training.learning.vec_env import ThreadedVecEnv
    from poise.training.pictures.figures.video import frame_strip, record
    from poise.training.pictures.report.page import write_report
else:
    __getattr__, __dir__ = lazy(__name__, __file__)
