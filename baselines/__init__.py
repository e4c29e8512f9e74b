"""Controllers: state and targets in, joint torques out."""

if __name__ == "baselines":
    raise ImportError("this folder is the package poise.baselines: write `import poise.baselines`")

from typing import TYPE_CHECKING

from poise.lazy import lazy

__all__ = [
    "BaseController",
    "CaptureStep",
    "CaptureStepConfig",
    "CommandSampler",
    "CompiledController",
    "Controller",
    "GaitCommand",
    "MomentumQP",
    "MomentumQPConfig",
    "ReferenceMotion",
    "ResidualBalanceEnv",
    "ResidualScales",
    "ResidualStepEnv",
    "ResidualWalkEnv",
    "ResidualWholeEnv",
    "StepScales",
    "SteppingController",
    "Targets",
    "WalkingController",
    "WholeScales",
    "WrappedController",
    "load_controller",
    "load_motion",
]

#: public names that are those of `poise.baselines.motion` now; read here for one release
MOVED = {
    "IkGoal",
    "IkOptions",
    "IkResult",
    "InverseKinematics",
    "PosePrior",
    "retarget_clip",
    "solve_ik",
}

if TYPE_CHECKING:
    from poise.baselines.balance.references.motion import load_motion
    from poise.baselines.balance.references.reference_motion import ReferenceMotion
    from poise.baselines.balance.stepping.capture_step import CaptureStep
    from poise.baselines.balance.stepping.controller import SteppingController
    from poise.baselines.balance.stepping.planning.config import CaptureStepConfig
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
    from poise.baselines.environments.walking import ResidualWalkEnv
    from poise.baselines.environments.whole import ResidualWholeEnv
    from poise.baselines.registry import load_controller
    from poise.baselines.walking.controller import WalkingController
    from poise.baselines.walking.planner.command import GaitCommand
    from poise.baselines.walking.schedule import CommandSampler
    from poise.baselines.whole_body.gains import MomentumQPConfig
    from poise.baselines.whole_body.momentum_qp import MomentumQP
else:
    _find, __dir__ = lazy(__name__, __file__)

    def __getattr__(name: str) -> object:
        if name not in MOVED:
            return _find(name)
        import warnings

        from poise.baselines.extras import load_extra

        message = f"poise.baselines.{name} is poise.baselines.motion.{name}"
        warnings.warn(message, DeprecationWarning, stacklevel=2)
        return load_extra("moved", "motion", f"poise.baselines.{name}")(name)
