"""`poise/Velocity-v0`: joint servos walk as commanded, and keep the pushed robot on its feet."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from poise.baselines.controller import COMMAND_ENTRIES
from poise.baselines.walking.admittance import QUICK_TIME, Admittance, give_way
from poise.baselines.walking.calibration import Calibration
from poise.baselines.walking.correction import MEAN_TIME, Correction, correct_course
from poise.baselines.walking.evasion import AGAIN, Evasion, evade
from poise.baselines.walking.planner.command import GaitCommand
from poise.baselines.walking.schedule import (
    CommandSampler,
    TimedCommand,
    command_sampler,
    follow_timetable,
)
from poise.baselines.walking.smoothing import Smoothing, aim_smoothly
from poise.envs.balance.config import EnvConfig
from poise.envs.balance.episode import end_step
from poise.envs.balance.mdp.observation import View
from poise.envs.balance.position import PositionBalanceEnv, PositionStep, run_servos
from poise.envs.balance.torque import MotorStep
from poise.envs.balance.vector.vector_env import make_vector_env
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Program
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.robots.robot import Robot

from .commanded import CommandedEnv, FollowingEnv
from .velocity_terms import VELOCITY_TERMS, CommandView, Course, follow_course


@dataclass(frozen=True, eq=False)
class VelocityStep(PositionStep):
    """All that a policy step works on."""

    course: Course
    correction: Correction
    admittance: Admittance
    evasion: Evasion
    smoothing: Smoothing


@compiled
def velocity_step(step: VelocityStep):
    """The policy step of `position_step`, judged by the command too."""
    aim_smoothly(step.smoothing, step.servos, step.episode.action)
    run_servos(step)
    follow_course(step.course)
    correct_course(step.correction)
    give_way(step.admittance)
    evade(step.evasion)
    end_step(step.end)


class VelocityEnv(FollowingEnv, CommandedEnv, PositionBalanceEnv):
    """Walk or stand as commanded, pushed or not, by targets of the joints' positions.

    Action: Box(−1, 1, (nu,)), that of `PositionBalanceEnv`: a target for each motor's servo, zero
    stands. There is no controller, no plan and no clock below it.

    Observation: <observation>

    The push is not observed. The reference is the standing posture at rest. With sensor noise or
    delay all terms are of the raw measurements: nothing is estimated.

    <rewards>

    The commanded velocity counts in `velocity`, `turning` and, by a mean over 0.5 s, in `tracking`
    and `pace`; `quiet` is earned only where the command is to stand.

    <start>

    Info: in addition "command" (3,) [m/s, m/s, rad/s] and "velocity_error" (3,), the mean velocity
    less the command. "is_success" is not to have fallen, as in the benchmark of walks, or to
    rest where the command is zero.

    Arguments: as of `PositionBalanceEnv`, and `command`: a `GaitCommand`, a mapping of `ahead`,
    `left` [m/s] and `turn` [rad/s] or of ranges [lo, hi] of these, see `CommandSampler`. The
    option "command" of `reset` takes its place in that episode. `calibration` is what a policy
    observes in the place of the command, see `Calibration`; reward and info know the command.
    `config` is `configs/envs/velocity.yaml` by default.

    Version history: v0, first release.
    """

    known_terms = VELOCITY_TERMS
    true_views = (View, CommandView)
    kernel = staticmethod(velocity_step)
    step_block: ClassVar[type[MotorStep]] = VelocityStep
    _raw = True  # a learned policy has no estimator below it

    def __init__(
        self,
        robot: str | Path | Robot = "humanoid",
        config: EnvConfig | str | Path | Mapping | None = "velocity",
        *,
        command: CommandSampler | GaitCommand | Mapping | None = None,
        calibration: Calibration | None = None,
        **arguments: Any,
    ):
        self.command_sampler = CommandSampler() if command is None else command_sampler(command)
        self.calibration = calibration or Calibration()
        self._calibrated = self.calibration.arrays()
        self._evasion = np.array(self.calibration.evasion, float).reshape(-1, 4)
        self._take_orders(guarded_zeros(COMMAND_ENTRIES), type(self).__name__)
        self._mean, self._error = guarded_zeros(3), guarded_zeros(3)
        self._odometry, self._shift = guarded_zeros(3), guarded_zeros(3)
        self._found, self._quick, self._way = guarded_zeros(3), guarded_zeros(2), guarded_zeros(2)
        self._felt, self._evaded = guarded_zeros(4), guarded_zeros(3)
        super().__init__(robot, config, **arguments)

    def arguments(self) -> dict[str, Any]:
        own = {"command": self.command_sampler, "calibration": self.calibration}
        return {**super().arguments(), **own}

    def _commands(self, options: Mapping[str, Any]) -> Sequence[TimedCommand]:
        if "command" in options:
            return super()._commands(options)
        return self.command_sampler.sample(self.np_random, self.config.duration)

    def _begin(self, options: Mapping[str, Any]) -> None:
        super()._begin(options)
        self._known_orders[:], self._mean[:] = 0.0, 0.0
        self._odometry[:], self._shift[:] = 0.0, 0.0
        self._quick[:], self._way[:] = 0.0, 0.0
        self._felt[:], self._evaded[:] = (0.0, 0.0, 0.0, AGAIN), 0.0
        self.servos.target[:] = self.servos.hold
        self._begin_walk(options)
        self._error[:] = -self._known_orders[:3]

    @property
    def _known_orders(self) -> np.ndarray:
        return self._expect_orders("environment")

    def _velocity_error(self) -> np.ndarray:
        return self._error

    def _commanded(self) -> np.ndarray:
        return self._known_orders[:3]

    def _readings(self, kind: type[Block]) -> tuple[Any, ...]:
        read = (self._known_orders, self._error, self._calibrated, self._shift, self._way,
                self._evaded)  # fmt: skip
        return read if kind is CommandView else super()._readings(kind)

    def _step_members(self) -> dict[str, Any]:
        period = self.config.policy_period
        part = float(-np.expm1(-period / MEAN_TIME))
        course = Course(
            state=self.simulation.state_arrays,
            command=self._known_orders,
            mean=self._mean,
            error=self._error,
            part=part,
        )
        correction = Correction(
            state=self.state_source.state_arrays,
            command=self._known_orders,
            found=self._found,
            mean=self._odometry,
            shift=self._shift,
            part=part,
            rate=self.calibration.correction * period,
        )
        admittance = Admittance(
            command=self._known_orders,
            found=self._found,
            mean=self._odometry,
            quick=self._quick,
            way=self._way,
            part=float(-np.expm1(-period / QUICK_TIME)),
            gain=self.calibration.admittance,
        )
        evasion = Evasion(
            state=self.state_source.state_arrays,
            command=self._known_orders,
            knots=self._evasion,
            felt=self._felt,
            shown=self._evaded,
            omega=self.scales.omega,
            period=period,
        )
        smoothing = Smoothing(
            state=self.state_source.state_arrays,
            command=self._known_orders,
            least=self.calibration.smoothing,
            omega=self.scales.omega,
        )
        own = {"course": course, "correction": correction, "admittance": admittance,
               "evasion": evasion, "smoothing": smoothing}  # fmt: skip
        return {**super()._step_members(), **own}

    def _report(self) -> Program:
        return Program.of([(follow_timetable, self._follower(self._known_orders))])


vector_env = partial(make_vector_env, VelocityEnv)  # for gymnasium.make_vec
