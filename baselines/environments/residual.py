"""`poise/ResidualBalance-v0`: the action moves the targets of a momentum QP."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from poise.baselines.allowance import allowing, named
from poise.baselines.controller import CompiledController, Controller, Targets, as_base_controller
from poise.baselines.motions.motion import load_motion
from poise.baselines.motions.reference_motion import ReferenceMotion
from poise.baselines.motions.targets import motion_arrays
from poise.baselines.registry import ControllerConfig, load_controller
from poise.baselines.walking.schedule import (
    follow_timetable,
)
from poise.baselines.warmup import prepare
from poise.configs.errors import ConfigError
from poise.configs.numbers import whole_steps
from poise.configs.schema import build, to_dict
from poise.envs.balance.base import EnvConfig
from poise.envs.balance.episode import FAILURES, ROOT_FORCE, ROOT_MOMENT, StepEnd, judge_step
from poise.envs.balance.observation import Term, mirror_terms
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import CompiledStep, Erased, Kernel, Program, address_of
from poise.envs.robots.mirror import Mirror
from poise.envs.robots.robot import Robot
from poise.envs.vector.vector_env import make_vector_env

from .commanded import CommandedEnv
from .policy_step import (
    PolicyStep,
    TargetInputs,
    TickAccount,
    account_tick,
    add_torques,
    policy_tick,
    set_offsets,
    set_targets,
    soft_root_force,
)
from .scales import Lag, ResidualScales, action_term, make_residual


class ResidualBalanceEnv(CommandedEnv):
    """Keep a pushed robot on its feet by moving the targets of the momentum QP.

    Action: Box(−1, 1, (4,)), in the heading frame (origin at the middle of the soles, x forward, y
    left), held for one policy step (`policy_period`, 20 ms) while the QP runs at its own period.
    Zero is the controller alone, bit for bit.

    | index | name | 1 adds | to |
    | --- | --- | --- | --- |
    | 0 | com_x | `residual.com`, 0.2 m | CoM target, forward |
    | 1 | com_y | `residual.com`, 0.2 m | CoM target, left |
    | 2 | cop_x | `residual.cop`, 0.15 m | CoP target, forward |
    | 3 | cop_y | `residual.cop`, 0.15 m | CoP target, left |

    Scales above 0 for `residual.height` [m] and `residual.lean` [rad] append `com_z` (the CoM's
    height) and `lean_x`, `lean_y` (a rotation of the root's target about the axes x and y); one for
    `residual.momentum` [m h² ω] appends `momentum_x` and `momentum_y`, angular momentum that the
    posture is to carry. One for `residual.torque` [the motor's limit] appends an entry for each
    motor, whose torque is added to the controller's, within the limit. With `smoothing` τ > 0 [s]
    the targets follow the action as a first-order lag, a ← a + (1 − e^(−T/τ)) (action − a) per
    policy step T; a then is what the observation and the rewards call the action. With `gate`
    d₀ > 0 [m] the residual is scaled by 1 − exp(−(d/d₀)²), d the distance of the capture point from
    the reference's: at rest the controller is alone.

    Observation: <observation>

    It does not know the push. The reference is that of `motion`.

    A controller that walks follows `command`, a `GaitCommand` that may be set at any time; the
    option "command" of `reset` sets it from the start on: a mapping with `ahead`, `left` [m/s] and
    `turn` [rad/s], or a list of them, each from its `start` [s] on.

    <rewards>

    <start>

    Arguments: `robot` (a name, a .yaml file or a `Robot`), `config` (an `EnvConfig`, a .yaml file
    or a mapping), `controller` (a name, a .yaml file, a mapping or a `Controller`),
    `motion` (a name, a .yaml file, a .npz file or a `ReferenceMotion`), `residual` (what an action
    of 1 adds, a `ResidualScales`), `smoothing` (time constant of the action [s]), `gate` (distance
    from rest at which the residual opens [m]), <arguments>

    Version history: v0, first release.
    """

    scales_class: type[ResidualScales] = ResidualScales  #: whose fields `residual` has
    only_targets = True  #: the action moves targets and nothing else

    def __init__(
        self,
        robot: str | Path | Robot = "humanoid",
        config: EnvConfig | str | Path | Mapping | None = None,
        *,
        controller: str | Path | Mapping | ControllerConfig | Controller = "momentum-qp",
        motion: str | Path | ReferenceMotion = "standing",
        residual: ResidualScales | Mapping | None = None,
        smoothing: float = 0.0,
        gate: float = 0.0,
        render_mode: str | None = None,
        **overrides: Any,
    ):
        prepare()
        given = {} if residual is None else to_dict(residual)
        self.residual = build(self.scales_class, given, "residual")
        self._moved = np.flatnonzero(list(self.residual.entries().values()))
        if self.only_targets and len(self._moved) == 0 and self.residual.torque == 0.0:
            raise ConfigError("at least one scale must be above 0", field="residual")
        super().__init__(robot, config, render_mode=render_mode, **overrides)
        lag = build(Lag, to_dict({"smoothing": smoothing, "gate": gate}), "environment")
        self.smoothing, self.gate = lag.smoothing, lag.gate
        momentum = 10.0 * self.scales.momentum  # m h² ω
        limit, period = np.array(self.robot.torque_limit), self.config.policy_period
        self._residual = make_residual(self.residual, lag, period, momentum, limit)
        self._offsets = self._residual.offsets
        with allowing(named(controller)):  # the user hands it over, not a file
            self.controller = load_controller(controller, self.robot)
        self.motion = load_motion(motion, self.robot)
        self.targets = Targets.standing(self.robot, self.simulation.state)
        self._targets = self.targets.arrays()
        self._motion = motion_arrays(self.motion)

    @property
    def controller(self) -> Controller:
        """Whose targets the action moves; may be replaced between episodes.

        Raises ConfigError for one of another robot, or with a period that does not fit.
        """
        return self._controller

    @controller.setter
    def controller(self, controller: Controller) -> None:
        base = as_base_controller(controller, self.robot)
        made_for = base.robot
        if made_for.fingerprint != self.robot.fingerprint:  # compiled code trusts array sizes
            raise ConfigError(
                f"is for the robot {made_for.name!r}, not {self.robot.name!r}", field="controller"
            )
        period = base.period
        step, source = self.arrays.timestep, "environment"
        self.control_substeps = whole_steps(period, step, "controller period", source)
        self.ticks = whole_steps(self.config.policy_period, period, "policy_period", source)
        self._controller, self._base = controller, base
        self._take_walker(base)
        # all others are called from Python, tick by tick
        self._compiled = isinstance(controller, CompiledController) and controller.compiled
        self._com_offset = float(base.com_offset)
        self._unbind()

    def _unbind(self) -> None:
        super()._unbind()
        self._bound: tuple[PolicyStep, Block]  # what `_step` works on, the gains when it was made
        self._inputs: TargetInputs | None = None
        self._accounts: TickAccount | None = None

    def arguments(self) -> dict[str, Any]:
        """The arguments that make another environment like this one; robot and motion are shared.

        Raises ConfigError for a controller that cannot be made anew: its memory cannot be shared.
        """
        return {
            **super().arguments(),
            "controller": self._base.another(),
            "motion": self.motion,
            "residual": self.residual,
            "smoothing": self.smoothing,
            "gate": self.gate,
        }

    def _action_names(self) -> tuple[str, ...]:
        names = list(self.residual.entries())
        motors = self.robot.motor_names if self.residual.torque > 0.0 else ()
        return (*(names[i] for i in self._moved), *motors)

    def _mirror_actions(self, parts: dict[str, Mirror]) -> Mirror:
        names, targets = self.action_names, len(self._moved)
        terms = [action_term(name) for name in names[:targets]]
        if self.residual.torque > 0.0:
            terms.append(Term("motors", names[targets:], "1", "", "motors"))
        return mirror_terms(terms, parts)

    def _references(self) -> tuple[np.ndarray, np.ndarray]:
        return self._targets.q_ref, self._targets.v_ref

    def _begin(self, options: Mapping[str, Any]) -> None:
        self.controller.reset(self.state_source.state)
        self._begin_walk(options)
        self._offsets[:] = 0.0
        self._residual.torques[:] = 0.0
        set_targets(self._target_inputs())

    def _target_inputs(self) -> TargetInputs:
        """The block for `set_targets`; the same object until something is replaced."""
        if self._inputs is None:
            source = self.state_source
            self._inputs = TargetInputs(
                robot=source.arrays,
                state=source.state_arrays,
                clock=self.simulation.clock,
                motion=self._motion,
                com_offset=self._com_offset,
                residual=self._residual,
                targets=self._targets,
            )
        return self._inputs

    def compiled_step(self) -> CompiledStep | None:
        """The compiled policy step, for a controller with a compiled tick and solver; else None."""
        controller = self._controller
        if not self._compiled or not isinstance(controller, CompiledController):
            return None
        known, gains, world = self._step, controller.gains(), self.simulation.world()
        if known is not None:
            bound, made_with = self._bound
            if bound.world is world and made_with is gains:
                return known
        kernel, tick = controller.compiled_tick(self.state_source.state, self.targets)
        bound = self.bind(tick, kernel)
        self._bound = bound, gains
        self._step = self._stepping(bound)
        return self._step

    def _stepping(self, bound: PolicyStep) -> CompiledStep:
        """The compiled policy step that works on `bound`."""
        return CompiledStep(address_of(policy_tick, bound), bound, bound.ticks)

    def bind(self, tick: Block, kernel: Kernel) -> PolicyStep:
        """All that a policy step works on, with the controller's `kernel` and its block `tick`."""
        controller = self._controller
        assert isinstance(controller, CompiledController)  # only they have ticks
        found = controller.outputs()
        return PolicyStep(
            inputs=self._target_inputs(),
            kernel=kernel,
            tick=Erased(tick),
            tau=found.tau,
            root_wrench=found.root_wrench,
            failures=found.failures,
            soft_root=found.soft_root,
            world=self.simulation.world(),
            estimate=self.state_source.estimate,
            ticks=self.ticks,
            substeps=self.control_substeps,
            episode=self.episode,
            end=self._end_of_tick(tick),
        )

    def _end_of_tick(self, tick: Block) -> StepEnd:
        """The end of a policy step of the controller whose compiled tick works on `tick`."""
        return replace(self.step_end(), report=Program.of(self._reports(tick)))

    def _reports(self, tick: Any) -> list[tuple[Callable[..., None], Block]]:
        """The kernels that follow a judged policy step, before it is observed."""
        if self._walker is None:
            return []
        return [(follow_timetable, self._follower(self._walker))]

    def advance(self) -> None:
        step = self.compiled_step()
        if step is not None:
            step.play()
            self.check()
        else:
            self.episode.ticks[0] = 0  # the controller may have raised in the middle of a step
            for _ in range(self.ticks):
                self._tick_in_python()

    def check(self) -> None:
        """See `BalanceEnv`; it is the controller's."""
        self._base.check()

    def tick(self) -> None:
        if self.compiled_step() is None:
            self._tick_in_python()
        else:
            super().tick()

    def _tick_in_python(self) -> None:
        """Play the control tick of `policy_tick` with any controller."""
        sim, e, a = self.simulation, self.episode, self._target_inputs()
        ctrl, wrench = sim.views.ctrl, e.root_wrench
        if e.ticks[0] == 0:
            set_offsets(a.residual, a.state, a.motion, a.com_offset, e)
        set_targets(a)
        ctrl[:] = self.controller.torques(self.state_source.state, self.targets)
        add_torques(a.residual, self.arrays.torque_limit, ctrl)
        wrench[:] = self._base.root_wrench
        self._push_root(wrench)
        account_tick(self._account())
        sim.step(ctrl, self.control_substeps)
        self.state_source.update()
        e.ticks[0] += 1
        if e.ticks[0] == self.ticks:
            self._end_in_python()

    def _end_in_python(self) -> None:
        """End the policy step, as `end_tick` does."""
        self.episode.ticks[0] = 0
        self.episode.metrics[FAILURES] = self._base.failures
        judge_step(self.step_end().judge)
        if self._walker is not None:
            follow_timetable(self._follower(self._walker))
        self._observe()

    def _account(self) -> TickAccount:
        """The block of `account_tick`; the same object until the world is another."""
        world = self.simulation.world()
        if self._accounts is None or self._accounts.world is not world:
            self._accounts = TickAccount(world, self.controller.period, self.episode)
        return self._accounts

    def _push_root(self, wrench: np.ndarray) -> None:
        """Apply a soft root's wrench, and take away the last one."""
        qfrc_applied = self.simulation.views.qfrc_applied
        if not (wrench.any() or qfrc_applied[:6].any()):
            return
        soft_root_force(self.simulation.state_arrays, wrench, qfrc_applied)
        metrics = self.episode.metrics
        for metric, part in ((ROOT_FORCE, wrench[:3]), (ROOT_MOMENT, wrench[3:])):
            metrics[metric] = max(metrics[metric], float(np.linalg.norm(part)))


vector_env = partial(make_vector_env, ResidualBalanceEnv)  # for gymnasium.make_vec
