"""Foot errors of a motion with steps: in swing, at touchdown, and planted."""

from dataclasses import dataclass

import numpy as np

from poise.baselines.balance.references.footing import Footing
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.motion.performing.motion_step import MotionStep


@dataclass(frozen=True)
class StepFigures:
    """Errors of the feet while a motion is performed as its schedule says; NaN without steps."""

    swing_error: float  #: root mean square distance of a swing foot's sole from the motion's [m]
    #: largest horizontal distance of a sole from where it is to be when it is planted, at the first
    #: policy step on both feet [m]
    placement_error: float
    support_slide: float  #: largest way of a planted sole from there until it lifts off [m]
    interruptions: float  #: how often steps of the planner took over


NONE = StepFigures(np.nan, np.nan, np.nan, np.nan)


class StepErrors:
    """The record of `StepFigures` of an environment that has just been reset.

    Places of the motion are those of its own frame, which stands where the soles do before the
    first foot lifts off, and after an interruption where the robot has come to rest.
    """

    def __init__(self, env: ResidualBalanceEnv, footing: Footing):
        self._env, self._footing = env, footing
        self._swing: list[float] = []
        self._placed: list[float] = []
        self._slide = 0.0
        self._resting: list[np.ndarray | None] = [None, None]
        self._swung = [False, False]

    def update(self) -> None:
        """Call it after every policy step."""
        controller = self._env.controller
        if not isinstance(controller, MotionStep):
            return
        performance = controller.performance
        if performance is None or not performance.performing:
            self._resting, self._swung = [None, None], [False, False]
            return
        p = performance
        x, y, ground, cos, sin = p.x, p.y, p.floor, p.cos, p.sin
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        sample = self._footing.sample(self._env.motion_time)
        places = sample.places[:, 0] @ turn.T + [x, y, ground]
        state, begun = self._env.simulation.state, controller.memory.steps > 0
        for foot in range(2):
            gap = state.sole_points[foot] - places[foot]
            if not sample.planted[foot]:
                self._swing.append(float(gap @ gap))
                self._resting[foot], self._swung[foot] = None, True
            elif state.contacts[foot] > 0.5 and begun:
                self._rest(foot, state.sole_points[foot], float(np.hypot(*gap[:2])))

    def _rest(self, foot: int, point: np.ndarray, gap: float) -> None:
        """Count a sole that is planted and touches the ground."""
        rest = self._resting[foot]
        if rest is None:
            self._resting[foot] = point.copy()
            if self._swung[foot]:
                self._placed.append(gap)
        else:
            self._slide = max(self._slide, float(np.linalg.norm((point - rest)[:2])))

    def figures(self) -> StepFigures:
        """Return the figures so far."""
        controller = self._env.controller
        performance = controller.performance if isinstance(controller, MotionStep) else None
        if performance is None:
            return NONE
        return StepFigures(
            float(np.sqrt(np.mean(self._swing))) if self._swing else np.nan,
            max(self._placed, default=np.nan),
            self._slide,
            float(performance.left),
        )
