"""What a controller that steps is: how it can be moved, and where it is in its steps."""

from poise.baselines.controller import BaseController

from .offsets import Stepping, StepShift
from .planner import StepLimits


class SteppingController(BaseController):
    """A controller that decides where its feet go, and lets a policy move what it decides."""

    shift: StepShift  #: added to its own choices

    def stepping(self) -> Stepping:
        """Where it is in its steps."""
        raise NotImplementedError

    @property
    def step_limits(self) -> StepLimits | None:
        """The steps that it allows itself; None: it knows no limits."""
        return None
