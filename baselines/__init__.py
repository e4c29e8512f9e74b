"""Controllers: state and targets in, joint torques out."""

if __name__ == "baselines":
    raise ImportError("this folder is the package poise.baselines: write `import poise.baselines`")

from typing import TYPE_CHECKING

from poise.lazy import lazy

__all__ = [
    "BaseController",
    "CaptureStep",
    "CaptureStepConfig",
    "CompiledController",
    "Controller",
    "MomentumQP",
    "MomentumQPConfig",
    "ReferenceMotion",
    "ResidualBalanceEnv",
    "ResidualScales",
    "ResidualStepEnv",
    "ResidualWholeEnv",
    "StepScales",
    "SteppingController",
    "Targets",
    "WholeScales",
    "WrappedController",
    "load_controller",
    "load_motion",
]

if TYPE_CHECKING:
    from poise.baselines.controller import (
        BaseController,
        CompiledController,
        Controller,
        Targets,
        WrappedController,
    )
    from poise.baselines.environments.residual import ResidualBalanceEnv
    from poise.baselines.environments.scales import ResidualScales, StepScales, WholeScales
    from poise.baselines.environments.stepping import ResidualStepEnv
    from poise.baselines.environments.whole import ResidualWholeEnv
    from poise.baselines.motions.motion import load_motion
    from poise.baselines.motions.reference_motion import ReferenceMotion
    from poise.baselines.registry import load_controller
    from poise.baselines.stepping.capture_step import CaptureStep
    from poise.baselines.stepping.config import CaptureStepConfig
    from poise.baselines.stepping.controller import SteppingController
    from poise.baselines.whole_body.momentum_qp import MomentumQP, MomentumQPConfig
else:
    __getattr__, __dir__ = lazy(
        __name__,
        {
            "controller": (
                "BaseController",
                "CompiledController",
                "Controller",
                "Targets",
                "WrappedController",
            ),
            "environments.residual": ("ResidualBalanceEnv",),
            "environments.scales": ("ResidualScales", "StepScales", "WholeScales"),
            "environments.stepping": ("ResidualStepEnv",),
            "environments.whole": ("ResidualWholeEnv",),
            "motions.motion": ("load_motion",),
            "motions.reference_motion": ("ReferenceMotion",),
            "registry": ("load_controller",),
            "stepping.capture_step": ("CaptureStep",),
            "stepping.config": ("CaptureStepConfig",),
            "stepping.controller": ("SteppingController",),
            "whole_body.momentum_qp": ("MomentumQP", "MomentumQPConfig"),
        },
    )
