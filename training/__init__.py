"""Training, evaluation, benchmark, report and the command line."""

if __name__ == "training":
    raise ImportError("this folder is the package poise.training: write `import poise.training`")

from typing import TYPE_CHECKING

from poise.lazy import lazy

__all__ = [
    "Policy",
    "Readings",
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
    "train",
    "train_config",
    "train_seeds",
    "tune",
    "write_dataset",
    "write_report",
]

if TYPE_CHECKING:
    from poise.training.evaluation.evaluate import benchmark, evaluate
    from poise.training.export.dataset import write_dataset
    from poise.training.export.export import export_policy
    from poise.training.figures.video import frame_strip, record
    from poise.training.learning.config import TrainConfig, train_config
    from poise.training.learning.policy import Policy, load_policy
    from poise.training.learning.train import train
    from poise.training.learning.train_seeds import train_seeds
    from poise.training.learning.vec_env import ThreadedVecEnv
    from poise.training.report.page import write_report
    from poise.training.results.compare import compare
    from poise.training.results.read import load_results
    from poise.training.results.replay import replay
    from poise.training.standalone.controller import StandaloneController, load_standalone
    from poise.training.standalone.readings import Readings
    from poise.training.tuning.search import tune
else:
    __getattr__, __dir__ = lazy(
        __name__,
        {
            "evaluation.evaluate": ("benchmark", "evaluate"),
            "export.dataset": ("write_dataset",),
            "export.export": ("export_policy",),
            "figures.video": ("frame_strip", "record"),
            "learning.config": ("TrainConfig", "train_config"),
            "learning.policy": ("Policy", "load_policy"),
            "learning.train": ("train",),
            "learning.train_seeds": ("train_seeds",),
            "learning.vec_env": ("ThreadedVecEnv",),
            "report.page": ("write_report",),
            "results.compare": ("compare",),
            "results.read": ("load_results",),
            "results.replay": ("replay",),
            "standalone.controller": ("StandaloneController", "load_standalone"),
            "standalone.readings": ("Readings",),
            "tuning.search": ("tune",),
        },
    )
